//! The equirectangular (latitude–longitude) pixel grid. MODEL (1).

use std::f64::consts::PI;

/// An equirectangular grid of `width` × `height` pixels; see the [module conventions](super).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Equirect {
    /// Columns, W.
    pub width: usize,
    /// Rows, H.
    pub height: usize,
}

impl Equirect {
    /// A grid; both sides must be positive.
    ///
    /// # Panics
    /// If a side is 0.
    pub fn new(width: usize, height: usize) -> Self {
        assert!(width > 0 && height > 0, "an equirectangular grid needs pixels, got {width} × {height}");
        Self { width, height }
    }

    /// Number of pixels, W·H.
    pub fn len(self) -> usize {
        self.width * self.height
    }

    /// Never true; here because `len` is.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Polar angle θ of the centre of row `row`, radians from +z.
    pub fn polar(self, row: usize) -> f64 {
        PI * (row as f64 + 0.5) / self.height as f64
    }

    /// Azimuth φ of the centre of column `column`, radians counter-clockwise from +x.
    pub fn azimuth(self, column: usize) -> f64 {
        PI - 2.0 * PI * (column as f64 + 0.5) / self.width as f64
    }

    /// Unit direction of a pixel centre.
    pub fn direction(self, column: usize, row: usize) -> [f32; 3] {
        let ((sin_t, cos_t), (sin_p, cos_p)) = (self.polar(row).sin_cos(), self.azimuth(column).sin_cos());
        [(sin_t * cos_p) as f32, (sin_t * sin_p) as f32, cos_t as f32]
    }

    /// All pixel-centre directions, row-major.
    pub fn directions(self) -> Vec<[f32; 3]> {
        let phases: Vec<_> = (0..self.width).map(|i| self.azimuth(i).sin_cos()).collect();
        let mut out = Vec::with_capacity(self.len());
        for j in 0..self.height {
            let (sin_t, cos_t) = self.polar(j).sin_cos();
            out.extend(phases.iter().map(|(s, c)| [(sin_t * c) as f32, (sin_t * s) as f32, cos_t as f32]));
        }
        out
    }

    /// Exact solid angle of one pixel of row `row`, steradians: (2π/W)(cos θ_top − cos θ_bottom).
    /// Over all pixels it sums to 4π.
    pub fn solid_angle(self, row: usize) -> f64 {
        let edge = |j: usize| PI * j as f64 / self.height as f64;
        // cos a − cos b as a product keeps full precision near the poles
        let (a, b) = (edge(row), edge(row + 1));
        2.0 * PI / self.width as f64 * 2.0 * (0.5 * (a + b)).sin() * (0.5 * (b - a)).sin()
    }

    /// Continuous pixel coordinates (column, row) of a direction; pixel centres lie at half-integers,
    /// the column is in [0, W), the row in [0, H]. The direction need not be normalised, but not zero.
    pub fn pixel(self, direction: [f32; 3]) -> [f64; 2] {
        let [x, y, z] = direction.map(f64::from);
        let polar = x.hypot(y).atan2(z);
        let turns = (PI - y.atan2(x)) / (2.0 * PI);
        [(turns - turns.floor()) * self.width as f64 % self.width as f64, polar / PI * self.height as f64]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solid_angles_sum_to_the_whole_sphere() {
        for (w, h) in [(1, 1), (2, 1), (128, 64), (1000, 333)] {
            let grid = Equirect::new(w, h);
            let total: f64 = (0..h).map(|j| grid.solid_angle(j) * w as f64).sum();
            assert!((total - 4.0 * PI).abs() < 1e-12, "{w}×{h}: {total}");
        }
    }

    #[test]
    fn pixel_inverts_direction() {
        let grid = Equirect::new(37, 18);
        for row in 0..18 {
            for column in 0..37 {
                let [x, y] = grid.pixel(grid.direction(column, row));
                assert!((x - column as f64 - 0.5).abs() < 1e-4 && (y - row as f64 - 0.5).abs() < 1e-4);
            }
        }
    }
}
