//! The map at several resolutions, and the cells of caps on it.

use std::f64::consts::PI;
use std::ops::Range;

use crate::sphere::Equirect;
use crate::tasks;

/// The map as means over blocks of k × k pixels; the last block of a row or column may be smaller.
#[derive(Clone, Debug)]
pub(in crate::light) struct Level {
    grid: Equirect,
    k: usize,
    width: usize,
    rows: Vec<Row>,
    /// Sine and cosine of the azimuth of the centres of the columns.
    columns: Vec<(f64, f64)>,
    /// Mean radiance, row-major; for k = 1 nothing, since the pixels have it.
    means: Vec<[f32; 3]>,
}

/// A level with its radiance.
#[derive(Clone, Copy, Debug)]
pub(in crate::light) struct View<'a> {
    level: &'a Level,
    cells: &'a [[f32; 3]],
}

/// A row of cells.
#[derive(Clone, Copy, Debug)]
struct Row {
    sin: f64,
    cos: f64,
    /// Of a pixel's width, steradians.
    solid_angle: f64,
}

/// One cell of a cap.
#[derive(Clone, Copy, Debug)]
pub(in crate::light) struct Cell {
    pub(in crate::light) direction: [f64; 3],
    pub(in crate::light) solid_angle: f64,
    pub(in crate::light) radiance: [f32; 3],
    /// Where it is, row-major.
    pub(in crate::light) index: usize,
}

impl Level {
    pub(in crate::light) fn new(grid: Equirect, pixels: &[[f32; 3]], k: usize) -> Self {
        let (width, height) = (grid.width.div_ceil(k), grid.height.div_ceil(k));
        let row = |j: usize| {
            let edge = |j: usize| PI * j.min(grid.height) as f64 / grid.height as f64;
            let (a, b) = (edge(j * k), edge((j + 1) * k));
            let (sin, cos) = (0.5 * (a + b)).sin_cos();
            Row { sin, cos, solid_angle: 4.0 * PI / grid.width as f64 * sin * (0.5 * (b - a)).sin() }
        };
        let column = |i: usize| {
            let middle = 0.5 * (i * k + ((i + 1) * k).min(grid.width)) as f64;
            (PI - 2.0 * PI * middle / grid.width as f64).sin_cos()
        };
        let mut level = Self {
            grid,
            k,
            width,
            rows: (0..height).map(row).collect(),
            columns: (0..width).map(column).collect(),
            means: vec![[0.0; 3]; if k == 1 { 0 } else { width * height }],
        };
        level.refresh(pixels, 0..grid.height);
        level
    }

    /// With a radiance of its own, whatever becomes of the pixels.
    pub(in crate::light) fn keep(mut self, pixels: &[[f32; 3]]) -> Self {
        if self.means.is_empty() {
            self.means = pixels.to_vec();
        }
        self
    }

