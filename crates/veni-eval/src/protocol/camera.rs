//! What a camera makes of part of a panorama: a photograph of eight bits. MODEL (77).
//!
//! The camera stands in the middle of the panorama and looks along +x; a panorama that is turned before shows it another way.

use crate::Result;
use veni_image::tonemap::{quantile, srgb, srgb_to_linear};
use veni_image::{Picture, luminance};
use veni_light::sphere::{Equirect, View};

/// Width and height of the photograph, pixels.
pub(super) const SIZE: [usize; 2] = [96, 72];
/// Field of view across the width, degrees.
pub(super) const FIELD: f64 = 65.0;
/// The quantile of luminance that is white.
pub(super) const WHITE: f64 = 0.98;
/// Samples of the panorama along a side of a pixel.
const SAMPLES: usize = 2;
/// An eight-bit value from here on is taken for clipped, as in files.
const CLIPPED: u8 = 254;

/// Where the camera looks.
pub(super) fn view() -> View {
    View { fov: FIELD.to_radians(), azimuth: 0.0, elevation: 0.0, roll: 0.0 }
}

/// A camera before panoramas of one grid.
#[derive(Debug)]
pub(super) struct Camera {
    /// Of each sample the four pixels around it, and their weights.
    taps: Vec<[(usize, f32); 4]>,
}

/// A photograph: display values, and the luminance that is white.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Photograph {
    pub(super) values: Vec<[u8; 3]>,
    pub(super) white: f32,
}

impl Camera {
    pub(super) fn new(grid: Equirect) -> Self {
        let [width, height] = SIZE.map(|side| side * SAMPLES);
        let (directions, _) = view().pixels(width, height);
        Self { taps: directions.into_iter().map(|d| around(grid, d)).collect() }
    }

    /// The photograph of radiance.
    pub(super) fn take(&self, radiance: &[[f32; 3]]) -> Photograph {
        let sample = |taps: &[(usize, f32); 4]| {
            taps.iter().fold([0.0; 3], |sum, (p, w)| [0, 1, 2].map(|c| sum[c] + w * radiance[*p][c]))
        };
        let [width, height] = SIZE;
        let mut pixels = Vec::with_capacity(width * height);
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
            let mut sum = [0.0f32; 3];
            for (y, x) in (0..SAMPLES).flat_map(|y| (0..SAMPLES).map(move |x| (y, x))) {
                let at = (row * SAMPLES + y) * width * SAMPLES + column * SAMPLES + x;
                let value = sample(&self.taps[at]);
                sum = [0, 1, 2].map(|c| sum[c] + value[c]);
            }
            pixels.push(sum.map(|v| v / (SAMPLES * SAMPLES) as f32));
        }
        let luminances: Vec<f32> = pixels.iter().map(|p| luminance(*p)).collect();
        let white = quantile(&luminances, WHITE).max(f32::MIN_POSITIVE);
        let shown = |v: f32| (255.0 * srgb(v / white).clamp(0.0, 1.0) + 0.5) as u8;
        Photograph { values: pixels.into_iter().map(|p| p.map(shown)).collect(), white }
    }
}

impl Photograph {
    /// As its file would be read: linear, white at 1, what is white at least that bright.
    pub(super) fn picture(&self) -> Result<Picture> {
        let linear = |v: u8| srgb_to_linear(f32::from(v) / 255.0);
        let pixels = self.values.iter().map(|p| p.map(linear)).collect();
        Ok(Picture::new(SIZE, pixels)?.clipped_at(linear(CLIPPED)))
    }

    /// Mean squared difference of the display values, in [0, 1].
    pub(super) fn distance(&self, other: &Self) -> f64 {
        let (a, b) = (self.values.as_flattened(), other.values.as_flattened());
        let square = |(a, b): (&u8, &u8)| u64::from(a.abs_diff(*b)).pow(2);
        a.iter().zip(b).map(square).sum::<u64>() as f64 / (a.len() as f64 * 255.0 * 255.0)
    }
}

