//! Progress of reading panoramas, told by several threads.

use std::sync::{Mutex, PoisonError};

use crate::progress::Progress;
use crate::report::Report;

/// A bar for each set of panoramas that is read.
pub(crate) struct Loading {
    report: Report,
    current: Mutex<Option<Set>>,
}

struct Set {
    bar: Progress,
    done: usize,
    all: usize,
}

impl Loading {
    pub(crate) fn new(report: Report) -> Self {
        Self { report, current: Mutex::new(None) }
    }

    /// `done` of `all` panoramas are there.
    pub(crate) fn set(&self, done: usize, all: usize) {
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        // threads may overtake one another by a few panoramas; the next set falls back by more
        let is_same = current.as_ref().is_some_and(|set| set.all == all && done + 64 > set.done);
        if !is_same {
            if let Some(set) = current.take() {
                set.bar.finish();
            }
            let bar = Progress::start(self.report, "panorama", 0, all as u64);
            *current = Some(Set { bar, done: 0, all });
        }
        if let Some(set) = current.as_mut()
            && done > set.done
        {
            set.done = done;
            set.bar.set(done as u64, || "loading".to_owned());
        }
    }

    /// Takes the bar away.
    pub(crate) fn finish(self) {
        if let Some(set) = self.current.into_inner().unwrap_or_else(PoisonError::into_inner) {
            set.bar.finish();
        }
    }
}
