//! Integrals of the basis over the pixels of a panorama. LIGHT (11).

use std::f64::consts::PI;

use super::{Basis, Sh};
use crate::sphere::Equirect;
use crate::tasks;

/// Nodes and weights of Gauss–Legendre quadrature on [0, 1], three points: exact to degree 5, and rows are narrow.
const NODES: [(f64, f64); 3] =
    [(0.112_701_665_379_258_31, 5.0 / 18.0), (0.5, 4.0 / 9.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];
/// A row is integrated in parts no higher than this, radians.
const PART: f64 = 0.02;
/// Rows of one task.
const ROWS: usize = 64;

/// ∫ Y_lm dω over every pixel is a product of a factor of the row and one of the column.
pub(super) struct Integrals {
    grid: Equirect,
    order: usize,
    /// Per row and l, m ≥ 0, at l(l+1)/2 + m: ∫ Y_lm(θ, 0) sin θ dθ.
    rows: Vec<f64>,
    /// Per column and m = 0 … order: ∫ cos mφ dφ and ∫ sin mφ dφ over the column.
    columns: Vec<(f64, f64)>,
}

/// ∫ Y_lm dω over every pixel of `grid`, row-major, (`order` + 1)² numbers a pixel in the order of [`Sh`]: with them the
/// [moments](crate::field::Field::moments) of a field are its coefficients, those of [`Sh::of_field`].
pub fn pixel_integrals(grid: Equirect, order: usize) -> Vec<f32> {
    let (integrals, count) = (Integrals::new(grid, order), (order + 1) * (order + 1));
    let mut all = Vec::with_capacity(grid.len() * count);
    let mut one = vec![0.0; count];
    for index in 0..grid.len() {
        integrals.of_pixel(index % grid.width, index / grid.width, &mut one);
        all.extend(one.iter().map(|v| *v as f32));
    }
    all
}

impl Integrals {
    pub(super) fn new(grid: Equirect, order: usize) -> Self {
        let (basis, bands) = (Basis::new(order), (order + 1) * (order + 2) / 2);
        let step = PI / grid.height as f64;
        let parts = (step / PART).ceil().max(1.0);
        let mut values = vec![0.0; basis.len()];
        let mut rows = vec![0.0; grid.height * bands];
        for (row, sums) in rows.chunks_exact_mut(bands).enumerate() {
            for part in 0..parts as usize {
                for (node, weight) in NODES {
                    let (sin, cos) = (step * (row as f64 + (part as f64 + node) / parts)).sin_cos();
                    basis.evaluate([sin, 0.0, cos], &mut values);
                    let weight = weight * step / parts * sin;
                    for l in 0..=order {
                        for m in 0..=l {
                            sums[l * (l + 1) / 2 + m] += weight * values[l * l + l + m];
                        }
                    }
                }
            }
            // so that the areas are exact to the last digit
            let scale = grid.solid_angle(row) * grid.width as f64 / (2.0 * PI) * (0.25 / PI).sqrt() / sums[0];
            sums.iter_mut().for_each(|sum| *sum *= scale);
        }
        let width = 2.0 * PI / grid.width as f64;
        let column = |index: usize| {
            let (i, m) = (index / (order + 1), index % (order + 1));
            let span = if m == 0 { width } else { 2.0 * (0.5 * m as f64 * width).sin() / m as f64 };
            let (sin, cos) = (m as f64 * grid.azimuth(i)).sin_cos();
            (span * cos, span * sin)
        };
        let columns = (0..grid.width * (order + 1)).map(column).collect();
        Self { grid, order, rows, columns }
    }

    /// Σ over the pixels of their values times the integrals.
    pub(super) fn project<const L: usize>(&self, pixels: &[[f32; 3]]) -> Sh<L> {
        let parts = pixels.chunks(ROWS * self.grid.width).enumerate();
        let of_rows = |(part, pixels): (usize, &[[f32; 3]])| {
            let mut sh = Sh::<L>::zero();
            for (row, pixels) in pixels.chunks(self.grid.width).enumerate() {
                self.add_row(part * ROWS + row, pixels, &mut sh.coefficients);
            }
            sh
        };
        let sums = tasks::map(parts, || (), |(), part| of_rows(part));
        sums.iter().fold(Sh::zero(), |sum, part| sum.plus(part))
    }

    fn add_row(&self, row: usize, pixels: &[[f32; 3]], out: &mut [[f64; 3]]) {
        let (order, bands) = (self.order, (self.order + 1) * (self.order + 2) / 2);
        let mut waves = vec![[[0f64; 3]; 2]; order + 1];
        for (pixel, phases) in pixels.iter().zip(self.columns.chunks_exact(order + 1)) {
            let pixel = pixel.map(f64::from);
            for ([even, odd], (cos, sin)) in waves.iter_mut().zip(phases) {
                for c in 0..3 {
                    even[c] += cos * pixel[c];
                    odd[c] += sin * pixel[c];
                }
            }
        }
        let rows = &self.rows[row * bands..(row + 1) * bands];
        for l in 0..=order {
            for (m, [even, odd]) in waves.iter().enumerate().take(l + 1) {
                let weight = rows[l * (l + 1) / 2 + m];
                for c in 0..3 {
                    out[l * l + l + m][c] += weight * even[c];
                    if m > 0 {
                        out[l * l + l - m][c] += weight * odd[c];
                    }
                }
            }
        }
    }

    /// The integrals over one pixel, in the order of the coefficients.
    pub(super) fn of_pixel(&self, column: usize, row: usize, out: &mut [f64]) {
        let (order, bands) = (self.order, (self.order + 1) * (self.order + 2) / 2);
        for l in 0..=order {
            for m in 0..=l {
                let weight = self.rows[row * bands + l * (l + 1) / 2 + m];
                let (cos, sin) = self.columns[column * (order + 1) + m];
                out[l * l + l + m] = weight * cos;
                if m > 0 {
                    out[l * l + l - m] = weight * sin;
                }
            }
        }
    }
}
