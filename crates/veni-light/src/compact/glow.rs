//! A wide light as a smooth lobe: the von Mises–Fisher density with the first moment of a disc. MODEL (72).

use std::ops::Range;

use super::{CompactLight, Kind};
use crate::sphere::Equirect;

/// Beyond this many standard deviations there is nothing: e^{−18}.
const REACH: f64 = 6.0;
/// A pixel is sampled at least this often per standard deviation and axis: at a pole, where the rule of the middle errs most, by 1/24
/// of the square of the step.
const PER_DEVIATION: f64 = 8.0;

/// The fixed point of κ is found to rounding after these up to a radius of 90°, and at once for narrow lobes.
const ITERATIONS: usize = 60;
/// A pixel of a larger angle, radians, is sampled more than once whatever it shows: its middle is not its mean.
const LARGE: f64 = 0.03;

/// L(d) = E κ/(2π(1 − e^{−2κ})) e^{κ(⟨d,u⟩ − 1)}, with the κ at which its mean cosine, coth κ − 1/κ, is that of a disc of radius r,
/// cos²(r/2): it lights every surface that sees it whole as the disc does.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glow {
    direction: [f64; 3],
    kappa: f64,
    /// Density in the middle, 1/sr.
    peak: f64,
    irradiance: [f32; 3],
}

impl Glow {
    /// None for a light that is a disc.
    pub(crate) fn new(light: &CompactLight) -> Option<Self> {
        if light.kind() == Kind::Disc {
            return None;
        }
        let kappa = concentration(f64::from(light.radius));
        let peak = kappa / (-2.0 * std::f64::consts::PI * (-2.0 * kappa).exp_m1());
        Some(Self { direction: light.direction.map(f64::from), kappa, peak, irradiance: light.irradiance })
    }

    /// Density in a direction, 1/sr; exact where it does not matter to rounding whether the vector is of length 1.
    #[inline]
    fn density(&self, direction: [f64; 3]) -> f64 {
        let square: f64 = direction.iter().zip(self.direction).map(|(a, b)| (a - b) * (a - b)).sum();
        self.peak * (-0.5 * self.kappa * square).exp()
    }

    /// Adds it to the radiance of a unit direction.
    #[inline]
    pub(crate) fn add(&self, direction: [f32; 3], radiance: &mut [f32; 3]) {
        self.add_density(self.density(direction.map(f64::from)), radiance);
    }

    #[inline]
    pub(super) fn add_density(&self, density: f64, radiance: &mut [f32; 3]) {
        for (sum, e) in radiance.iter_mut().zip(self.irradiance) {
            *sum += (density * f64::from(e)) as f32;
        }
    }

    /// Radiance in the middle, of the brightest channel.
    pub(super) fn most(&self) -> f32 {
        self.middle().into_iter().fold(0.0, f32::max)
    }

    /// Radiance in the middle.
    pub(super) fn middle(&self) -> [f32; 3] {
        self.irradiance.map(|e| (self.peak * f64::from(e)) as f32)
    }

    /// κ.
    pub(crate) fn concentration(&self) -> f64 {
        self.kappa
    }

    /// The standard deviation along each of two axes, radians.
    fn deviation(&self) -> f64 {
        1.0 / self.kappa.sqrt()
    }

    /// The number of places along each side of a pixel of this angle that give its mean.
    pub(super) fn places(&self, pixel: f64) -> usize {
        (PER_DEVIATION * pixel / self.deviation()).max(pixel / LARGE).ceil().max(1.0) as usize
    }

    /// The largest κ of which one place gives the mean over a pixel of this angle.
    pub(super) fn sharpest(pixel: f64) -> f64 {
        if pixel > LARGE { 0.0 } else { (PER_DEVIATION * pixel).powi(-2) }
    }

    /// The rows of `rows` that it may reach: the angle to a row is the least to its directions.
    pub(super) fn rows(&self, grid: Equirect, rows: Range<usize>) -> Range<usize> {
        let near = self.near(grid);
        let first = rows.clone().find(|row| near(*row)).unwrap_or(rows.start);
        let end = rows.rev().find(|row| near(*row)).map_or(first, |last| last + 1);
        first..end
    }

    fn near(&self, grid: Equirect) -> impl Fn(usize) -> bool {
        let height = std::f64::consts::PI / grid.height as f64;
        let polar = self.direction[2].clamp(-1.0, 1.0).acos();
        let reach = REACH * self.deviation() + height;
        move |row| (grid.polar(row) - polar).abs() <= reach
    }

