//! Augmentation: new plausible skies from few.
//!
//! Every operation works on an equirectangular image of H × W × 3 values, row-major, channels last, natural
//! logarithm of radiance unless it says otherwise. All draws come from the stream that the caller names, so an
//! augmented batch is a pure function of (seed, step, slot). An operation whose strength is 0 is skipped, and
//! with everything off the image comes back bit for bit.
//!
//! Turning: encoder and decoder commute with turns about z, so turning a single panorama teaches nothing but
//! what the encoder's sampling grid hides inside one stripe; that is covered by the sampling yaw. Turns matter
//! where two panoramas meet (mixing, recombination, joining), and there whole columns are enough and lose nothing.

use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::data::exposure::centre_exposure;
use crate::data::random::{below, normal, signed, uniform};
use crate::sphere::Equirect;

/// Strengths and probabilities. The default is off: the identity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AugmentConfig {
    /// Probability of turning the image by a random number of columns.
    pub turn: f64,
    /// Probability of a mirror image (left and right exchanged).
    pub mirror: f64,
    /// Standard deviation of a common factor on radiance, in stops.
    pub exposure: f64,
    /// Standard deviation of each channel's own factor, in natural-log units.
    pub white_balance: f64,
    /// Standard deviation of ln γ, where log radiance is multiplied by γ.
    pub contrast: f64,
    /// Largest amplitude, in (0, 1), of the monotone warp θ → θ + a·sin(2θ)/2 that fixes poles and horizon.
    pub polar_warp: f64,
    /// Probability of taking the lower hemisphere from a second panorama.
    pub recombine: f64,
    /// Half width of the blend at the horizon when recombining, degrees.
    pub recombine_blend: f64,
    /// Largest amplitude, in [0, 1), of the monotone warp φ → φ + a·sin(φ − φ₀): one side of the scene is
    /// drawn together and the opposite one spread.
    pub azimuth_warp: f64,
    /// Probability of taking one side of the scene from a second panorama.
    pub join: f64,
    /// Width of the blend between the two sides when joining, as a share of the distance from side to side, in
    /// [0, 1].
    pub join_blend: f64,
    /// Probability of adding a second panorama's light: a convex combination in linear radiance.
    pub mix: f64,
    /// Largest share of the second panorama in a mix, in [0, 1].
    pub mix_share: f64,
}

impl AugmentConfig {
    /// Checks every number.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] naming the first value outside its range.
    pub fn check(&self) -> crate::Result<()> {
        let fields = [
            ("turn", self.turn, 1.0),
            ("mirror", self.mirror, 1.0),
            ("exposure", self.exposure, 20.0),
            ("white_balance", self.white_balance, 5.0),
            ("contrast", self.contrast, 2.0),
            ("polar_warp", self.polar_warp, 0.99),
            ("recombine", self.recombine, 1.0),
            ("recombine_blend", self.recombine_blend, 90.0),
            ("azimuth_warp", self.azimuth_warp, 0.99),
            ("join", self.join, 1.0),
            ("join_blend", self.join_blend, 1.0),
            ("mix", self.mix, 1.0),
            ("mix_share", self.mix_share, 1.0),
        ];
        for (name, value, most) in fields {
            if !(0.0..=most).contains(&value) {
                return Err(crate::Error::invalid(format!(
                    "augment.{name} = {value}: must lie in 0..={most}"
                )));
            }
        }
        Ok(())
    }

