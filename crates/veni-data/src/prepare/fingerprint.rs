//! What a panorama looks like, whichever way it is rotated: for finding near-duplicates.
//!
//! The luminance of a small image, in logarithms, cut at its 5 % and 90 % quantiles (so that a clipped copy agrees with
//! the original) and of mean 0 (so that exposure does not count), is kept as the Fourier coefficients of its rows over
//! azimuth. A rotation by α multiplies coefficient m by e^{imα}, the mirror image conjugates it: two fingerprints give the
//! correlation of two panoramas for all rotations, and the product of magnitudes bounds all of them from above.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use veni_image::tonemap::quantile;
use veni_image::{Panorama, luminance};
use veni_light::sphere::Equirect;

/// The image that is looked at.
const GRID: Equirect = Equirect { width: 256, height: 12 };
/// Orders over azimuth, besides the mean of a row.
const ORDERS: usize = 12;
/// Rotations that are tried.
const ROTATIONS: usize = 192;
/// Steps of the stored coefficients, of which the squares sum to 1.
const UNIT: f32 = 16384.0;
/// Below this part of the variation lying along azimuth, a panorama looks the same from all sides.
const UNIFORM: f32 = 0.02;

/// Fourier coefficients of rows: mean, then cosine and sine of each order, rounded to 1/16384.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Fingerprint(Vec<i16>);

/// How alike two panoramas are, rotated and mirrored to fit best.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Likeness {
    /// Correlation of log luminance over the sphere, −1 to 1.
    pub whole: f32,
    /// Correlation of what varies along azimuth alone: two clear days share their gradient from top to bottom, but
    /// not this.
    pub around: f32,
    /// The rotation about the up axis, counter-clockwise from above, that takes the first to the second (or to the mirror
    /// image of the second), radians in [−π, π).
    pub rotation: f32,
    /// Whether it is the mirror image.
    pub mirrored: bool,
}

impl Likeness {
    /// The least [`Likeness::around`] of a near-duplicate.
    pub const AROUND: f32 = 0.93;
    /// The least [`Likeness::whole`] of a near-duplicate.
    pub const WHOLE: f32 = 0.95;
}

impl Fingerprint {
    /// The fingerprint of a clean panorama.
    pub fn new(panorama: &Panorama) -> Self {
        let small = panorama.resample(GRID);
        let floor = small.log_floor();
        let mut logs: Vec<f32> = small.pixels().iter().map(|p| (luminance(*p) + floor).ln()).collect();
        let (low, high) = (quantile(&logs, 0.05), quantile(&logs, 0.9));
        logs.iter_mut().for_each(|v| *v = v.clamp(low, high));
        let weights: Vec<f64> = (0..GRID.height).map(|j| GRID.solid_angle(j)).collect();
        let mean = logs.chunks_exact(GRID.width).zip(&weights).map(|(row, w)| w * sum(row)).sum::<f64>()
            / (4.0 * PI);
        let phases: Vec<(f64, f64)> =
            (0..GRID.width).map(|i| (2.0 * PI * i as f64 / GRID.width as f64).sin_cos()).collect();
        let mut coefficients = Vec::with_capacity(GRID.height * (2 * ORDERS + 1));
        for (row, weight) in logs.chunks_exact(GRID.width).zip(&weights) {
            let root = weight.sqrt();
            coefficients.push(root * (sum(row) / GRID.width as f64 - mean));
            for order in 1..=ORDERS {
                let (mut cosine, mut sine) = (0.0, 0.0);
                for (i, v) in row.iter().enumerate() {
                    let (s, c) = phases[i * order % GRID.width];
                    cosine += c * f64::from(*v);
                    sine += s * f64::from(*v);
                }
                // √2: the squares of all coefficients sum to the variance
                let scale = root * std::f64::consts::SQRT_2 / GRID.width as f64;
                coefficients.extend([scale * cosine, scale * sine]);
            }
        }
        let norm = coefficients.iter().map(|c| c * c).sum::<f64>().sqrt();
        // what varies by less than a thousandth is uniform: there is nothing to compare
        let scale = if norm > 1e-3 { f64::from(UNIT) / norm } else { 0.0 };
        Self(coefficients.iter().map(|c| (c * scale).round() as i16).collect())
    }

