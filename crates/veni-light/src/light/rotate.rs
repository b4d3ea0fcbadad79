//! A light rotated about z.

use std::f64::consts::PI;

use super::lit::Light;

impl Light {
    /// The same scene rotated by `angle` radians about z, counter-clockwise seen from above. Lights, harmonics and
    /// irradiance rotate exactly; the residual exactly by whole columns, between them as the mean of two columns by
    /// their distance, which keeps the energy.
    #[must_use]
    pub fn rotated(&self, angle: f64) -> Self {
        let mut out = self.clone();
        out.lights = self.lights.rotated(angle);
        out.harmonics = self.harmonics.rotated_about_z(angle);
        out.angle = self.angle + angle;
        // a column looks where one `shift` to its right looked
        let width = self.grid.width;
        let shift = angle / (2.0 * PI) * width as f64;
        let nearest = shift.round();
        let (whole, part) = if (shift - nearest).abs() < 1e-9 * width as f64 {
            (nearest, 0.0)
        } else {
            (shift.floor(), shift - shift.floor())
        };
        let whole = whole.rem_euclid(width as f64) as usize % width;
        let rows = out.residual.chunks_exact_mut(width).zip(self.residual.chunks_exact(width));
        for (out, row) in rows {
            for (i, pixel) in out.iter_mut().enumerate() {
                let (a, b) = (row[(i + whole) % width], row[(i + whole + 1) % width]);
                *pixel = [0, 1, 2].map(|c| a[c] + part as f32 * (b[c] - a[c]));
            }
        }
        out
    }
}
