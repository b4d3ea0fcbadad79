//! A perspective view: where the pixels of a photograph look.

use std::f64::consts::PI;

/// A pinhole camera at the centre of the panorama.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Field of view across the image's width, radians; below π.
    pub fov: f64,
    /// Where the image's centre looks: azimuth counter-clockwise from +x seen from above, radians.
    pub azimuth: f64,
    /// And its elevation above the horizon, radians.
    pub elevation: f64,
    /// Rotation of the camera about its axis, clockwise as the photographer sees it, radians: with a positive roll
    /// the horizon sinks on the left of the picture.
    pub roll: f64,
}

impl View {
    /// Directions of the pixel centres of a `width` × `height` image (square pixels), row-major from the top
    /// left, and the solid angle of each pixel to second order, steradians.
    pub fn pixels(&self, width: usize, height: usize) -> (Vec<[f32; 3]>, Vec<f32>) {
        let half = (0.5 * self.fov).tan();
        let pixel = 2.0 * half / width as f64;
        let axes = self.axes();
        let (mut directions, mut areas) = (Vec::new(), Vec::new());
        for row in 0..height {
            let v = (0.5 * height as f64 - row as f64 - 0.5) * pixel;
            for column in 0..width {
                let u = (column as f64 + 0.5) * pixel - half;
                let length = (1.0 + u * u + v * v).sqrt();
                let at = |k: usize| (axes[0][k] + u * axes[1][k] + v * axes[2][k]) / length;
                directions.push([0, 1, 2].map(|k| at(k) as f32));
                areas.push((pixel * pixel / length.powi(3)) as f32);
            }
        }
        (directions, areas)
    }

    /// Forward, right and up as seen by the camera, native frame.
    fn axes(&self) -> [[f64; 3]; 3] {
        let ((sa, ca), (se, ce)) = (self.azimuth.sin_cos(), self.elevation.sin_cos());
        let forward = [ce * ca, ce * sa, se];
        // looking along +x with z up, −y is on the right
        let right = [sa, -ca, 0.0];
        let up = [-se * ca, -se * sa, ce];
        let (sr, cr) = self.roll.sin_cos();
        let rotated = |a: [f64; 3], b: [f64; 3], s: f64| [0, 1, 2].map(|k| cr * a[k] + s * b[k]);
        [forward, rotated(right, up, -sr), rotated(up, right, sr)]
    }

    /// The pixel of a `width` × `height` image that a unit direction falls on, row-major; nothing if it is not
    /// seen.
    pub fn pixel_of(&self, direction: [f32; 3], width: usize, height: usize) -> Option<usize> {
        let half = (0.5 * self.fov).tan();
        let pixel = 2.0 * half / width as f64;
        let axes = self.axes();
        let [forward, right, up] =
            axes.map(|axis| (0..3).map(|k| axis[k] * f64::from(direction[k])).sum::<f64>());
        if forward <= 0.0 {
            return None;
        }
        let column = (right / forward + half) / pixel;
        let row = 0.5 * height as f64 - up / forward / pixel;
        let inside = (0.0..width as f64).contains(&column) && (0.0..height as f64).contains(&row);
        inside.then(|| row as usize * width + column as usize)
    }

    /// Whether the field of view can be one.
    pub fn is_valid(&self) -> bool {
        self.fov > 0.0
            && self.fov < PI
            && [self.azimuth, self.elevation, self.roll].iter().all(|v| v.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: [f32; 3], b: [f64; 3]) -> bool {
        (0..3).all(|k| (f64::from(a[k]) - b[k]).abs() < 1e-6)
    }

    #[test]
    fn right_is_right_and_up_is_up() {
        let view = View { fov: PI / 2.0, azimuth: 0.0, elevation: 0.0, roll: 0.0 };
        let (directions, areas) = view.pixels(3, 3);
        let s = (1.0f64 + 4.0 / 9.0).sqrt();
        assert!(near(directions[4], [1.0, 0.0, 0.0]));
        assert!(near(directions[5], [1.0 / s, -2.0 / 3.0 / s, 0.0]), "{:?}", directions[5]);
        assert!(near(directions[1], [1.0 / s, 0.0, 2.0 / 3.0 / s]), "{:?}", directions[1]);
        assert!(areas[4] > areas[0]);
        // east of the photographer looking north
        let north = View { azimuth: PI / 2.0, ..view };
        assert!(near(north.pixels(3, 3).0[5], [2.0 / 3.0 / s, 1.0 / s, 0.0]));
        let zenith = View { elevation: PI / 2.0, ..view };
        assert!(near(zenith.pixels(1, 1).0[0], [0.0, 0.0, 1.0]));
        // the camera rotated clockwise: its right now points down
        let rolled = View { roll: PI / 2.0, ..view };
        assert!(near(rolled.pixels(3, 3).0[5], [1.0 / s, 0.0, -2.0 / 3.0 / s]));
    }

    #[test]
    fn a_pixels_direction_falls_on_that_pixel_and_nothing_behind_does() {
        let view = View { fov: 1.4, azimuth: -2.0, elevation: 0.5, roll: 0.3 };
        for (p, d) in view.pixels(13, 8).0.into_iter().enumerate() {
            assert_eq!(view.pixel_of(d, 13, 8), Some(p));
            assert_eq!(view.pixel_of(d.map(|c| -c), 13, 8), None);
        }
        assert_eq!(view.pixel_of([0.0, 0.0, -1.0], 13, 8), None);
    }

    #[test]
    fn six_square_views_cover_the_sphere() {
        let view = View { fov: PI / 2.0, azimuth: 0.7, elevation: 0.3, roll: 0.1 };
        let (directions, areas) = view.pixels(64, 64);
        let total: f64 = areas.iter().map(|a| f64::from(*a)).sum();
        assert!((total - 4.0 * PI / 6.0).abs() < 1e-3, "{total}");
        assert!(directions.iter().all(|d| (d.iter().map(|c| c * c).sum::<f32>() - 1.0).abs() < 1e-5));
        assert!(view.is_valid() && !View { fov: PI, ..view }.is_valid());
    }
}
