//! Contact sheets: several 8-bit pictures of one size, side by side in one PNG; and any 8-bit sRGB picture as a PNG file.

use std::io::Write;
use std::path::Path;

use veni_light::output::{Overwrite, write_atomic};

use crate::encoder::encoder;
use crate::{Error, Result};

/// Pixels between pictures.
const GAP: usize = 4;
/// The colour between them, and of cells that stay empty.
const BACKGROUND: [u8; 3] = [24; 3];

/// A grid of cells, sRGB, row-major.
#[derive(Clone, Debug)]
pub struct Sheet {
    gap: usize,
    cell: [usize; 2],
    width: usize,
    height: usize,
    pixels: Vec<[u8; 3]>,
}

impl Sheet {
    /// `columns` x `rows` empty cells of `width` x `height` pixels.
    pub fn new(columns: usize, rows: usize, width: usize, height: usize) -> Self {
        Self::spaced(columns, rows, [width, height], GAP, BACKGROUND)
    }

    /// A single cell without a border.
    pub fn plain(width: usize, height: usize) -> Self {
        Self::spaced(1, 1, [width, height], 0, BACKGROUND)
    }

    /// The same with `gap` pixels between cells, and this colour there.
    #[must_use]
    pub fn spaced(
        columns: usize,
        rows: usize,
        [width, height]: [usize; 2],
        gap: usize,
        colour: [u8; 3],
    ) -> Self {
        let side = |cells: usize, size: usize| cells * (size + gap) + gap;
        let cell = [width, height];
        let (width, height) = (side(columns, width), side(rows, height));
        Self { gap, cell, width, height, pixels: vec![colour; width * height] }
    }

    /// Fills the cell in `column` of `row` with its pixels, row-major.
    ///
    /// # Panics
    /// If there is no such cell.
    pub fn place(&mut self, column: usize, row: usize, pixels: impl IntoIterator<Item = [u8; 3]>) {
        let [width, height] = self.cell;
        let gap = self.gap;
        let (left, top) = (column * (width + gap) + gap, row * (height + gap) + gap);
        for (at, pixel) in pixels.into_iter().take(width * height).enumerate() {
            self.pixels[(top + at / width) * self.width + left + at % width] = pixel;
        }
    }

    /// Width and height of the whole, in pixels.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// All pixels, sRGB, row-major from the top left.
    pub fn pixels(&self) -> &[[u8; 3]] {
        &self.pixels
    }

    /// Writes the PNG.
    ///
    /// # Errors
    /// As [`write_png`].
    pub fn write(&self, path: &Path, overwrite: Overwrite) -> Result<()> {
        write_png(path, [self.width, self.height], &self.pixels, overwrite)
    }
}

/// Writes an 8-bit sRGB picture, row-major from the top left, as PNG.
///
/// # Errors
/// [`Error::Exists`] if `path` exists and may not be replaced, [`Error::Io`] if it cannot be written, [`Error::Invalid`] if there
/// are not W·H pixels or a side is 0 or too long for PNG.
pub fn write_png(
    path: &Path,
    [width, height]: [usize; 2],
    pixels: &[[u8; 3]],
    overwrite: Overwrite,
) -> Result<()> {
    let broken = |e: png::EncodingError| match e {
        png::EncodingError::IoError(e) => Error::io(path, "write", e),
        other => Error::invalid(format!("PNG: {other}")).in_file(path),
    };
    if pixels.len() != width * height {
        let count = pixels.len();
        return Err(Error::invalid(format!("{count} pixels for {width} × {height}")).in_file(path));
    }
    write_atomic(path, overwrite, |file| {
        let encoder =
            encoder(&mut *file, [width, height], png::ColorType::Rgb).map_err(|e| e.in_file(path))?;
        let mut writer = encoder.write_header().map_err(broken)?;
        writer.write_image_data(pixels.as_flattened()).map_err(broken)?;
        writer.finish().map_err(broken)?;
        file.flush().map_err(|e| Error::io(path, "write", e))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_do_not_touch_and_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sheet.png");
        let mut sheet = Sheet::new(2, 3, 5, 4);
        sheet.place(1, 2, [[200, 100, 50]; 20]);
        sheet.place(0, 0, (0..20).map(|k| [k, 0, 0]));
        sheet.write(&path, Overwrite::Refuse).unwrap();
        assert!(sheet.write(&path, Overwrite::Refuse).is_err());
        let image = image::open(&path).unwrap().to_rgb8();
        assert_eq!(image.dimensions(), (2 * 5 + 3 * 4, 3 * 4 + 4 * 4));
        assert_eq!(image.get_pixel(4 + 2, 4 + 1).0, [7, 0, 0]);
        assert_eq!(image.get_pixel(13, 20).0, [200, 100, 50]);
        assert_eq!(image.get_pixel(12, 20).0, BACKGROUND);
        let painted = image.pixels().filter(|p| p.0 != BACKGROUND).count();
        assert_eq!(painted, 40);
    }
}
