//! Directions drawn by how much light comes from them.

mod alias;
mod split;

#[cfg(test)]
mod tests;

pub use split::SplitSampler;

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use super::EnvironmentMap;
use super::angle::pixel;
use super::reduce::Reduced;
use crate::luminance::luminance;
use crate::sphere::Equirect;
use alias::Alias;

/// Maps of more pixels than this are averaged: a random f32 has 24 bits.
const LARGEST: usize = 1 << 23;

/// Draws directions of a map, each pixel by its luminance times its solid angle, evenly within the pixel. One lookup per sample
/// whatever the size of the map.
///
/// ```
/// use veni_light::light::{EnvironmentMap, Sampler};
/// use veni_light::sphere::Equirect;
///
/// let grid = Equirect::new(64, 32);
/// let pixels: Vec<[f32; 3]> = grid.directions().into_iter().map(|[_, _, z]| [1.0 + z; 3]).collect();
/// let sampler = Sampler::new(EnvironmentMap::new(grid, &pixels)?);
/// let sample = sampler.sample([0.3, 0.7]);
/// assert!((sampler.pdf(sample.direction) - sample.pdf).abs() < 1e-4 * sample.pdf);
/// # Ok::<(), veni_light::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Sampler<'a> {
    map: Reduced<'a>,
    alias: Alias,
    /// cos θ of the edges of all rows.
    heights: Arc<Vec<f32>>,
    /// Of every pixel: a third of the memory that the pixels are spread over, which is what a lookup costs.
    densities: Arc<Vec<f32>>,
    /// sin² of half the polar angle of the first row's lower edge.
    cap: f32,
    density: Density,
    /// Sine and cosine of the rotation.
    rotation: [f32; 2],
}

/// The density of a pixel, scale · (luminance − floor)₊ + even.
#[derive(Clone, Copy, Debug)]
struct Density {
    scale: f32,
    floor: f32,
    even: f32,
}

impl Density {
    #[inline]
    fn of(self, radiance: [f32; 3]) -> f32 {
        self.scale * (luminance(radiance) - self.floor).max(0.0) + self.even
    }
}

/// A direction and what is known of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Unit, native.
    pub direction: [f32; 3],
    /// Radiance from there.
    pub radiance: [f32; 3],
    /// Density over solid angle, 1/sr.
    pub pdf: f32,
}

impl<'a> Sampler<'a> {
    /// By luminance. A black map is sampled evenly.
    pub fn new(map: EnvironmentMap<'a>) -> Self {
        let grid = map.grid();
        let width = (0..).map(|k| grid.width >> k).find(|w| w * w * grid.height / grid.width <= LARGEST);
        Self::above(Reduced::to_width(map, width.unwrap_or(1)), 0.0, [0.0, 1.0])
    }

    /// By luminance above the map's mean, for use with a surface's own density by the balance heuristic, which then need not
    /// share what is even anyway (Karlík et al. 2019).
    #[must_use]
    pub fn compensated(&self) -> Self {
        let map = self.map.map();
        let mean = map.integral().map(|s| (s / (4.0 * std::f64::consts::PI)) as f32);
        Self::above(self.map.clone(), luminance(mean), self.rotation)
    }

    fn above(map: Reduced<'a>, floor: f32, rotation: [f32; 2]) -> Self {
        let view = map.map();
        let grid = view.grid();
        let above = |pixel: &[f32; 3]| (luminance(*pixel) - floor).max(0.0);
        let mut weights = Vec::with_capacity(grid.len());
        for (row, pixels) in view.pixels().chunks_exact(grid.width).enumerate() {
            let solid_angle = grid.solid_angle(row);
            weights.extend(pixels.iter().map(|pixel| solid_angle * f64::from(above(pixel))));
        }
        let total: f64 = weights.iter().sum();
        let (scale, even) = if total > 0.0 { ((1.0 / total) as f32, 0.0) } else { (0.0, 0.25 / PI) };
        if total <= 0.0 {
            weights.clear();
            weights.extend((0..grid.len()).map(|k| grid.solid_angle(k / grid.width)));
        }
        let heights =
            (0..=grid.height).map(|j| (std::f64::consts::PI * j as f64 / grid.height as f64).cos() as f32);
        let cap = (0.5 * std::f64::consts::PI / grid.height as f64).sin().powi(2) as f32;
        let alias = Alias::new(&weights);
        drop(weights);
        let density = Density { scale, floor, even };
        let densities = Arc::new(view.pixels().iter().map(|pixel| density.of(*pixel)).collect());
        Self { alias, heights: Arc::new(heights.collect()), densities, density, cap, rotation, map }
    }

