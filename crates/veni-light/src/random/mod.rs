//! Random numbers without state: every draw is named by what it is for.
//!
//! A stream is ChaCha8 keyed by (seed, purpose, step, slot). Nothing has to be saved to continue a run, and
//! the order in which threads ask changes nothing.

mod exponential;
mod normal;

pub(crate) use exponential::exp;

use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};

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

/// A stream of random numbers, ChaCha8: the same on every machine and in every version of this crate.
#[derive(Debug, PartialEq, Eq)]
pub struct Stream(ChaCha8Rng);

/// The stream for `purpose` at (`step`, `slot`) of the run with this `seed`.
pub fn stream(seed: u64, purpose: Purpose, step: u64, slot: u64) -> Stream {
    Stream::from_key([seed, purpose as u64, step, slot])
}

impl Stream {
    /// The stream named by one number. No [`stream`] is the same.
    pub fn from_seed(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// The stream named by four numbers; [`stream`] is this, and its second number is small.
    pub fn from_key(key: [u64; 4]) -> Self {
        let mut bytes = [0; 32];
        for (bytes, word) in bytes.chunks_exact_mut(8).zip(key) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        Self(ChaCha8Rng::from_seed(bytes))
    }

    /// 32 random bits.
    pub fn next_u32(&mut self) -> u32 {
        self.0.next_u32()
    }

    /// 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// Uniform in [0, 1), 53 bits.
    pub fn uniform(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// Uniform in [−1, 1), 53 bits.
    pub fn signed(&mut self) -> f64 {
        2.0 * self.uniform() - 1.0
    }

    /// Uniform integer in 0..n (by multiplication; the bias is below n/2⁶⁴).
    ///
    /// # Panics
    /// If `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        assert!(n > 0, "no integer lies in 0..0");
        ((u128::from(self.next_u64()) * n as u128) >> 64) as usize
    }

    /// A standard normal number: the first of a [pair](Self::normals), so that no half of a pair waits unseen.
    pub fn normal(&mut self) -> f64 {
        self.normals()[0]
    }

    /// Two independent standard normal numbers.
    pub fn normals(&mut self) -> [f64; 2] {
        normal::pair(self)
    }

    /// A permutation of 0..n (Fisher–Yates).
    pub fn permutation(&mut self, n: usize) -> Vec<usize> {
        let mut order: Vec<_> = (0..n).collect();
        for i in (1..n).rev() {
            order.swap(i, self.below(i + 1));
        }
        order
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform and normal numbers of `Stream::from_seed(1)`, then of a stream with a purpose.
    const PINNED: [[f64; 8]; 4] = [
        [
            0.40248566366484806,
            0.08038370892978197,
            0.5965601809348549,
            0.2193245804838001,
            0.28369059130373764,
            0.7106102236811087,
            0.46108817320691575,
            0.15265269640601276,
        ],
        [
            -0.1747320773836057,
            0.46984270979143933,
            -1.0178055033617825,
            -0.13323231818139938,
            0.6908059689818371,
            -0.5757365528176105,
            -0.46457804809431996,
            -0.3706213875816498,
        ],
        [
            0.4185732403483192,
            0.21739468329775535,
            0.09178475146022147,
            0.5848986409779567,
            0.0009186617690093435,
            0.46605916855290186,
            0.7806702746688712,
            0.7961999019374969,
        ],
        [
            -0.40338120384069004,
            -0.8345307568282414,
            0.6201121453438604,
            0.33404482016097553,
            -0.43799689558884236,
            -1.3272835790992195,
            0.4643662981187113,
            -0.18443000049824365,
        ],
    ];

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
            u += rng.uniform() / f64::from(n);
            let x = rng.normal();
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
        let mut order = stream(7, Purpose::Split, 0, 0).permutation(50);
        assert_ne!(order, (0..50).collect::<Vec<_>>());
        order.sort_unstable();
        assert_eq!(order, (0..50).collect::<Vec<_>>());
    }

    /// Seeds name skies, scenes and runs: their numbers may not change with a version, a machine or a dependency.
    #[test]
    fn the_first_numbers_are_pinned() {
        let first = |mut draw: Box<dyn FnMut() -> f64>| -> Vec<f64> { (0..8).map(|_| draw()).collect() };
        let named = || stream(1, Purpose::Noise, 2, 3);
        let [mut a, mut b, mut c, mut d] = [Stream::from_seed(1), Stream::from_seed(1), named(), named()];
        let found = [
            first(Box::new(move || a.uniform())),
            first(Box::new(move || b.normal())),
            first(Box::new(move || c.uniform())),
            first(Box::new(move || d.normal())),
        ];
        assert_eq!(found, PINNED);
    }
}