    /// Ready for comparing with many others.
    pub(super) fn unpack(&self) -> Unpacked {
        let mut unpacked = Unpacked::default();
        for row in self.0.chunks_exact(2 * ORDERS + 1) {
            unpacked.zonal.push(f32::from(row[0]) / UNIT);
            for pair in row[1..].chunks_exact(2) {
                let [cosine, sine] = [f32::from(pair[0]) / UNIT, f32::from(pair[1]) / UNIT];
                unpacked.waves.push([cosine, sine]);
                unpacked.magnitudes.push(cosine.hypot(sine));
            }
        }
        let square = |values: &[f32]| values.iter().map(|v| v * v).sum::<f32>();
        unpacked.around = square(&unpacked.magnitudes);
        unpacked.whole = square(&unpacked.zonal) + unpacked.around;
        unpacked
    }

    /// How alike two panoramas are.
    pub fn likeness(&self, other: &Self) -> Likeness {
        self.unpack().likeness(&other.unpack())
    }
}

/// A fingerprint in numbers to reckon with.
#[derive(Clone, Debug, Default)]
pub(super) struct Unpacked {
    zonal: Vec<f32>,
    waves: Vec<[f32; 2]>,
    magnitudes: Vec<f32>,
    /// Squared norms, of everything and of the waves.
    whole: f32,
    around: f32,
}

impl Unpacked {
    /// The likeness if it makes the two near-duplicates; most pairs are told apart by the bound.
    pub(super) fn near_duplicate(&self, other: &Self) -> Option<Likeness> {
        if self.is_uniform() || other.is_uniform() {
            let likeness = self.likeness(other);
            return Some(likeness).filter(|l| self.is_uniform() && other.is_uniform() && l.whole >= 0.999);
        }
        if self.bound(other) < Likeness::AROUND {
            return None;
        }
        let likeness = self.likeness(other);
        (likeness.around >= Likeness::AROUND && likeness.whole >= Likeness::WHOLE).then_some(likeness)
    }

    /// What [`Likeness::around`] cannot exceed, whatever the rotation.
    pub(super) fn bound(&self, other: &Self) -> f32 {
        let product: f32 = self.magnitudes.iter().zip(&other.magnitudes).map(|(a, b)| a * b).sum();
        product / (self.around * other.around).sqrt().max(f32::MIN_POSITIVE)
    }

    fn is_uniform(&self) -> bool {
        self.around <= UNIFORM * self.whole
    }

    pub(super) fn likeness(&self, other: &Self) -> Likeness {
        let zonal: f32 = self.zonal.iter().zip(&other.zonal).map(|(a, b)| a * b).sum();
        let mut best = (f32::NEG_INFINITY, 0.0, false);
        for mirrored in [false, true] {
            let cross = self.cross(other, mirrored);
            for k in 0..ROTATIONS {
                let rotation = std::f32::consts::TAU * k as f32 / ROTATIONS as f32;
                let correlation = (cross.iter().enumerate())
                    .map(|(m, [re, im])| {
                        let (sin, cos) = ((m + 1) as f32 * rotation).sin_cos();
                        re * cos - im * sin
                    })
                    .sum();
                if correlation > best.0 {
                    best = (correlation, rotation, mirrored);
                }
            }
        }
        let (around, rotation, mirrored) = best;
        let ratio = |value: f32, a: f32, b: f32| if a * b > 0.0 { value / (a * b).sqrt() } else { 0.0 };
        Likeness {
            whole: ratio(zonal + around, self.whole, other.whole),
            around: ratio(around, self.around, other.around),
            // columns run against the azimuth
            rotation: if rotation <= std::f32::consts::PI {
                -rotation
            } else {
                std::f32::consts::TAU - rotation
            },
            mirrored,
        }
    }