    /// Augments `image` (log radiance at exposure 0, length 3·W·H). `other` fetches a second panorama of the
    /// same size, drawn with the given stream, when mixing, recombining or joining needs one. The result is brought
    /// back to exposure 0 before the exposure jitter, whenever anything but a turn or mirror touched it.
    pub fn apply<'a, R: Rng>(
        &self,
        grid: Equirect,
        image: &[f32],
        rng: &mut R,
        mut other: impl FnMut(&mut R) -> &'a [f32],
    ) -> Vec<f32> {
        let mut out = image.to_vec();
        let mut touched = false;
        if happens(rng, self.recombine) {
            let second = self.oriented(grid, other(rng), rng, true);
            recombine(grid, &mut out, &second, self.recombine_blend.to_radians());
            touched = true;
        }
        if happens(rng, self.join) {
            let second = self.oriented(grid, other(rng), rng, true);
            let bearing = std::f64::consts::TAU * uniform(rng);
            join(grid, &mut out, &second, bearing, 0.5 * signed(rng), self.join_blend);
            touched = true;
        }
        if happens(rng, self.mix) {
            let second = self.oriented(grid, other(rng), rng, true);
            mix(&mut out, &second, self.mix_share * uniform(rng));
            touched = true;
        }
        out = self.oriented(grid, &out, rng, false);
        if self.polar_warp > 0.0 {
            out = polar_warp(grid, &out, self.polar_warp * signed(rng));
            touched = true;
        }
        if self.azimuth_warp > 0.0 {
            let bearing = std::f64::consts::TAU * uniform(rng);
            out = azimuth_warp(grid, &out, self.azimuth_warp * signed(rng), bearing);
            touched = true;
        }
        if self.contrast > 0.0 {
            let gamma = (self.contrast * normal(rng)).exp() as f32;
            out.iter_mut().for_each(|v| *v *= gamma);
            touched = true;
        }
        if self.white_balance > 0.0 {
            let gains = [0; 3].map(|_| (self.white_balance * normal(rng)) as f32);
            add_per_channel(&mut out, gains);
            touched = true;
        }
        if touched {
            centre_exposure(grid, &mut out);
        }
        if self.exposure > 0.0 {
            let gain = (self.exposure * std::f64::consts::LN_2 * normal(rng)) as f32;
            add_per_channel(&mut out, [gain; 3]);
        }
        out
    }

    /// `image`, mirrored and turned as configured; a second panorama is always turned, or the two would keep
    /// the bearing in which they happened to be stored.
    fn oriented(&self, grid: Equirect, image: &[f32], rng: &mut impl Rng, always: bool) -> Vec<f32> {
        let mut out = image.to_vec();
        if happens(rng, self.mirror) {
            mirror(grid, &mut out);
        }
        if always || happens(rng, self.turn) {
            turn_columns(grid, &mut out, below(rng, grid.width));
        }
        out
    }
}

/// One draw even for a probability of 0 would shift every later one; it does not matter, since a stream is
/// owned by one sample of one step.
fn happens(rng: &mut impl Rng, probability: f64) -> bool {
    probability > 0.0 && uniform(rng) < probability
}

/// Exchanges left and right (y → −y).
pub fn mirror(grid: Equirect, image: &mut [f32]) {
    for row in image.chunks_exact_mut(3 * grid.width) {
        for i in 0..grid.width / 2 {
            for c in 0..3 {
                row.swap(3 * i + c, 3 * (grid.width - 1 - i) + c);
            }
        }
    }
}

/// Shifts the image `columns` to the right, wrapping: a turn by −2π·columns/W about z.
pub fn turn_columns(grid: Equirect, image: &mut [f32], columns: usize) {
    for row in image.chunks_exact_mut(3 * grid.width) {
        row.rotate_right(3 * (columns % grid.width));
    }
}

/// Moves content along meridians: the new row at polar angle θ shows what was at θ + amplitude·sin(2θ)/2.
/// Poles and horizon stay; for |amplitude| < 1 the map is monotone, so nothing is seen twice. Linear
/// interpolation of log radiance between rows.
pub fn polar_warp(grid: Equirect, image: &[f32], amplitude: f64) -> Vec<f32> {
    let stride = 3 * grid.width;
    let mut out = Vec::with_capacity(image.len());
    for j in 0..grid.height {
        let theta = grid.polar(j);
        let source = theta + 0.5 * amplitude * (2.0 * theta).sin();
        let position =
            (source / std::f64::consts::PI * grid.height as f64 - 0.5).clamp(0.0, (grid.height - 1) as f64);
        let low = (position as usize).min(grid.height.saturating_sub(2));
        let high = (low + 1).min(grid.height - 1);
        let t = (position - low as f64) as f32;
        let (a, b) = (&image[low * stride..][..stride], &image[high * stride..][..stride]);
        out.extend(a.iter().zip(b).map(|(a, b)| a + t * (b - a)));
    }
    out
}

