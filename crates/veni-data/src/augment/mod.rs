//! Augmentation: new plausible skies from few.
//!
//! Every operation works on an equirectangular image of H × W × 3 values, row-major, channels last, natural
//! logarithm of radiance unless it says otherwise. All draws come from the stream that the caller names, so an
//! augmented batch is a pure function of (seed, step, slot). An operation whose strength is 0 is skipped, and
//! with everything off the image comes back bit for bit.
//!
//! Rotation: encoder and decoder commute with rotations about z, so rotating a single panorama teaches nothing but
//! what the encoder's sampling grid hides inside one stripe; that is covered by the sampling yaw. Rotations matter
//! where two panoramas meet (mixing, recombination, joining), and there whole columns are enough and lose nothing.

use serde::{Deserialize, Serialize};
use veni_light::random::Stream;

mod combine;
mod warp;

pub use combine::{join, mix, recombine};
pub use warp::{azimuth_warp, mirror, polar_warp, rotate_columns};

use veni_image::exposure::centre_exposure;
use veni_light::sphere::Equirect;

/// Strengths and probabilities. The default is off: the identity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AugmentConfig {
    /// Probability of rotating the image by a random number of columns.
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
    /// back to exposure 0 before the exposure jitter, whenever anything but a rotation or mirror touched it.
    pub fn apply<'a>(
        &self,
        grid: Equirect,
        image: &[f32],
        rng: &mut Stream,
        mut other: impl FnMut(&mut Stream) -> &'a [f32],
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
            let bearing = std::f64::consts::TAU * rng.uniform();
            join(grid, &mut out, &second, bearing, 0.5 * rng.signed(), self.join_blend);
            touched = true;
        }
        if happens(rng, self.mix) {
            let second = self.oriented(grid, other(rng), rng, true);
            mix(&mut out, &second, self.mix_share * rng.uniform());
            touched = true;
        }
        out = self.oriented(grid, &out, rng, false);
        if self.polar_warp > 0.0 {
            out = polar_warp(grid, &out, self.polar_warp * rng.signed());
            touched = true;
        }
        if self.azimuth_warp > 0.0 {
            let bearing = std::f64::consts::TAU * rng.uniform();
            out = azimuth_warp(grid, &out, self.azimuth_warp * rng.signed(), bearing);
            touched = true;
        }
        if self.contrast > 0.0 {
            let gamma = (self.contrast * rng.normal()).exp() as f32;
            out.iter_mut().for_each(|v| *v *= gamma);
            touched = true;
        }
        if self.white_balance > 0.0 {
            let gains = [0; 3].map(|_| (self.white_balance * rng.normal()) as f32);
            add_per_channel(&mut out, gains);
            touched = true;
        }
        if touched {
            centre_exposure(grid, &mut out);
        }
        if self.exposure > 0.0 {
            let gain = (self.exposure * std::f64::consts::LN_2 * rng.normal()) as f32;
            add_per_channel(&mut out, [gain; 3]);
        }
        out
    }

    /// `image`, mirrored and rotated as configured; a second panorama is always rotated, or the two would keep
    /// the bearing in which they happened to be stored.
    fn oriented(&self, grid: Equirect, image: &[f32], rng: &mut Stream, always: bool) -> Vec<f32> {
        let mut out = image.to_vec();
        if happens(rng, self.mirror) {
            mirror(grid, &mut out);
        }
        if always || happens(rng, self.turn) {
            rotate_columns(grid, &mut out, rng.below(grid.width));
        }
        out
    }
}

/// One draw even for a probability of 0 would shift every later one; it does not matter, since a stream is
/// owned by one sample of one step.
fn happens(rng: &mut Stream, probability: f64) -> bool {
    probability > 0.0 && rng.uniform() < probability
}

fn add_per_channel(image: &mut [f32], gains: [f32; 3]) {
    for pixel in image.chunks_exact_mut(3) {
        pixel.iter_mut().zip(gains).for_each(|(v, g)| *v += g);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_image::exposure::log_exposure;
    use veni_light::random::{Purpose, stream};

    pub(super) const GRID: Equirect = Equirect { width: 16, height: 8 };

    pub(super) fn image(seed: u64) -> Vec<f32> {
        let mut rng = stream(seed, Purpose::Fit, 0, 0);
        let mut image: Vec<_> = (0..3 * GRID.len()).map(|_| rng.normal() as f32).collect();
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
    fn numbers_outside_their_range_are_named() {
        let config = AugmentConfig { polar_warp: 1.5, ..AugmentConfig::default() };
        let message = config.check().unwrap_err().to_string();
        assert!(message.contains("augment.polar_warp = 1.5"), "{message}");
        assert!(strong().check().is_ok());
        assert!(AugmentConfig { mix: f64::NAN, ..strong() }.check().is_err());
    }
}
