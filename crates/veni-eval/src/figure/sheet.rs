//! A grid of pictures with titles above the columns and names before the rows.

use std::path::Path;

use embedded_graphics::text::Alignment;

use super::canvas::{Canvas, LETTER};
use crate::Result;
use veni_image::Panorama;
use veni_image::tonemap::Tonemap;
use veni_light::sphere::Equirect;

const GAP: usize = 4;

/// A grid of pictures of one size, filled cell by cell; empty cells stay white.
#[derive(Clone, Debug)]
pub struct Sheet {
    canvas: Canvas,
    cell: [usize; 2],
    margin: usize,
}

impl Sheet {
    /// An empty sheet of cells of `grid`'s size.
    pub fn new(grid: Equirect, columns: &[String], rows: &[String]) -> Self {
        let longest = rows.iter().map(|name| name.chars().count()).max().unwrap_or(0).min(40);
        let margin = longest * LETTER[0] as usize + 2 * GAP;
        let width = margin + columns.len() * (grid.width + GAP);
        let height = 20 + rows.len() * (grid.height + GAP);
        let mut sheet = Self { canvas: Canvas::new(width, height), cell: [grid.width, grid.height], margin };
        let letters = grid.width / LETTER[0] as usize;
        for (column, title) in columns.iter().enumerate() {
            let [x, _] = sheet.corner(column, 0);
            sheet.canvas.text(
                &shortened(title, letters),
                [(x + grid.width / 2) as i32, 10],
                Alignment::Center,
            );
        }
        for (row, name) in rows.iter().enumerate() {
            let [_, y] = sheet.corner(0, row);
            let place = [(margin - GAP) as i32, (y + grid.height / 2) as i32];
            sheet.canvas.text(&shortened(name, 40), place, Alignment::Right);
        }
        sheet
    }

    /// Fills a cell with row-major pixels.
    ///
    /// # Panics
    /// If there is not one per pixel of the cell.
    pub fn place(&mut self, column: usize, row: usize, pixels: &[[u8; 3]]) {
        let [width, height] = self.cell;
        assert_eq!(pixels.len(), width * height, "a picture for a cell of {width} × {height}");
        let [x, y] = self.corner(column, row);
        for (at, colour) in pixels.iter().enumerate() {
            self.canvas.set([(x + at % width) as i32, (y + at / width) as i32], *colour);
        }
    }

    /// Writes the PNG.
    ///
    /// # Errors
    /// As [`Canvas::write`].
    pub fn write(&self, path: &Path) -> Result<()> {
        self.canvas.write(path)
    }

    fn corner(&self, column: usize, row: usize) -> [usize; 2] {
        let [width, height] = self.cell;
        [self.margin + column * (width + GAP), 20 + row * (height + GAP)]
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
        let mut sheet = Sheet::new(grid, &names(&["left", "right"]), &names(&["a sky"]));
        sheet.place(1, 0, &[[200, 10, 10]; 512]);
        let canvas = &sheet.canvas;
        assert_eq!(canvas.size(), [5 * 6 + 8 + 2 * 36, 20 + 20]);
        let count = |colour: [u8; 3]| canvas.pixels().iter().filter(|p| **p == colour).count();
        assert_eq!(count([200, 10, 10]), 512);
        assert!(count([0; 3]) > 60, "titles and names are black");
        assert_eq!(canvas.pixel(38 + 36, 20), [200, 10, 10]);
        assert_eq!(canvas.pixel(38 + 10, 25), [255; 3]);
    }
}