    /// The radiance that it keeps.
    pub(in crate::light) fn kept(&self) -> View<'_> {
        self.view(&[])
    }

    /// Takes the pixels of these rows again.
    pub(in crate::light) fn refresh(&mut self, pixels: &[[f32; 3]], rows: Range<usize>) {
        let (k, width, grid) = (self.k, self.width, self.grid);
        let cells = rows.start / k..rows.end.div_ceil(k);
        if k == 1 {
            return;
        }
        let first = cells.start;
        let part = &mut self.means[cells.start * width..cells.end * width];
        tasks::each(
            part.chunks_mut(width).enumerate(),
            || (),
            |(), (j, out)| {
                let rows = (first + j) * k..((first + j + 1) * k).min(grid.height);
                let total: f64 = rows.clone().map(|row| grid.solid_angle(row)).sum();
                out.fill([0.0; 3]);
                for row in rows {
                    let weight = (grid.solid_angle(row) / total) as f32;
                    let pixels = &pixels[row * grid.width..(row + 1) * grid.width];
                    for (out, block) in out.iter_mut().zip(pixels.chunks(k)) {
                        let sum =
                            block.iter().fold([0f32; 3], |s, p| [s[0] + p[0], s[1] + p[1], s[2] + p[2]]);
                        let weight = weight / block.len() as f32;
                        for c in 0..3 {
                            out[c] += weight * sum[c];
                        }
                    }
                }
            },
        );
    }

    /// Angle that a cell spans from top to bottom, radians.
    pub(in crate::light) fn cell_angle(&self) -> f64 {
        PI * self.k as f64 / self.grid.height as f64
    }

    /// With the radiance of `pixels`, those that it was made of.
    pub(in crate::light) fn view<'a>(&'a self, pixels: &'a [[f32; 3]]) -> View<'a> {
        View { level: self, cells: if self.means.is_empty() { pixels } else { &self.means } }
    }

    /// Of the map.
    pub(in crate::light) fn grid(&self) -> Equirect {
        self.grid
    }

    /// Number of columns.
    pub(in crate::light) fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    pub(in crate::light) fn height(&self) -> usize {
        self.rows.len()
    }

    /// The rows of pixels of the map that a cap touches.
    pub(in crate::light) fn pixel_rows(&self, centre: [f64; 3], radius: f64) -> Range<usize> {
        let rows = self.cap_rows(centre, radius);
        rows.start * self.k..(rows.end * self.k).min(self.grid.height)
    }

    /// The rows that may have cells in a cap.
    pub(in crate::light) fn cap_rows(&self, centre: [f64; 3], radius: f64) -> Range<usize> {
        let polar = centre[0].hypot(centre[1]).atan2(centre[2]);
        let scale = self.grid.height as f64 / PI / self.k as f64;
        let first = ((polar - radius) * scale).floor().max(0.0) as usize;
        let end = (((polar + radius) * scale).ceil() as usize).clamp(1, self.rows.len());
        first.min(end - 1)..end
    }

    /// Solid angle of a whole cell of a row, steradians.
    pub(in crate::light) fn area(&self, row: usize) -> f64 {
        self.rows[row].solid_angle * self.k as f64
    }

    /// The columns of a row whose centres lie in a cap: the first, possibly negative, and how many.
    pub(in crate::light) fn cap_columns(&self, row: usize, centre: [f64; 3], radius: f64) -> (isize, usize) {
        let (Row { sin, cos, .. }, across) = (self.rows[row], centre[0].hypot(centre[1]));
        let (over, under) = (radius.cos() - cos * centre[2], sin * across);
        if over > under {
            return (0, 0);
        }
        if over <= -under {
            return (0, self.width);
        }
        let half = (over / under).acos() * self.grid.width as f64 / (2.0 * PI) / self.k as f64;
        let middle = (PI - centre[1].atan2(centre[0])) / (2.0 * PI) * self.grid.width as f64 / self.k as f64;
        let (first, last) = ((middle - half - 0.5).ceil(), (middle + half - 0.5).floor());
        (first as isize, ((last - first + 1.0).max(0.0) as usize).min(self.width))
    }
}

impl<'a> View<'a> {
    /// The radiance of every cell, row-major.
    pub(in crate::light) fn cells(self) -> &'a [[f32; 3]] {
        self.cells
    }

    /// The resolution.
    pub(in crate::light) fn level(self) -> &'a Level {
        self.level
    }

    pub(in crate::light) fn cell(self, index: usize) -> Cell {
        self.at(index / self.level.width, index % self.level.width)
    }

    /// Every cell, row-major.
    pub(in crate::light) fn all(self) -> impl Iterator<Item = Cell> + use<'a> {
        let columns = 0..self.level.width;
        (0..self.level.rows.len())
            .flat_map(move |row| columns.clone().map(move |column| self.at(row, column)))
    }

    #[inline]
    fn at(self, row: usize, column: usize) -> Cell {
        let Level { grid, k, width, rows, columns, .. } = self.level;
        let index = row * width + column;
        let (row, (sin, cos)) = (rows[row], columns[column]);
        let across = ((column + 1) * k).min(grid.width) - column * k;
        Cell {
            direction: [row.sin * cos, row.sin * sin, row.cos],
            solid_angle: row.solid_angle * across as f64,
            radiance: self.cells[index],
            index,
        }
    }

    /// Every cell whose centre is at most `radius` from the direction `centre`.
    pub(in crate::light) fn cap(self, centre: [f64; 3], radius: f64, mut each: impl FnMut(Cell)) {
        let width = self.level.width;
        for row in self.level.cap_rows(centre, radius) {
            let (first, count) = self.level.cap_columns(row, centre, radius);
            let mut column = first.rem_euclid(width as isize) as usize;
            for _ in 0..count {
                each(self.at(row, column));
                column = if column + 1 == width { 0 } else { column + 1 };
            }
        }
    }
}
