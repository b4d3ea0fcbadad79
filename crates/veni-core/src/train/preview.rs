//! A picture of how the run is doing: target | reconstruction | random sample, one row per panorama.

use std::path::Path;

use veni_image::tonemap::Tonemap;
use veni_image::{Panorama, Sheet};
use veni_light::output::Overwrite;
use veni_light::sphere::Equirect;

use crate::Result;

/// Pixels between the panoramas, and their colour.
const GAP: usize = 2;
const BLACK: [u8; 3] = [0; 3];

/// Writes rows of panoramas (log radiance on `grid`), each shown with its own 98 % quantile.
///
/// # Errors
/// [`Error::Io`](crate::Error::Io) if the file cannot be written.
///
/// # Panics
/// If rows have different lengths or an image another size.
pub(super) fn write(path: &Path, grid: Equirect, rows: &[Vec<Vec<f32>>]) -> Result<()> {
    let columns = rows.first().map_or(0, Vec::len);
    let mut sheet = Sheet::spaced(columns, rows.len(), [grid.width, grid.height], GAP, BLACK);
    for (r, row) in rows.iter().enumerate() {
        assert_eq!(row.len(), columns, "every preview row has as many images");
        for (c, image) in row.iter().enumerate() {
            let panorama = Panorama::from_log(grid, image.as_chunks().0);
            let tonemap = Tonemap::reference(&panorama);
            sheet.place(c, r, panorama.pixels().iter().map(|pixel| tonemap.apply_u8(*pixel)));
        }
    }
    sheet.write(path, Overwrite::Replace)
}
