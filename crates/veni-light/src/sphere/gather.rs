//! Looking an image up at many fixed places, quickly: four pixels and weights per place, computed once.

use super::Equirect;

/// A table of bilinear lookups into images of one grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Gather {
    grid: Equirect,
    pixels: Vec<[u32; 4]>,
    weights: Vec<[f32; 4]>,
}

impl Gather {
    /// Lookups at free directions (any length but zero): columns wrap, rows end at the first and last.
    pub fn at(grid: Equirect, directions: &[[f32; 3]]) -> Self {
        let mut table = Self::with_capacity(grid, directions.len());
        for &direction in directions {
            let [x, y] = grid.pixel(direction);
            table.push(wrapped(x - 0.5, grid.width), clamped(y - 0.5, grid.height));
        }
        table
    }

    /// An empty table.
    pub(super) fn with_capacity(grid: Equirect, places: usize) -> Self {
        assert!(u32::try_from(grid.len()).is_ok(), "{grid:?} has too many pixels for a lookup table");
        Self { grid, pixels: Vec::with_capacity(places), weights: Vec::with_capacity(places) }
    }

    /// One more place from a pair of columns and a pair of rows.
    pub(super) fn push(&mut self, columns: Pair, rows: Pair) {
        let at = |j: usize, i: usize| (rows.at[j] * self.grid.width + columns.at[i]) as u32;
        let weight = |j: usize, i: usize| rows.weight[j] * columns.weight[i];
        self.pixels.push([at(0, 0), at(0, 1), at(1, 0), at(1, 1)]);
        self.weights.push([weight(0, 0), weight(0, 1), weight(1, 0), weight(1, 1)]);
    }

    /// The grid of the images that can be looked up.
    pub fn grid(&self) -> Equirect {
        self.grid
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Whether there are no places.
    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    /// For each place the four row-major pixel indices (two of one row, then two of the next) that count.
    pub fn pixels(&self) -> &[[u32; 4]] {
        &self.pixels
    }

    /// For each place the weights of [`Gather::pixels`]; they sum to 1.
    pub fn weights(&self) -> &[[f32; 4]] {
        &self.weights
    }

    /// The values of a row-major image at all places.
    ///
    /// # Panics
    /// If the image has another number of pixels than the table's grid.
    pub fn sample(&self, image: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let mut out = vec![[0.0; 3]; self.len()];
        self.sample_into(image, &mut out);
        out
    }

    /// [`Gather::sample`] into existing memory.
    ///
    /// # Panics
    /// If the image or `out` have the wrong length.
    pub fn sample_into(&self, image: &[[f32; 3]], out: &mut [[f32; 3]]) {
        let Equirect { width, height } = self.grid;
        assert_eq!(image.len(), self.grid.len(), "an image of {} pixels on {width} × {height}", image.len());
        assert_eq!(out.len(), self.len(), "{} results for {} places", out.len(), self.len());
        for ((out, pixels), w) in out.iter_mut().zip(&self.pixels).zip(&self.weights) {
            let p = pixels.map(|k| image[k as usize]);
            *out = [0, 1, 2].map(|c| p[0][c] * w[0] + p[1][c] * w[1] + (p[2][c] * w[2] + p[3][c] * w[3]));
        }
    }
}

/// Two neighbouring columns or rows and their weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pair {
    pub(super) at: [usize; 2],
    pub(super) weight: [f32; 2],
}

impl Pair {
    pub(super) fn new(low: usize, high: usize, fraction: f64) -> Self {
        Self { at: [low, high], weight: [(1.0 - fraction) as f32, fraction as f32] }
    }
}

/// The neighbours of a continuous index (centres at whole numbers) on a ring of `n`.
pub(super) fn wrapped(at: f64, n: usize) -> Pair {
    let low = at.floor();
    let cell = (low as i64).rem_euclid(n as i64) as usize;
    Pair::new(cell, (cell + 1) % n, at - low)
}

/// The neighbours of a continuous index (centres at whole numbers) in 0 … n − 1, held at both ends.
pub(super) fn clamped(at: f64, n: usize) -> Pair {
    let at = at.clamp(0.0, (n - 1) as f64);
    let low = at.floor();
    Pair::new(low as usize, (low as usize + 1).min(n - 1), at - low)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixel_centres_give_their_pixels() {
        let grid = Equirect::new(16, 8);
        let image: Vec<[f32; 3]> = (0..128).map(|k| [k as f32, -(k as f32), 1.0]).collect();
        let seen = Gather::at(grid, &grid.directions()).sample(&image);
        for (a, b) in seen.iter().flatten().zip(image.iter().flatten()) {
            assert!((a - b).abs() < 1e-3, "{a} for {b}");
        }
    }

    #[test]
    fn the_seam_wraps_and_poles_hold() {
        let grid = Equirect::new(4, 2);
        let image: Vec<[f32; 3]> = (0..8).map(|k| [k as f32; 3]).collect();
        // −x is the seam: halfway between the last and the first column; on the equator between the rows
        let seen = Gather::at(grid, &[[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).sample(&image);
        assert!((seen[0][0] - (0.0 + 3.0 + 4.0 + 7.0) / 4.0).abs() < 1e-5);
        assert!(seen[1][0] <= 3.0);
    }
}
