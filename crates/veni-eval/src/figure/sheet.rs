//! A grid of pictures with titles above the columns and names before the rows.

use std::path::Path;

use embedded_graphics::text::Alignment;

use super::canvas::{Canvas, LETTER};
use crate::Result;
use veni_image::tonemap::Tonemap;
use veni_image::{Panorama, Sheet};
use veni_light::sphere::Equirect;

const GAP: usize = 4;
/// The most letters of a name before a row.
const LETTERS: usize = 40;

/// Above the first row of cells, for the titles.
const TOP: usize = 20;

/// A contact sheet with words: pictures of one size, filled cell by cell; empty cells stay white.
#[derive(Clone, Debug)]
pub struct LabelledSheet {
    cells: Sheet,
    cell: [usize; 2],
    columns: Vec<String>,
    rows: Vec<String>,
}

impl LabelledSheet {
    /// An empty sheet of cells of `grid`'s size.
    pub fn new(grid: Equirect, columns: &[String], rows: &[String]) -> Self {
        let cell = [grid.width, grid.height];
        let cells = Sheet::spaced(columns.len(), rows.len(), cell, GAP, [255; 3]);
        Self { cells, cell, columns: columns.to_vec(), rows: rows.to_vec() }
    }

    /// Fills a cell with row-major pixels.
    ///
    /// # Panics
    /// If there is no such cell, or not one pixel for each of its pixels.
    pub fn place(&mut self, column: usize, row: usize, pixels: &[[u8; 3]]) {
        let [width, height] = self.cell;
        assert_eq!(pixels.len(), width * height, "a picture for a cell of {width} × {height}");
        self.cells.place(column, row, pixels.iter().copied());
    }

    /// Writes the PNG.
    ///
    /// # Errors
    /// As [`Canvas::write`].
    pub fn write(&self, path: &Path) -> Result<()> {
        self.canvas().write(path)
    }

    /// The cells, and the words around them.
    fn canvas(&self) -> Canvas {
        let longest = self.rows.iter().map(|name| name.chars().count()).max().unwrap_or(0).min(LETTERS);
        let margin = longest * LETTER[0] as usize + 2 * GAP;
        // the cells bring a gap of their own on every side
        let [left, top] = [margin - GAP, TOP - GAP];
        let [width, height] = self.cells.size();
        let mut canvas = Canvas::new(left + width, top + height);
        for (at, colour) in self.cells.pixels().iter().enumerate() {
            canvas.set([(left + at % width) as i32, (top + at / width) as i32], *colour);
        }
        let [width, height] = self.cell;
        for (column, title) in self.columns.iter().enumerate() {
            let middle = margin + column * (width + GAP) + width / 2;
            let title = shortened(title, width / LETTER[0] as usize);
            canvas.text(&title, [middle as i32, 10], Alignment::Center);
        }
        for (row, name) in self.rows.iter().enumerate() {
            let middle = TOP + row * (height + GAP) + height / 2;
            canvas.text(&shortened(name, LETTERS), [left as i32, middle as i32], Alignment::Right);
        }
        canvas
    }
}

/// Log radiance as the LDR metrics see it: under its own 98 % quantile.
pub fn display(grid: Equirect, log_radiance: &[f32]) -> Vec<[u8; 3]> {
    let panorama = Panorama::from_log(grid, log_radiance.as_chunks().0);
    let tonemap = Tonemap::reference(&panorama);
    panorama.pixels().iter().map(|pixel| tonemap.apply_u8(*pixel)).collect()
}

fn shortened(text: &str, letters: usize) -> String {
    if text.chars().count() <= letters { text.to_owned() } else { text.chars().take(letters).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_beside_their_names() {
        let grid = Equirect::new(32, 16);
        let names = |n: &[&str]| n.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>();
        let mut sheet = LabelledSheet::new(grid, &names(&["left", "right"]), &names(&["a sky"]));
        sheet.place(1, 0, &[[200, 10, 10]; 512]);
        let canvas = sheet.canvas();
        assert_eq!(canvas.size(), [5 * 6 + 8 + 2 * 36, 20 + 20]);
        let count = |colour: [u8; 3]| canvas.pixels().iter().filter(|p| **p == colour).count();
        assert_eq!(count([200, 10, 10]), 512);
        assert!(count([0; 3]) > 60, "titles and names are black");
        assert_eq!(canvas.pixel(38 + 36, 20), [200, 10, 10]);
        assert_eq!(canvas.pixel(38 + 10, 25), [255; 3]);
    }
}
