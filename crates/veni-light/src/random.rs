//! Random numbers without state: every draw is named by what it is for.
//!
//! A stream is ChaCha8 keyed by (seed, purpose, step, slot). Nothing has to be saved to continue a run, and
//! the order in which threads ask changes nothing.

use chacha20::ChaCha8Rng;
use rand::{Rng, SeedableRng};

/// What a stream of random numbers is for; part of its key, so that streams never overlap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Which panoramas a batch takes.
    Order,
    /// Augmentation of one batch slot.
    Augment,
    /// The noise of the variational sample.
    Noise,
    /// The loss grid and the encoder's sampling of a step.
    Sampling,
    /// Train/validation split of one folder.
    Split,
    /// Latents drawn for previews.
    Preview,
    /// Starting values of weights.
    Weights,
    /// Starting points of a latent optimisation.
    Fit,
    /// Latents that an evaluation draws.
    Evaluation,
}

/// The stream for `purpose` at (`step`, `slot`) of the run with this `seed`.
pub fn stream(seed: u64, purpose: Purpose, step: u64, slot: u64) -> ChaCha8Rng {
    let mut key = [0; 32];
    for (bytes, word) in key.chunks_exact_mut(8).zip([seed, purpose as u64, step, slot]) {
        bytes.copy_from_slice(&word.to_le_bytes());
    }
    ChaCha8Rng::from_seed(key)
}

/// Uniform in [0, 1), 53 bits.
pub fn uniform(rng: &mut impl Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

/// Uniform in [−1, 1).
pub fn signed(rng: &mut impl Rng) -> f64 {
    2.0 * uniform(rng) - 1.0
}

/// Uniform integer in 0..n (by multiplication; the bias is below n/2⁶⁴).
///
/// # Panics
/// If `n` is 0.
pub fn below(rng: &mut impl Rng, n: usize) -> usize {
    assert!(n > 0, "no integer lies in 0..0");
    ((u128::from(rng.next_u64()) * n as u128) >> 64) as usize
}

/// Standard normal number.
pub fn normal(rng: &mut impl Rng) -> f64 {
    use rand_distr::{Distribution, StandardNormal};
    StandardNormal.sample(rng)
}

/// A permutation of 0..n (Fisher–Yates).
pub fn permutation(rng: &mut impl Rng, n: usize) -> Vec<usize> {
    let mut order: Vec<_> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, below(rng, i + 1));
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_repeat_and_differ_by_every_part_of_their_key() {
        let first = |s, p, t, k| stream(s, p, t, k).next_u64();
        let base = first(1, Purpose::Noise, 2, 3);
        assert_eq!(base, first(1, Purpose::Noise, 2, 3));
        for other in [
            first(2, Purpose::Noise, 2, 3),
            first(1, Purpose::Order, 2, 3),
            first(1, Purpose::Noise, 3, 3),
            first(1, Purpose::Noise, 2, 4),
        ] {
            assert_ne!(base, other);
        }
    }

    #[test]
    fn draws_have_the_right_moments() {
        let mut rng = stream(0, Purpose::Order, 0, 0);
        let n = 20_000;
        let (mut u, mut g, mut g2) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            u += uniform(&mut rng) / f64::from(n);
            let x = normal(&mut rng);
            g += x / f64::from(n);
            g2 += x * x / f64::from(n);
        }
        // five standard errors
        assert!((u - 0.5).abs() < 5.0 * 0.289 / f64::from(n).sqrt());
        assert!(
            g.abs() < 5.0 / f64::from(n).sqrt()
                && (g2 - 1.0).abs() < 5.0 * 2_f64.sqrt() / f64::from(n).sqrt()
        );
    }

    #[test]
    fn permutations_hold_every_index_once() {
        let mut order = permutation(&mut stream(7, Purpose::Split, 0, 0), 50);
        assert_ne!(order, (0..50).collect::<Vec<_>>());
        order.sort_unstable();
        assert_eq!(order, (0..50).collect::<Vec<_>>());
    }
}
