//! What the processor could do at most: its rate of multiply-adds, for saying how close a bake comes to it.

use std::hint::black_box;
use std::time::{Duration, Instant};

use pulp::{Simd, WithSimd};

/// Chains that do not wait for each other: more than the latency of a multiply-add times the units that do them (4 × 2
/// on most processors), and few enough for 16 registers with the two constants.
const CHAINS: usize = 12;
/// Multiply-adds of each chain in a round, written out so that counting rounds costs nothing.
const STEPS: usize = 8;
/// A measurement lasts at least so long: starting all threads is then a thousandth of it.
const LONG_ENOUGH: Duration = Duration::from_millis(20);
/// The best of this many counts, since other programs only ever make it slower.
const REPEATS: usize = 8;

/// The rate of f32 multiply-adds of all threads of the current rayon pool together, in registers and with the SIMD that
/// the kernels of this module use, in floating-point operations per second: a multiply-add counts two. Takes about a
/// fifth of a second, in which the machine should have nothing else to do.
///
/// No bake can be faster than this allows; divide [`Field::bake`](super::Field::bake)'s operations by it to see how good
/// it is.
pub fn multiply_add_rate() -> f64 {
    let mut rounds = 1 << 12;
    let (mut best, mut operations) = timed(rounds);
    while best < LONG_ENOUGH {
        rounds *= 4;
        (best, operations) = timed(rounds);
    }
    for _ in 1..REPEATS {
        best = best.min(timed(rounds).0);
    }
    operations / best.as_secs_f64()
}

/// Runs this many rounds on every thread: the time until the last is done, and floating-point operations of all.
fn timed(rounds: usize) -> (Duration, f64) {
    let started = Instant::now();
    let lanes = crate::tasks::on_every_thread(|| pulp::Arch::new().dispatch(Chains { rounds }));
    let time = started.elapsed();
    (time, (lanes.iter().sum::<usize>() * rounds * STEPS * CHAINS * 2) as f64)
}

/// The work of one thread. Gives the number of lanes it had.
struct Chains {
    rounds: usize,
}

impl WithSimd for Chains {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        // every chain converges to 1: no overflow, and no denormal numbers, which some processors are slow at
        let factor = simd.splat_f32s(black_box(0.999));
        let term = simd.splat_f32s(black_box(0.001));
        let mut x = [simd.splat_f32s(0.0); CHAINS];
        for (i, x) in x.iter_mut().enumerate() {
            *x = simd.splat_f32s(black_box(i as f32));
        }
        for _ in 0..self.rounds {
            for _ in 0..STEPS {
                for x in &mut x {
                    *x = simd.mul_add_e_f32s(*x, factor, term);
                }
            }
        }
        let mut sum = x[0];
        for x in &x[1..] {
            sum = simd.add_f32s(sum, *x);
        }
        black_box(simd.reduce_sum_f32s(sum));
        S::F32_LANES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chains of multiply-adds that all converge to 1 are the operations that are counted: rounds × steps × chains of
    /// two for every lane of every thread.
    #[test]
    fn every_operation_that_is_counted_is_done() {
        let lanes = crate::tasks::on_every_thread(|| pulp::Arch::new().dispatch(Chains { rounds: 1 }));
        let [(_, once), (_, often)] = [1, 1000].map(timed);
        assert_eq!(once, (lanes.iter().sum::<usize>() * 2 * 8 * 12) as f64);
        assert_eq!(often, 1000.0 * once);
    }

    /// A loop of one chain without SIMD, on one thread, does a multiply-add in some 8 cycles. A core with SIMD does 2 × 12
    /// in that time and more, for each of its lanes: if it did fewer, or beyond 64 times as many, a loop was removed or
    /// counted wrongly.
    #[test]
    fn the_rate_is_that_of_the_processor() {
        let count = 1 << 22;
        let plain = (0..5).map(|_| {
            let (factor, term, mut x) = (black_box(0.999f32), black_box(0.001f32), black_box(0.0f32));
            let started = Instant::now();
            for _ in 0..count {
                x = x * factor + term;
            }
            black_box(x);
            f64::from(2 * count) / started.elapsed().as_secs_f64()
        });
        let plain = plain.fold(0.0, f64::max);
        let lanes = crate::tasks::on_every_thread(|| pulp::Arch::new().dispatch(Chains { rounds: 1 }));
        let ratio = multiply_add_rate() / plain;
        let (one, all) = (lanes[0] as f64, lanes.iter().sum::<usize>() as f64);
        assert!((one..64.0 * all).contains(&ratio), "{ratio} times a plain loop with {lanes:?} lanes");
    }
}