    /// Whether a direction is so far away that there is nothing.
    #[inline]
    pub(super) fn beyond(&self, direction: [f64; 3], margin: f64) -> bool {
        let square: f64 = direction.iter().zip(self.direction).map(|(a, b)| (a - b) * (a - b)).sum();
        square.sqrt() > self.reach(margin)
    }

    /// Chords beyond which there is nothing.
    pub(super) fn reach(&self, margin: f64) -> f64 {
        REACH * self.deviation() + margin
    }

    /// The mean over places (direction, weight).
    pub(super) fn mean(&self, places: impl Iterator<Item = ([f64; 3], f64)>) -> f64 {
        let (sum, weight) =
            places.fold((0.0, 0.0), |(sum, weight), (d, w)| (sum + w * self.density(d), weight + w));
        sum / weight
    }

    /// Adds its mean over each pixel to `rows` of a panorama, which `pixels` are.
    pub(super) fn add_to_rows(&self, grid: Equirect, rows: Range<usize>, pixels: &mut [[f32; 3]]) {
        let height = std::f64::consts::PI / grid.height as f64;
        let n = self.places(height);
        let near = self.near(grid);
        if !rows.clone().any(&near) {
            return;
        }
        let azimuth = |fraction: f64| std::f64::consts::PI * (1.0 - 2.0 * fraction / grid.width as f64);
        let columns: Vec<(f64, f64)> =
            (0..grid.width * n).map(|k| azimuth((k as f64 + 0.5) / n as f64).sin_cos()).collect();
        for (row, pixels) in rows.zip(pixels.chunks_exact_mut(grid.width)) {
            if !near(row) {
                continue;
            }
            let places: Vec<(f64, f64)> =
                (0..n).map(|k| (height * (row as f64 + (k as f64 + 0.5) / n as f64)).sin_cos()).collect();
            for (columns, pixel) in columns.chunks_exact(n).zip(pixels) {
                let at = |(st, ct): &(f64, f64), (s, c): &(f64, f64)| [st * c, st * s, *ct];
                if self.beyond(at(&places[n / 2], &columns[n / 2]), 2.0 * height) {
                    continue;
                }
                let all = places.iter().flat_map(|p| columns.iter().map(move |c| (at(p, c), p.0)));
                self.add_density(self.mean(all), pixel);
            }
        }
    }
}

/// κ of a disc's radius: 1/κ = sin²(r/2) + coth κ − 1.
fn concentration(radius: f64) -> f64 {
    let square = (0.5 * radius).sin().powi(2);
    (0..ITERATIONS).fold(1.0 / square, |kappa, _| 1.0 / (square + 2.0 / (2.0 * kappa).exp_m1()))
}

#[cfg(test)]
impl Glow {
    /// About +z, of energy 1.
    pub(super) fn of_concentration(kappa: f64) -> Self {
        Self {
            direction: [0.0, 0.0, 1.0],
            kappa,
            peak: kappa / (2.0 * std::f64::consts::PI),
            irradiance: [1.0; 3],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::EnvironmentMap;

    fn light(direction: [f32; 3], degrees: f32) -> CompactLight {
        CompactLight::new(direction, [3.0, 2.0, 1.0], degrees.to_radians())
    }

    #[test]
    fn energy_and_moments_are_the_discs() {
        assert!(Glow::new(&light([0.0, 0.0, 1.0], 1.0)).is_none());
        for direction in [[0.6, 0.0, 0.8], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.02, -0.9998]] {
            for degrees in [1.6, 4.0, 18.0, 60.0] {
                for width in [32, 256, 1000] {
                    let grid = Equirect::new(width, width / 2);
                    let mut pixels = vec![[0.0; 3]; grid.len()];
                    let glow = Glow::new(&light(direction, degrees)).unwrap();
                    glow.add_to_rows(grid, 0..grid.height, &mut pixels);
                    let sum = EnvironmentMap::new(grid, &pixels).unwrap().integral();
                    assert!((sum[0] / 3.0 - 1.0).abs() < 1e-3, "{direction:?} {degrees}° {width}: {sum:?}");
                    if width < 1000 {
                        continue;
                    }
                    let spread: f64 = (0..grid.len())
                        .map(|k| {
                            let d = grid.direction(k % width, k / width);
                            let square: f32 = d.iter().zip(direction).map(|(a, b)| (a - b) * (a - b)).sum();
                            f64::from(pixels[k][0] * square) * grid.solid_angle(k / width) / 3.0
                        })
                        .sum();
                    // 2(1 − ⟨cos⟩) of a disc is 1 − cos r
                    let disc = 1.0 - f64::from(degrees).to_radians().cos();
                    assert!((spread / disc - 1.0).abs() < 0.02, "{degrees}°: {spread} {disc}");
                }
            }
        }
    }
}