/// The pixels around a direction, for linear interpolation between their centres; columns wrap, at a pole the last row stays.
fn around(grid: Equirect, direction: [f32; 3]) -> [(usize, f32); 4] {
    let [x, y] = grid.pixel(direction).map(|v| v - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (u, v) = ((x - left) as f32, (y - top) as f32);
    let column = |k: i64| (left as i64 + k).rem_euclid(grid.width as i64) as usize;
    let row = |k: i64| (top as i64 + k).clamp(0, grid.height as i64 - 1) as usize;
    let at = |i: i64, j: i64| row(j) * grid.width + column(i);
    [
        (at(0, 0), (1.0 - u) * (1.0 - v)),
        (at(1, 0), u * (1.0 - v)),
        (at(0, 1), (1.0 - u) * v),
        (at(1, 1), u * v),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Equirect = Equirect { width: 128, height: 64 };

    fn taken(radiance: impl Fn([f32; 3]) -> [f32; 3]) -> Photograph {
        Camera::new(GRID).take(&GRID.directions().into_iter().map(radiance).collect::<Vec<_>>())
    }

    #[test]
    fn a_photograph_shows_what_is_before_the_camera() {
        // red on the left, +y; green on the right; blue above
        let scene = |[x, y, z]: [f32; 3]| {
            if x < 0.0 { [9.0; 3] } else { [0.5 + 0.4 * y, 0.5 - 0.4 * y, 0.5 + 0.4 * z] }
        };
        let photograph = taken(scene);
        let at = |column: usize, row: usize| photograph.values[row * SIZE[0] + column].map(i32::from);
        let ([left, right], [top, bottom]) = ([at(2, 36), at(93, 36)], [at(48, 1), at(48, 70)]);
        assert!(left[0] > left[1] + 60 && right[1] > right[0] + 60, "{left:?} {right:?}");
        assert!(top[2] > bottom[2] + 40, "{top:?} {bottom:?}");
        // 65° across: at the left edge y is sin 32.5° less half a pixel
        let linear = srgb_to_linear(at(0, 36)[1] as f32 / 255.0) * photograph.white;
        assert!((linear - (0.5 - 0.4 * 32.2f32.to_radians().sin())).abs() < 0.01, "{linear}");
    }

    #[test]
    fn white_is_the_quantile_and_what_is_beyond_is_clipped() {
        let bright =
            |[x, y, z]: [f32; 3]| if x > 0.995 { [100.0; 3] } else { [1.0 + y, 1.0 + y, 1.0 + 0.1 * z] };
        let photograph = taken(bright);
        let (count, picture) = (photograph.values.len(), photograph.picture().unwrap());
        let white = photograph.values.iter().filter(|p| luminance(p.map(f32::from)) > 253.0).count();
        assert!((0.015..0.04).contains(&(white as f64 / count as f64)), "{white} of {count}");
        let clip = picture.clip().unwrap();
        assert!((clip - 0.9911).abs() < 1e-3 && picture.size() == SIZE, "{clip}");
        // a light behind changes nothing; twice the light is twice the white and the same picture
        let behind = taken(|d| if d[0] < -0.9 { [1e4; 3] } else { bright(d) });
        assert_eq!(behind, photograph);
        let twice = taken(|d| bright(d).map(|v| 2.0 * v));
        assert_eq!((twice.white, &twice.values), (2.0 * photograph.white, &photograph.values));
    }

    #[test]
    fn distances_are_of_display_values() {
        let flat = |v: u8| Photograph { values: vec![[v; 3]; SIZE[0] * SIZE[1]], white: 1.0 };
        assert_eq!(flat(10).distance(&flat(10)), 0.0);
        assert!((flat(0).distance(&flat(51)) - 0.04).abs() < 1e-12);
    }
}
