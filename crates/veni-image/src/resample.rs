//! Other sizes and orientations. Both axes are separable; rows are weighted by solid angle.

use std::f64::consts::PI;

use rayon::prelude::*;

use crate::panorama::Panorama;
use veni_light::sphere::Equirect;

/// Source positions and weights (summing to 1) of one output column.
type Taps = Vec<(usize, f64)>;

/// The same of an output row; `true` where the row is met beyond a pole, half a turn away.
type RowTaps = Vec<(usize, f64, bool)>;

impl Panorama {
    /// This panorama at another size. Along an axis that shrinks (or keeps its size) every output pixel is the mean
    /// radiance over the solid angle it covers, so that Σ L dω is conserved exactly; along an axis that grows,
    /// linear interpolation between pixel centres (columns wrap, rows continue beyond a pole on the other side).
    #[must_use]
    pub fn resample(&self, grid: Equirect) -> Self {
        self.resample_rotated(grid, 0.0)
    }

    /// The panorama rotated by `radians` about +z, counter-clockwise seen from above: what was seen in direction
    /// d is now seen in direction R d. A rotation by a whole number of columns moves pixels without touching their
    /// values; any other is linear between columns. Its latent is the old one rotated by the same angle.
    #[must_use]
    pub fn rotated(&self, radians: f64) -> Self {
        self.resample_rotated(self.grid, radians)
    }

    /// [`Panorama::rotated`] and [`Panorama::resample`] in one pass, with one interpolation instead of two.
    ///
    /// Where some of the panorama is unknown, each pixel is the mean of what is known under it.
    #[must_use]
    pub fn resample_rotated(&self, grid: Equirect, radians: f64) -> Self {
        let Some(known) = &self.known else {
            let pixels = self.average(&self.pixels, grid, radians);
            return Self { grid, pixels, known: None, ..self.without_pixels() };
        };
        let weighted: Vec<_> = self.pixels.iter().zip(known).map(|(p, k)| p.map(|v| v * k)).collect();
        let weights: Vec<_> = known.iter().map(|k| [*k; 3]).collect();
        let mut pixels = self.average(&weighted, grid, radians);
        let weights = self.average(&weights, grid, radians);
        for (pixel, [weight, ..]) in pixels.iter_mut().zip(&weights) {
            *pixel = if *weight > 0.0 { pixel.map(|v| v / weight) } else { [0.0; 3] };
        }
        let known = weights.iter().map(|w| w[0]).collect();
        Self { grid, pixels, known: Some(known), ..self.without_pixels() }
    }

    /// All that does not depend on the size.
    fn without_pixels(&self) -> Self {
        let (attributes, notes) = (self.attributes.clone(), self.notes.clone());
        Self {
            grid: self.grid,
            pixels: Vec::new(),
            attributes,
            provenance: self.provenance,
            known: None,
            notes,
        }
    }

    /// Values on the grid of this panorama, brought to another.
    fn average(&self, values: &[[f32; 3]], grid: Equirect, radians: f64) -> Vec<[f32; 3]> {
        let rows = row_taps(self.grid.height, grid.height);
        let columns = column_taps(self.grid.width, grid.width, shift(self.grid.width, radians));
        let width = self.grid.width;
        let mut pixels = vec![[0f32; 3]; grid.len()];
        pixels.par_chunks_exact_mut(grid.width).zip(&rows).for_each_init(
            || vec![[0f64; 3]; width],
            |merged, (out, row)| {
                merged.fill([0.0; 3]);
                for &(j, weight, beyond) in row {
                    let source = &values[j * width..][..width];
                    let (left, right) = source.split_at(if beyond { width / 2 } else { 0 });
                    for (sum, pixel) in merged.iter_mut().zip(right.iter().chain(left)) {
                        for (s, &v) in sum.iter_mut().zip(pixel) {
                            *s += weight * f64::from(v);
                        }
                    }
                }
                for (pixel, column) in out.iter_mut().zip(&columns) {
                    let mut sum = [0f64; 3];
                    for &(i, weight) in column {
                        for (s, v) in sum.iter_mut().zip(merged[i]) {
                            *s += weight * v;
                        }
                    }
                    *pixel = sum.map(|v| v as f32);
                }
            },
        );
        pixels
    }