/// Moves content along parallels: the new column at azimuth φ shows what was at φ + amplitude·sin(φ − bearing).
/// For |amplitude| < 1 the map is monotone and goes round once. Linear interpolation of log radiance between
/// columns, wrapped at the seam.
pub fn azimuth_warp(grid: Equirect, image: &[f32], amplitude: f64, bearing: f64) -> Vec<f32> {
    let width = grid.width;
    let columns: Vec<_> = (0..width)
        .map(|i| {
            let azimuth = grid.azimuth(i);
            let source = azimuth + amplitude * (azimuth - bearing).sin();
            let position = (0.5 - source / std::f64::consts::TAU) * width as f64 - 0.5;
            let low = position.floor();
            let wrap = |x: f64| x.rem_euclid(width as f64) as usize % width;
            (3 * wrap(low), 3 * wrap(low + 1.0), (position - low) as f32)
        })
        .collect();
    let mut out = Vec::with_capacity(image.len());
    for row in image.chunks_exact(3 * width) {
        for &(low, high, t) in &columns {
            out.extend((0..3).map(|c| row[low + c] + t * (row[high + c] - row[low + c])));
        }
    }
    out
}

/// Replaces the side of `image` towards azimuth `bearing` by that of `second`. With e the horizontal axis at
/// that bearing, the share of `second` rises smoothly with ⟨d, e⟩ from 0 to 1 around `offset`, over `blend`
/// times the range −1 to 1 (in log radiance). A function of the direction alone, it has no seam at the poles.
pub fn join(grid: Equirect, image: &mut [f32], second: &[f32], bearing: f64, offset: f64, blend: f64) {
    let cosines: Vec<_> = (0..grid.width).map(|i| (grid.azimuth(i) - bearing).cos()).collect();
    let stride = 3 * grid.width;
    let rows = image.chunks_exact_mut(stride).zip(second.chunks_exact(stride));
    for (j, (row, second)) in rows.enumerate() {
        let sin = grid.polar(j).sin();
        let pixels = row.chunks_exact_mut(3).zip(second.chunks_exact(3));
        for ((pixel, second), cosine) in pixels.zip(&cosines) {
            let t = smooth_step(sin * cosine - offset, blend);
            pixel.iter_mut().zip(second).for_each(|(v, s)| *v += t * (s - *v));
        }
    }
}

/// 0 below −half_width, 1 above it, 3t² − 2t³ between; a step if the width is 0.
fn smooth_step(x: f64, half_width: f64) -> f32 {
    if half_width <= 0.0 {
        return f32::from(x > 0.0);
    }
    let t = (0.5 + 0.5 * x / half_width).clamp(0.0, 1.0);
    (t * t * (3.0 - 2.0 * t)) as f32
}

/// Replaces the lower hemisphere of `image` by that of `ground`, blended over ± `half_width` radians about
/// the horizon with a smooth step (in log radiance).
pub fn recombine(grid: Equirect, image: &mut [f32], ground: &[f32], half_width: f64) {
    let stride = 3 * grid.width;
    let rows = image.chunks_exact_mut(stride).zip(ground.chunks_exact(stride));
    for (j, (sky, ground)) in rows.enumerate() {
        let below = grid.polar(j) - std::f64::consts::FRAC_PI_2;
        let t = smooth_step(below, half_width);
        sky.iter_mut().zip(ground).for_each(|(s, g)| *s += t * (g - *s));
    }
}

