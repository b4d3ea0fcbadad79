//! The first level: the panorama itself, as a cube.
//!
//! Radiance up to sixteen times the mean is looked up (bilinear between pixels, enough places per texel), which keeps a constant
//! map constant. What exceeds that, the sun and other small bright things, is handed to the texels pixel by pixel, so that its
//! energy arrives exactly however few pixels it has.

use std::f64::consts::PI;

use super::unfold::Dim;
use super::{CubeAxes, CubeMap};
use crate::light::EnvironmentMap;
use crate::light::reduce::Reduced;
use crate::sphere::CubeFace;

/// Radiance above this many times the mean is handed on by energy.
const BRIGHT: f64 = 16.0;

impl CubeMap {
    /// A panorama as a cube of `size` texels, seen along `axes`.
    ///
    /// # Panics
    /// If `size` is 0.
    pub fn of_map(map: EnvironmentMap<'_>, size: usize, axes: CubeAxes) -> Self {
        assert!(size > 0, "a cube map without texels");
        let ceiling = map.integral().map(|s| (BRIGHT * s / (4.0 * PI)) as f32);
        let reduced = Reduced::below(map, 4 * size, ceiling);
        let dim = reduced.map();
        let grid = dim.grid();
        // a texel in the middle of a face spans 2/size rad, a pixel 2π/W
        let samples = (grid.width as f64 / (PI * size as f64) * 1.5).ceil().clamp(1.0, 16.0) as usize;
        let mut cube = Self::unfolded(Dim { grid, pixels: dim.pixels(), ceiling }, size, axes, samples);
        cube.add_bright(map, ceiling, axes);
        cube.scale_to(map.integral());
        cube
    }

    /// Adds what each pixel has above the ceiling, spread evenly over the pixel.
    fn add_bright(&mut self, map: EnvironmentMap<'_>, ceiling: [f32; 3], axes: CubeAxes) {
        let (grid, size) = (map.grid(), self.size());
        // at least two places per texel and pixel, four at least
        let n = (4.0 * size as f64 / grid.width as f64 * PI).ceil().max(4.0) as usize;
        let mut energy: std::collections::BTreeMap<usize, [f64; 3]> = std::collections::BTreeMap::new();
        for (k, pixel) in map.pixels().iter().enumerate() {
            if pixel.iter().zip(ceiling).all(|(v, c)| *v <= c) {
                continue;
            }
            let above = [0, 1, 2].map(|c| f64::from((pixel[c] - ceiling[c]).max(0.0)));
            let (column, row) = (k % grid.width, k / grid.width);
            let [top, bottom] = [row, row + 1].map(|j| (PI * j as f64 / grid.height as f64).cos());
            let share = grid.solid_angle(row) / (n * n) as f64;
            for s in 0..n * n {
                let at = |k: usize| (k as f64 + 0.5) / n as f64;
                let z = top + (bottom - top) * at(s / n);
                let azimuth = PI - 2.0 * PI * (column as f64 + at(s % n)) / grid.width as f64;
                let r = (1.0 - z * z).max(0.0).sqrt();
                let direction = [r * azimuth.cos(), r * azimuth.sin(), z].map(|v| v as f32);
                let sum = energy.entry(Self::index(size, axes, direction)).or_default();
                *sum = [0, 1, 2].map(|c| sum[c] + share * above[c]);
            }
        }
        for (index, energy) in energy {
            let k = index % (size * size);
            let area = CubeFace::solid_angle(size, k % size, k / size);
            let texel = &mut self.texels_mut()[index];
            *texel = [0, 1, 2].map(|c| texel[c] + (energy[c] / area) as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::Equirect;

    /// Energy of skies with a sun of a pixel or a few, wherever it stands.
    #[test]
    fn a_small_sun_keeps_its_energy() {
        for (width, size) in [(512, 256), (1024, 256), (2048, 64), (128, 32)] {
            let grid = Equirect::new(width, width / 2);
            for sun in
                [[1., 0., 0.], [0.577, 0.577, 0.577], [-0.8, 0.01, 0.6], [0., 0., 1.], [0.7, -0.7, 0.1]]
            {
                let length = f32::hypot(f32::hypot(sun[0], sun[1]), sun[2]);
                let pixels: Vec<[f32; 3]> = (grid.directions().into_iter())
                    .map(|d| {
                        let t: f32 = d.iter().zip(sun).map(|(a, b)| a * b / length).sum();
                        let glare =
                            if t > (std::f32::consts::PI / width as f32 * 1.5).cos() { 5e4 } else { 0.0 };
                        [1.0 + d[2] + glare, 0.5 + 0.9 * glare, 1.5 + d[0] + 0.8 * glare]
                    })
                    .collect();
                let map = EnvironmentMap::new(grid, &pixels).unwrap();
                assert!(pixels.iter().any(|p| p[0] > 1e4));
                let cube = CubeMap::of_map(map, size, CubeAxes::BEVY);
                for (a, b) in map.integral().into_iter().zip(cube.integral()) {
                    assert!((a - b).abs() < 1e-5 * a, "{width} → {size}, {sun:?}: {a} became {b}");
                }
            }
        }
    }

    #[test]
    fn a_constant_map_is_a_constant_cube_and_a_dark_one_dark() {
        let grid = Equirect::new(100, 50);
        for value in [0.0, 3.0] {
            let pixels = vec![[value; 3]; grid.len()];
            let cube = CubeMap::of_map(EnvironmentMap::new(grid, &pixels).unwrap(), 17, CubeAxes::GLTF);
            assert!(cube.texels().iter().flatten().all(|v| (v - value).abs() <= 1e-6 * value));
        }
    }
}
