//! One budget of memory for the pixels that all threads hold, so that several large files are not decoded at once.

use std::path::Path;
use std::sync::{Condvar, Mutex, MutexGuard, OnceLock, PoisonError};

use crate::{ReadOptions, memory};

/// What may be held where the system does not say what it has: half of what a small machine has today.
const UNKNOWN: u64 = 4 << 30;
/// However little is left, one small file is read at a time.
const LEAST: u64 = 64 << 20;

/// A budget in bytes that jobs draw on for as long as they hold pixels.
///
/// A job claims what it will need at its peak, once, before it allocates, and gives it back when the [`Claim`] is
/// dropped. Claims are met in the order in which they are asked for, so that a large one does not wait for ever; one that
/// is larger than the whole budget is met when nothing else is held.
///
/// A job must not claim again while it holds a claim, nor run on a thread of a work-stealing pool, which may start another
/// job in the middle of one: either could wait for itself.
#[derive(Debug)]
pub struct Budget {
    total: u64,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    used: u64,
    /// The number that the next to ask gets, and the one whose turn it is.
    next: u64,
    turn: u64,
}

/// A part of a [`Budget`], given back when it is dropped.
#[derive(Debug)]
pub struct Claim<'a> {
    budget: &'a Budget,
    bytes: u64,
}

impl Budget {
    /// A budget of `total` bytes.
    pub const fn new(total: u64) -> Self {
        let state = State { used: 0, next: 0, turn: 0 };
        Self { total, state: Mutex::new(state), changed: Condvar::new() }
    }

    /// The budget that all work of this process shares: half of the memory that was available when it was first asked
    /// for, 4 GiB where the system does not tell.
    pub fn shared() -> &'static Self {
        static SHARED: OnceLock<Budget> = OnceLock::new();
        SHARED.get_or_init(|| Self::new(memory::available().map_or(UNKNOWN, |bytes| bytes / 2).max(LEAST)))
    }

    /// Takes `bytes`, waiting until they are free.
    pub fn claim(&self, bytes: u64) -> Claim<'_> {
        let mut state = self.lock();
        let ticket = state.next;
        state.next += 1;
        while state.turn != ticket || (state.used > 0 && state.used.saturating_add(bytes) > self.total) {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.turn += 1;
        state.used = state.used.saturating_add(bytes);
        drop(state);
        self.changed.notify_all();
        Claim { budget: self, bytes }
    }

    /// Takes what reading and examining the file at `path` needs at its peak ([`peak_bytes`](crate::peak_bytes)); nothing for
    /// files of which that cannot be told: to read them is an error.
    pub fn claim_file(&self, path: &Path, options: &ReadOptions) -> Claim<'_> {
        self.claim(crate::peak_bytes(path, options).ok().flatten().unwrap_or(0))
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Claim<'_> {
    fn drop(&mut self) {
        let mut state = self.budget.lock();
        state.used = state.used.saturating_sub(self.bytes);
        drop(state);
        self.budget.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::thread;

    /// The largest sum held at once by `jobs` threads of each a claim.
    fn peak(budget: &Budget, jobs: &[u64]) -> u64 {
        let (held, most) = (AtomicU64::new(0), AtomicU64::new(0));
        thread::scope(|scope| {
            for bytes in jobs {
                let (held, most) = (&held, &most);
                scope.spawn(move || {
                    for _ in 0..50 {
                        let _claim = budget.claim(*bytes);
                        most.fetch_max(held.fetch_add(*bytes, Ordering::SeqCst) + bytes, Ordering::SeqCst);
                        thread::yield_now();
                        held.fetch_sub(*bytes, Ordering::SeqCst);
                    }
                });
            }
        });
        assert_eq!(budget.lock().used, 0, "all is given back");
        most.into_inner()
    }

    #[test]
    fn no_more_is_held_than_there_is() {
        let budget = Budget::new(100);
        let most = peak(&budget, &[40, 40, 40, 30, 10, 60]);
        assert!((40..=100).contains(&most), "{most}");
        // without a limit the same jobs hold more: the check above can fail
        assert!(peak(&Budget::new(1000), &[40; 16]) > 100);
    }

    #[test]
    fn one_larger_than_the_whole_waits_for_all_others_and_is_met() {
        let budget = Budget::new(100);
        let most = peak(&budget, &[300, 50, 50]);
        assert_eq!(most, 300, "alone");
    }
}