/// (1 − share) of `image` plus `share` of `second`, in linear radiance: light adds up.
pub fn mix(image: &mut [f32], second: &[f32], share: f64) {
    if share <= 0.0 {
        return;
    }
    let (own, other) = ((-share).ln_1p() as f32, share.ln() as f32);
    for (a, b) in image.iter_mut().zip(second) {
        let (x, y) = (*a + own, *b + other);
        // log(eˣ + eʸ) without overflow; x = −∞ at share 1 is fine
        *a = x.max(y) + (-(x - y).abs()).exp().ln_1p();
    }
}

fn add_per_channel(image: &mut [f32], gains: [f32; 3]) {
    for pixel in image.chunks_exact_mut(3) {
        pixel.iter_mut().zip(gains).for_each(|(v, g)| *v += g);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::exposure::log_exposure;
    use crate::data::random::{Purpose, stream};

    const GRID: Equirect = Equirect { width: 16, height: 8 };

    fn image(seed: u64) -> Vec<f32> {
        let mut rng = stream(seed, Purpose::Fit, 0, 0);
        let mut image: Vec<_> = (0..3 * GRID.len()).map(|_| normal(&mut rng) as f32).collect();
        centre_exposure(GRID, &mut image);
        image
    }

    fn strong() -> AugmentConfig {
        AugmentConfig {
            turn: 1.0,
            mirror: 0.5,
            exposure: 0.0,
            white_balance: 0.2,
            contrast: 0.2,
            polar_warp: 0.5,
            recombine: 0.7,
            recombine_blend: 10.0,
            azimuth_warp: 0.5,
            join: 0.7,
            join_blend: 0.5,
            mix: 0.7,
            mix_share: 0.5,
        }
    }

    #[test]
    fn off_is_the_identity_to_the_bit() {
        let a = image(1);
        let out = AugmentConfig::default().apply(GRID, &a, &mut stream(0, Purpose::Augment, 0, 0), |_| {
            unreachable!("no second panorama is needed")
        });
        assert_eq!(a, out);
    }

    #[test]
    fn the_same_stream_gives_the_same_image_at_exposure_zero() {
        let (a, b) = (image(1), image(2));
        let run =
            |slot| strong().apply(GRID, &a, &mut stream(0, Purpose::Augment, 5, slot), |_| b.as_slice());
        for slot in 0..20 {
            let out = run(slot);
            assert_eq!(out, run(slot));
            assert_ne!(out, a);
            assert!(out.iter().all(|v| v.is_finite()));
            assert!(log_exposure(GRID, &out).abs() < 1e-5);
        }
        assert_ne!(run(0), run(1));
    }

    #[test]
    fn mirror_and_turns_permute_columns() {
        let a = image(3);
        let mut b = a.clone();
        mirror(GRID, &mut b);
        assert_eq!(b[0..3], a[3 * 15..3 * 16]);
        mirror(GRID, &mut b);
        assert_eq!(a, b);
        turn_columns(GRID, &mut b, 5);
        assert_eq!(b[15..18], a[0..3]);
        turn_columns(GRID, &mut b, 11);
        assert_eq!(a, b);
    }

    #[test]
    fn polar_warp_keeps_order_and_moves_elevation() {
        // a ramp in θ: values must stay monotone, the horizon must stay in the middle
        let ramp: Vec<f32> =
            (0..GRID.height).flat_map(|j| std::iter::repeat_n(j as f32, 3 * GRID.width)).collect();
        for amplitude in [-0.9, 0.9] {
            let out = polar_warp(GRID, &ramp, amplitude);
            let column: Vec<_> = out.chunks_exact(3 * GRID.width).map(|r| r[0]).collect();
            // strictly, except where the first and last rows are held beyond their centres
            assert!(column.windows(2).all(|w| w[1] >= w[0]), "{column:?}");
            assert!(column[2..6].windows(2).all(|w| w[1] > w[0]), "{column:?}");
            // symmetric about the horizon
            assert!((column[3] + column[4] - 7.0).abs() < 1e-4);
            let shift = 0.5 * amplitude * (2.0 * GRID.polar(2)).sin();
            let expected = 2.0 + GRID.height as f64 / std::f64::consts::PI * shift;
            assert!((f64::from(column[2]) - expected).abs() < 1e-5);
        }
        assert_eq!(polar_warp(GRID, &ramp, 0.0), ramp);
    }

    #[test]
    fn azimuth_warp_moves_azimuths_by_the_sine_of_their_distance_to_its_bearing() {
        let a = image(8);
        let still = azimuth_warp(GRID, &a, 0.0, 1.0);
        assert!(still.iter().zip(&a).all(|(x, y)| (x - y).abs() < 1e-5));
        // the azimuth itself, as a phase: the warped phase must be φ + a sin(φ − φ₀) up to interpolation
        let grid = Equirect::new(256, 2);
        let phase: Vec<f32> = (0..grid.len())
            .flat_map(|p| {
                let azimuth = grid.azimuth(p % grid.width);
                [azimuth.cos() as f32, azimuth.sin() as f32, 0.0]
            })
            .collect();
        let out = azimuth_warp(grid, &phase, 0.8, 0.7);
        for i in 0..grid.width {
            let azimuth = grid.azimuth(i);
            let expected = azimuth + 0.8 * (azimuth - 0.7).sin();
            assert!((f64::from(out[3 * i]) - expected.cos()).abs() < 3e-4);
            assert!((f64::from(out[3 * i + 1]) - expected.sin()).abs() < 3e-4);
        }
    }

    #[test]
    fn joining_takes_sides_from_their_owners() {
        let (a, b) = (image(9), image(10));
        let mut out = a.clone();
        // towards +x, the middle of the image
        join(GRID, &mut out, &b, 0.0, 0.0, 0.0);
        for p in 0..GRID.len() {
            let front = (4..12).contains(&(p % GRID.width));
            let owner = if front { &b } else { &a };
            assert!((0..3).all(|c| (out[3 * p + c] - owner[3 * p + c]).abs() < 1e-6), "pixel {p}");
        }
        let mut all = a.clone();
        join(GRID, &mut all, &b, 0.3, -2.0, 0.5);
        assert!(all.iter().zip(&b).all(|(x, y)| (x - y).abs() < 1e-6));
    }

    #[test]
    fn recombination_takes_sky_and_ground_from_their_owners() {
        let (a, b) = (image(4), image(5));
        let mut out = a.clone();
        recombine(GRID, &mut out, &b, 0.0);
        let half = 3 * GRID.len() / 2;
        assert_eq!(out[..half], a[..half]);
        // a + 1·(b − a) rounds once
        assert!(out[half..].iter().zip(&b[half..]).all(|(x, y)| (x - y).abs() < 1e-6));
    }

    #[test]
    fn mixing_adds_linear_light() {
        let (a, b) = (image(6), image(7));
        let mut out = a.clone();
        mix(&mut out, &b, 0.3);
        for ((m, a), b) in out.iter().zip(&a).zip(&b) {
            let expected = 0.7 * a.exp() + 0.3 * b.exp();
            assert!((m.exp() - expected).abs() < 1e-5 * expected);
        }
        mix(&mut out, &b, 1.0);
        assert!(out.iter().zip(&b).all(|(x, y)| (x - y).abs() < 1e-6));
    }

    #[test]
    fn numbers_outside_their_range_are_named() {
        let config = AugmentConfig { polar_warp: 1.5, ..AugmentConfig::default() };
        let message = config.check().unwrap_err().to_string();
        assert!(message.contains("augment.polar_warp = 1.5"), "{message}");
        assert!(strong().check().is_ok());
        assert!(AugmentConfig { mix: f64::NAN, ..strong() }.check().is_err());
    }
}