    /// The same of the map rotated by `angle` radians about z, counter-clockwise seen from above. Nothing is computed
    /// again, and all is shared.
    #[must_use]
    pub fn rotated(&self, angle: f32) -> Self {
        let ([s, c], (sin, cos)) = (self.rotation, angle.sin_cos());
        Self { rotation: [s * cos + c * sin, c * cos - s * sin], ..self.clone() }
    }

    /// The pixel that two numbers of [0, 1) choose, and the place in it, each coordinate in (0, 1).
    #[inline]
    pub fn pixel(&self, [u, v]: [f32; 2]) -> (usize, [f32; 2]) {
        let (pixel, rest) = self.alias.choose(u, v);
        // twelve bits for each coordinate; half a step keeps clear of the edges
        let coarse = rest * 4096.0;
        let x = (coarse.floor() + 0.5) / 4096.0;
        let y = ((coarse - coarse.floor()) * 4096.0).floor();
        (pixel, [x, (y.min(4095.0) + 0.5) / 4096.0])
    }

    /// A direction from two numbers of [0, 1).
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> Sample {
        let view = self.map.map();
        let grid = view.grid();
        let (pixel, [x, y]) = self.pixel(u);
        let (row, column) = (pixel / grid.width, pixel % grid.width);
        // even in cos θ; beside a pole by sin² of half the angle, since f32 does not hold 1 − cos θ
        let (sin, cos) = if row == 0 || row + 1 == grid.height {
            let half = y * self.cap;
            let cos = 1.0 - 2.0 * half;
            (2.0 * (half * (1.0 - half)).sqrt(), if row == 0 { cos } else { -cos })
        } else {
            let z = self.heights[row] + (self.heights[row + 1] - self.heights[row]) * y;
            ((1.0 - z * z).max(0.0).sqrt(), z)
        };
        let (s, c) = (PI - TAU * (column as f32 + x) / grid.width as f32).sin_cos();
        let [ts, tc] = self.rotation;
        let direction = [sin * (c * tc - s * ts), sin * (s * tc + c * ts), cos];
        let radiance = view.pixels()[pixel];
        Sample { direction, radiance, pdf: self.density(radiance) }
    }

    /// The density with which a unit direction is drawn, 1/sr.
    #[inline]
    pub fn pdf(&self, direction: [f32; 3]) -> f32 {
        self.densities[self.nearest(direction)]
    }

    /// The radiance from a unit direction, that of its pixel.
    #[inline]
    pub fn radiance(&self, direction: [f32; 3]) -> [f32; 3] {
        self.map.map().pixels()[self.nearest(direction)]
    }

    /// The pixel that a unit direction lies in.
    #[inline]
    fn nearest(&self, [x, y, z]: [f32; 3]) -> usize {
        let grid = self.map.map().grid();
        let [s, c] = self.rotation;
        let [column, row] = pixel(grid, [x * c + y * s, y * c - x * s, z]);
        (row as usize).min(grid.height - 1) * grid.width + (column as usize).min(grid.width - 1)
    }

    /// The density with which a pixel of this radiance is drawn, 1/sr: scale · (luminance − floor)₊ + even.
    #[inline]
    pub fn density(&self, radiance: [f32; 3]) -> f32 {
        self.density.of(radiance)
    }

    /// The map whose pixels are drawn, before any rotation: means where it had more than 2²³.
    pub fn map(&self) -> EnvironmentMap<'_> {
        self.map.map()
    }

    /// The grid whose pixels are drawn.
    pub fn grid(&self) -> Equirect {
        self.map.map().grid()
    }

    /// The alias table, for a shader: for each of a power of two of cells the probability that it is its own pixel, and the pixel
    /// it is otherwise.
    pub fn table(&self) -> impl Iterator<Item = (f32, u32)> + '_ {
        self.alias.cells().iter().map(|cell| (cell.keep, cell.other))
    }
}
