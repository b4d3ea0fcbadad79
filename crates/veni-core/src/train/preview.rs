//! A picture of how the run is doing: target | reconstruction | random sample, one row per panorama.

use std::path::Path;

use image::{ImageFormat, RgbImage};

use veni_light::output::{Overwrite, write_atomic};
use veni_image::Panorama;
use veni_image::tonemap::Tonemap;
use veni_light::sphere::Equirect;
use crate::{Error, Result};

/// Pixels between the panoramas.
const GAP: u32 = 2;

/// Writes rows of panoramas (log radiance on `grid`), each shown with its own 98 % quantile.
///
/// # Errors
/// [`Error::Io`] if the file cannot be written.
///
/// # Panics
/// If rows have different lengths or an image another size.
pub(super) fn write(path: &Path, grid: Equirect, rows: &[Vec<Vec<f32>>]) -> Result<()> {
    let columns = rows.first().map_or(0, Vec::len) as u32;
    let (w, h) = (grid.width as u32, grid.height as u32);
    let mut sheet = RgbImage::new(columns * (w + GAP), rows.len() as u32 * (h + GAP));
    for (r, row) in (0..).zip(rows) {
        assert_eq!(row.len() as u32, columns, "every preview row has as many images");
        for (c, image) in (0..).zip(row) {
            let panorama = Panorama::from_log(grid, image.as_chunks().0);
            let tonemap = Tonemap::reference(&panorama);
            for (p, pixel) in (0..).zip(panorama.pixels()) {
                let at = (c * (w + GAP) + p % w, r * (h + GAP) + p / w);
                sheet.put_pixel(at.0, at.1, image::Rgb(tonemap.apply_u8(*pixel)));
            }
        }
    }
    write_atomic(path, Overwrite::Replace, |out| {
        sheet.write_to(out, ImageFormat::Png).map_err(|e| Error::invalid(format!("{}: {e}", path.display())))
    })
}
