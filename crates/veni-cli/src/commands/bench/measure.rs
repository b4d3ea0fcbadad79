//! How often a bake is repeated, and which sizes take too long.

use std::time::{Duration, Instant};

use anyhow::Result;
use veni_light::sphere::Equirect;

use super::subject::Bakes;

/// A bake that takes longer is skipped, or done once.
const TOO_LONG: Duration = Duration::from_secs(10);
/// A measurement is repeated for so long,
const LONG_ENOUGH: Duration = Duration::from_secs(1);
/// and at least so often.
const LEAST: usize = 2;
/// What is baked first of all: kernels are compiled by it, and it tells what the smallest size will take.
const FIRST: (usize, usize) = (32, 16);

/// How long one bake takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Measured {
    /// The best of several, if they are short.
    Took(Duration),
    /// About so long, from what a smaller size took.
    WouldTake(Duration),
}

/// Measures sizes in ascending order.
pub(super) struct Stopwatch {
    all: bool,
    /// Directions of the largest size so far, and what it took.
    last: (usize, Duration),
}

impl Stopwatch {
    pub(super) fn start(bakes: &mut dyn Bakes, all: bool) -> Result<Self> {
        let grid = Equirect::new(FIRST.0, FIRST.1);
        bakes.bake(grid)?;
        Ok(Self { all, last: (grid.len(), bakes.bake(grid)?) })
    }

    pub(super) fn measure(&mut self, bakes: &mut dyn Bakes, grid: Equirect) -> Result<Measured> {
        let (directions, time) = self.last;
        let estimate = time.mul_f64(grid.len() as f64 / directions as f64);
        if estimate > TOO_LONG && !self.all {
            return Ok(Measured::WouldTake(estimate));
        }
        let first = bakes.bake(grid)?;
        let (started, mut best, mut repeats) = (Instant::now(), Duration::MAX, 0);
        // against cold pages, clocks and caches, which are nothing to one that long
        while first <= TOO_LONG && (repeats < LEAST || started.elapsed() < LONG_ENOUGH) {
            best = best.min(bakes.bake(grid)?);
            repeats += 1;
        }
        let best = best.min(first);
        self.last = (grid.len(), best);
        Ok(Measured::Took(best))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Says that it took `per_direction`, and takes no time. Every third bake is disturbed.
    struct Claims {
        per_direction: Duration,
        bakes: u32,
    }

    impl Bakes for Claims {
        fn bake(&mut self, grid: Equirect) -> Result<Duration> {
            self.bakes += 1;
            let disturbed = if self.bakes.is_multiple_of(3) { 2 } else { 1 };
            Ok(self.per_direction * grid.len() as u32 * disturbed)
        }
    }

    #[test]
    fn the_best_counts_and_what_takes_too_long_is_foreseen() {
        let mut slow = Claims { per_direction: Duration::from_micros(50), bakes: 0 };
        let mut stopwatch = Stopwatch::start(&mut slow, false).unwrap();
        let small = stopwatch.measure(&mut slow, Equirect::new(128, 64)).unwrap();
        assert_eq!(small, Measured::Took(Duration::from_micros(50 * 128 * 64)));
        let bakes = slow.bakes;
        assert!(bakes > 5, "{bakes}");
        let large = stopwatch.measure(&mut slow, Equirect::new(1024, 512)).unwrap();
        assert_eq!(large, Measured::WouldTake(Duration::from_micros(50 * 1024 * 512)));
        assert_eq!(slow.bakes, bakes, "what is skipped is not begun");
        let mut all = Stopwatch { all: true, ..stopwatch };
        slow.bakes = 0;
        let large = all.measure(&mut slow, Equirect::new(1024, 512)).unwrap();
        assert_eq!(large, Measured::Took(Duration::from_micros(50 * 1024 * 512)));
        assert_eq!(slow.bakes, 1, "what takes long is done once");
    }
}