    /// The mirror image (x, y, z) → (x, −y, z): columns in reverse order.
    #[must_use]
    pub fn mirror(&self) -> Self {
        let mut mirrored = self.clone();
        for row in mirrored.pixels.chunks_exact_mut(self.grid.width) {
            row.reverse();
        }
        let known = mirrored.known.iter_mut().flat_map(|known| known.chunks_exact_mut(self.grid.width));
        known.for_each(<[f32]>::reverse);
        mirrored
    }
}

/// Columns to the left that a rotation moves the content by; whole to within rounding becomes exactly whole.
fn shift(width: usize, radians: f64) -> f64 {
    let columns = (radians / (2.0 * PI)).rem_euclid(1.0) * width as f64;
    if (columns - columns.round()).abs() < 1e-6 { columns.round() } else { columns }
}

/// Columns: output i covers [i, i+1)·W/w + shift of the source, periodically.
fn column_taps(source: usize, target: usize, shift: f64) -> Vec<Taps> {
    let step = source as f64 / target as f64;
    let wrap = |i: f64| i.rem_euclid(source as f64) as usize % source;
    (0..target)
        .map(|i| {
            if target >= source {
                let centre = (i as f64 + 0.5) * step + shift - 0.5;
                linear(centre).map(|(at, weight)| (wrap(at), weight)).collect()
            } else {
                overlaps(i as f64 * step + shift, (i + 1) as f64 * step + shift)
                    .map(|(at, from, to)| (wrap(at), (to - from) / step))
                    .collect()
            }
        })
        .collect()
}

/// Rows: the overlap in θ weighted by ∫ sin θ dθ.
fn row_taps(source: usize, target: usize) -> Vec<RowTaps> {
    let step = source as f64 / target as f64;
    let last = source as f64 - 1.0;
    // cos a − cos b as a product keeps full precision near the poles
    let band = |from: f64, to: f64| {
        let (a, b) = (from * PI / source as f64, to * PI / source as f64);
        2.0 * (0.5 * (a + b)).sin() * (0.5 * (b - a)).sin()
    };
    (0..target)
        .map(|j| {
            if target >= source {
                let centre = (j as f64 + 0.5) * step - 0.5;
                return linear(centre)
                    .map(|(at, weight)| (at.clamp(0.0, last) as usize, weight, at < 0.0 || at > last))
                    .collect();
            }
            let (top, bottom) = (j as f64 * step, (j + 1) as f64 * step);
            let whole = band(top, bottom);
            overlaps(top, bottom)
                .map(|(at, from, to)| (at.min(last) as usize, band(from, to) / whole, false))
                .collect()
        })
        .collect()
}

/// The two neighbours of a continuous index and their weights; one where it is whole.
fn linear(at: f64) -> impl Iterator<Item = (f64, f64)> {
    let (low, fraction) = (at.floor(), at - at.floor());
    [(low, 1.0 - fraction), (low + 1.0, fraction)].into_iter().filter(|(_, weight)| *weight > 1e-12)
}

