//! Radiance over the sphere: extremes, mean, median, and where the brightest light comes from.

use std::cmp::Ordering;

use veni_image::{Panorama, luminance};
use veni_light::vector::length;

/// Solid angle that is looked at for the sun, steradians: a cap of 3.2° radius. The disc itself (0.27°) is smaller
/// than a pixel of most panoramas, its glow is not.
const SUN_SOLID_ANGLE: f64 = 0.01;
/// Bins per octave of the luminance histogram: quantiles are good to 0.3 %.
const BINS_PER_OCTAVE: f32 = 256.0;
/// Octaves covered, 2⁻⁶⁴ to 2⁶⁴ times the panorama's unit.
const OCTAVES: f32 = 128.0;

/// Of a clean panorama; luminance (Rec. 709), weighted by solid angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Statistics {
    pub(super) min: f32,
    /// Of the pixels that are not black.
    darkest: f32,
    pub(super) max: f32,
    pub(super) mean: f64,
    pub(super) median: f32,
    pub(super) sun: Sun,
}

/// The centroid of the brightest part of the sphere, weighted by luminance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sun {
    /// Unit direction, z up.
    pub(super) direction: [f64; 3],
    /// Its part of all light, 0 to 1.
    pub(super) share: f64,
}

impl Sun {
    /// Degrees above the horizon.
    pub(super) fn elevation(self) -> f64 {
        self.direction[2].clamp(-1.0, 1.0).asin().to_degrees()
    }

    /// Degrees from +x (the image's centre) towards +y (its left).
    pub(super) fn azimuth(self) -> f64 {
        self.direction[1].atan2(self.direction[0]).to_degrees()
    }
}

impl Statistics {
    /// Stops between the darkest pixel that is not black and the brightest.
    pub(super) fn stops(self) -> f32 {
        (self.max / self.darkest).log2()
    }

    /// The panorama must be clean ([`Panorama::sanitise`]).
    pub(super) fn of(image: &Panorama) -> Self {
        let (grid, unit) = (image.grid(), image.unit());
        let rows =
            || image.pixels().chunks_exact(grid.width).enumerate().map(|(j, r)| (j, grid.solid_angle(j), r));
        let (mut min, mut darkest, mut max) = (f32::INFINITY, f32::INFINITY, 0f32);
        let (mut total, mut sphere) = (0.0, 0.0);
        let mut histogram = vec![0f64; (OCTAVES * BINS_PER_OCTAVE) as usize];
        for (_, weight, row) in rows() {
            for pixel in row {
                let y = luminance(*pixel);
                (min, max) = (min.min(y), max.max(y));
                if y > 0.0 {
                    darkest = darkest.min(y);
                }
                total += weight * f64::from(y);
                sphere += weight;
                histogram[bin(y / unit)] += weight;
            }
        }
        let median = (value(quantile_bin(&histogram, sphere / 2.0)) * unit).clamp(min, max);
        let brightest = quantile_bin(&histogram, (sphere - SUN_SOLID_ANGLE).max(0.0));
        // of the darkest bin that takes part only so much as fills the solid angle
        let above: f64 = histogram[brightest + 1..].iter().sum();
        let part = ((SUN_SOLID_ANGLE - above) / histogram[brightest]).clamp(0.0, 1.0);
        let (mut sum, mut light) = ([0f64; 3], 0.0);
        for (j, weight, row) in rows() {
            for (i, pixel) in row.iter().enumerate() {
                let y = luminance(*pixel);
                let part = match bin(y / unit).cmp(&brightest) {
                    Ordering::Less => continue,
                    Ordering::Equal => part,
                    Ordering::Greater => 1.0,
                };
                let power = part * weight * f64::from(y);
                light += power;
                let direction = grid.direction(i, j);
                sum.iter_mut().zip(direction).for_each(|(s, d)| *s += power * f64::from(d));
            }
        }
        let length = length(sum).max(f64::MIN_POSITIVE);
        let sun = Sun { direction: sum.map(|s| s / length), share: light / total };
        Self { min, darkest, max, mean: total / sphere, median, sun }
    }
}

fn bin(y: f32) -> usize {
    let at = (y.log2() + OCTAVES / 2.0) * BINS_PER_OCTAVE;
    // a float to integer cast saturates, which is what values beyond the ends need
    (at as usize).min((OCTAVES * BINS_PER_OCTAVE) as usize - 1)
}

/// The middle of a bin.
fn value(bin: usize) -> f32 {
    ((bin as f32 + 0.5) / BINS_PER_OCTAVE - OCTAVES / 2.0).exp2()
}

/// The bin in which the weight counted from the darkest reaches `weight`.
fn quantile_bin(histogram: &[f64], weight: f64) -> usize {
    let mut sum = 0.0;
    let found = histogram.iter().position(|w| {
        sum += w;
        *w > 0.0 && sum > weight
    });
    // rounding may leave the sum a little short: then it is the brightest
    found.or_else(|| histogram.iter().rposition(|w| *w > 0.0)).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::sphere::Equirect;

    #[test]
    fn a_lamp_is_found_where_it_is() {
        let grid = Equirect::new(256, 128);
        for (azimuth, elevation) in [(0.0f64, 45.0f64), (120.0, 10.0), (-170.0, 60.0), (30.0, -20.0)] {
            let (a, e) = (azimuth.to_radians(), elevation.to_radians());
            let lamp = [e.cos() * a.cos(), e.cos() * a.sin(), e.sin()].map(|v| v as f32);
            let image = Panorama::from_fn(grid, |d| {
                let cosine: f32 = d.iter().zip(lamp).map(|(a, b)| a * b).sum();
                if cosine > 0.9985 { [900.0; 3] } else { [0.5; 3] }
            });
            let s = Statistics::of(&image);
            assert!((s.sun.azimuth() - azimuth).abs() < 0.5, "{azimuth}: {}", s.sun.azimuth());
            assert!((s.sun.elevation() - elevation).abs() < 0.5, "{elevation}: {}", s.sun.elevation());
            assert!((s.max - 900.0).abs() < 0.1 && (s.min - 0.5).abs() < 1e-4);
            assert!((s.median - 0.5).abs() < 2e-3, "{}", s.median);
            assert!((s.stops() - 1800f32.log2()).abs() < 0.01);
            // a cap of 3.14° has 0.00944 sr
            let expected = 0.5 + 899.5 * 0.00943 / (4.0 * std::f64::consts::PI);
            assert!((s.mean - expected).abs() < 0.1 * expected, "{} against {expected}", s.mean);
            assert!((0.5..0.65).contains(&s.sun.share), "{}", s.sun.share);
        }
    }

    #[test]
    fn the_median_is_weighted_by_solid_angle() {
        // a polar cap of 45° covers a quarter of the rows, but only 15 % of the sphere
        let image = Panorama::from_fn(
            Equirect::new(64, 32),
            |[_, _, z]| if z.abs() > 0.7 { [9.0; 3] } else { [1.0; 3] },
        );
        let s = Statistics::of(&image);
        assert!((s.median - 1.0).abs() < 3e-3);
        assert!((s.mean - (0.7 + 0.3 * 9.0)).abs() < 0.2, "{}", s.mean);
    }
}