    /// Σ over rows of conj(a)·b per order, for b as it is or mirrored; a wave is c − is of the pair (c, s).
    fn cross(&self, other: &Self, mirrored: bool) -> [[f32; 2]; ORDERS] {
        let mut cross = [[0.0; 2]; ORDERS];
        for (k, ([ac, a_s], [bc, bs])) in self.waves.iter().zip(&other.waves).enumerate() {
            let bs = if mirrored { -bs } else { *bs };
            let to = &mut cross[k % ORDERS];
            // (ac + i as)(bc − i bs)
            to[0] += ac * bc + a_s * bs;
            to[1] += a_s * bc - ac * bs;
        }
        cross
    }
}

fn sum(row: &[f32]) -> f64 {
    row.iter().map(|v| f64::from(*v)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of [mean, cosine and sine of orders 1 to 12], as they are stored.
    fn rows(panorama: &Panorama) -> Vec<Vec<f64>> {
        let values = Fingerprint::new(panorama).0;
        values.chunks(2 * ORDERS + 1).map(|row| row.iter().map(|v| f64::from(*v)).collect()).collect()
    }

    /// Three bright sides are waves of order 3 and its multiples alone, and a rotation is a phase.
    #[test]
    fn a_wave_is_seen_at_its_order_and_rotates_by_its_phase() {
        let wave = |rotation: f32| {
            let log = |[x, y, _]: [f32; 3]| 0.8 * (3.0 * (y.atan2(x) - rotation)).cos();
            Panorama::from_fn(Equirect::new(256, 128), |d| [log(d).exp(); 3])
        };
        let still = rows(&wave(0.0));
        assert_eq!(still.len(), GRID.height);
        let squares = |orders: &dyn Fn(usize) -> bool| -> f64 {
            let of_row = |row: &Vec<f64>| -> f64 {
                row.iter().enumerate().filter(|(k, _)| orders(k.div_ceil(2))).map(|(_, v)| v * v).sum()
            };
            still.iter().map(of_row).sum()
        };
        let total = squares(&|_| true);
        assert!((total.sqrt() / f64::from(UNIT) - 1.0).abs() < 1e-3, "{}", total.sqrt());
        assert!(squares(&|order| order == 3) > 0.9 * total);
        assert!(squares(&|order| order % 3 != 0) < 1e-6 * total);
        let phase = |rows: &[Vec<f64>]| {
            let (cosine, sine) = rows.iter().fold((0.0, 0.0), |(c, s), row| (c + row[5], s + row[6]));
            sine.atan2(cosine)
        };
        for rotation in [0.1f32, -0.3, 0.9] {
            // columns run against the azimuth
            let off = phase(&rows(&wave(rotation))) - phase(&still) + 3.0 * f64::from(rotation);
            let off = (off + PI).rem_euclid(2.0 * PI) - PI;
            assert!(off.abs() < 0.02, "{rotation}: off by {off}");
        }
    }

    /// Prepared folders keep fingerprints: later versions must compute the same.
    #[test]
    fn a_fingerprint_is_what_it_was() {
        let sky = Panorama::from_fn(Equirect::new(256, 128), |[x, y, z]| {
            [1.5 + x, 2.0 + 0.5 * y * z, 1.0 + z.max(0.0)]
        });
        let rows = rows(&sky);
        let found: Vec<Vec<i32>> =
            [0, 5, 11].iter().map(|at: &usize| rows[*at][..5].iter().map(|v| *v as i32).collect()).collect();
        let expected = [[854, -354, 600, 3, 6], [-289, -5845, 1343, -187, 90], [-151, -383, -614, 3, -6]];
        let close = found.iter().flatten().zip(expected.iter().flatten()).all(|(a, b)| (a - b).abs() <= 1);
        assert!(close, "{found:?}");
    }
}