/// The unit cells that [from, to) meets, each with its part of the interval.
fn overlaps(from: f64, to: f64) -> impl Iterator<Item = (f64, f64, f64)> {
    let (first, end) = (from.floor() as i64, to.ceil() as i64);
    (first..end)
        .map(move |cell| (cell as f64, (cell as f64).max(from), ((cell + 1) as f64).min(to)))
        .filter(|(_, from, to)| to - from > 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Something with a sun, so that conservation is not an accident of smoothness.
    fn sky(width: usize, height: usize) -> Panorama {
        Panorama::from_fn(Equirect::new(width, height), |[x, y, z]| {
            let sun = if 0.6 * x + 0.5 * y + 0.62 * z > 0.995 { 5e4 } else { 0.0 };
            [1.0 + x + sun, 1.2 + y * z + sun, 1.1 + z + 0.9 * sun]
        })
    }

    fn energy(image: &Panorama) -> [f64; 3] {
        let mut sum = [0f64; 3];
        for (row, pixels) in image.pixels().chunks_exact(image.grid().width).enumerate() {
            for pixel in pixels {
                for (s, &v) in sum.iter_mut().zip(pixel) {
                    *s += f64::from(v) * image.grid().solid_angle(row);
                }
            }
        }
        sum
    }

    #[test]
    fn shrinking_conserves_energy() {
        let source = sky(1024, 512);
        let whole = energy(&source);
        for (w, h) in [(128, 64), (512, 256), (1000, 333), (100, 50), (7, 3), (2, 1), (1024, 512)] {
            for (a, b) in whole.iter().zip(energy(&source.resample(Equirect::new(w, h)))) {
                assert!((a - b).abs() < 1e-5 * a, "{w} × {h}: {a} became {b}");
            }
        }
    }

    #[test]
    fn the_same_size_is_the_same_image() {
        let source = sky(64, 32);
        assert_eq!(source.resample(source.grid()), source);
    }

    #[test]
    fn enlarging_interpolates_and_nearly_conserves() {
        let source = Panorama::from_fn(Equirect::new(64, 32), |[x, y, z]| [2.0 + x, 2.0 + y, 2.0 + z]);
        let large = source.resample(Equirect::new(256, 128));
        for (d, pixel) in large.grid().directions().into_iter().zip(large.pixels()) {
            for (c, v) in d.into_iter().zip(pixel) {
                assert!((2.0 + c - v).abs() < 0.005, "{d:?}: {pixel:?}");
            }
        }
        for (a, b) in energy(&source).iter().zip(energy(&large)) {
            assert!((a - b).abs() < 2e-3 * a);
        }
    }

    #[test]
    fn mixed_axes() {
        let uniform = Panorama::new(Equirect::new(10, 20), vec![[3.0; 3]; 200]);
        let other = uniform.resample(Equirect::new(25, 7));
        assert!(other.pixels().iter().flatten().all(|v| (v - 3.0).abs() < 1e-6));
    }

    #[test]
    fn a_rotation_moves_what_is_seen_counter_clockwise() {
        // a light at +x, rotated by a quarter, is at +y
        let source = Panorama::from_fn(Equirect::new(64, 32), |[x, y, z]| {
            let towards = if x > 0.9 { 10.0 } else { 1.0 };
            [towards, 1.0 + 0.1 * y, 1.0 + 0.1 * z]
        });
        let rotated = source.rotated(0.5 * PI);
        let (i, j) = rotated
            .grid()
            .directions()
            .iter()
            .enumerate()
            .max_by(|a, b| a.1[1].total_cmp(&b.1[1]))
            .map(|(k, _)| (k % 64, k / 64))
            .unwrap();
        assert_eq!(rotated.pixel(i, j)[0], 10.0);
        // whole columns: bits, and back again
        assert_eq!(rotated.rotated(-0.5 * PI), source);
        assert_eq!(source.rotated(2.0 * PI), source);
        assert_eq!(source.rotated(2.0 * PI / 64.0).pixel(9, 3), source.pixel(10, 3));
        // half a column: the mean of two
        let half = source.rotated(PI / 64.0);
        let mean = 0.5 * (source.pixel(20, 9)[1] + source.pixel(21, 9)[1]);
        assert!((half.pixel(20, 9)[1] - mean).abs() < 1e-6);
    }

    #[test]
    fn mirroring_flips_y() {
        let source = Panorama::from_fn(Equirect::new(16, 8), |[x, y, z]| [x, y, z]);
        let mirrored = source.mirror();
        for (d, pixel) in source.grid().directions().into_iter().zip(mirrored.pixels()) {
            assert!((d[0] - pixel[0]).abs() + (d[1] + pixel[1]).abs() + (d[2] - pixel[2]).abs() < 1e-6);
        }
        assert_eq!(mirrored.mirror(), source);
    }

    #[test]
    fn rotating_while_shrinking_conserves_energy() {
        let source = sky(256, 128);
        for (a, b) in
            energy(&source).iter().zip(energy(&source.resample_rotated(Equirect::new(64, 32), 1.234)))
        {
            assert!((a - b).abs() < 1e-5 * a);
        }
    }
}
