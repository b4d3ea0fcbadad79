//! Progress on stderr: a bar on a terminal, a plain line every few seconds in a log, nothing with `--quiet`.

mod bar;
mod library;

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::report::Report;
use bar::Bar;

pub(crate) use bar::duration;

/// What a command shows of its work: one bar at a time, that of what began last. Several threads may report to it.
pub(crate) struct ProgressBars {
    report: Report,
    current: Mutex<Option<Work>>,
}

/// The work that began last.
struct Work {
    bar: Bar,
    what: String,
    /// What is said beside units that are only counted.
    message: String,
    done: u64,
}

impl ProgressBars {
    pub(crate) fn new(report: Report) -> Self {
        Self { report, current: Mutex::new(None) }
    }

    /// Work of `total` units ("row", "step") begins; `what` says which, if there are several kinds in one command.
    pub(crate) fn begin(&self, what: &str, unit: &str, total: Option<u64>) {
        self.begin_after(0, what, unit, total);
    }

    /// The same for work of which `done` units were done earlier: they say nothing about the time that the rest takes.
    pub(crate) fn begin_after(&self, done: u64, what: &str, unit: &str, total: Option<u64>) {
        let mut current = self.current();
        end(&mut current);
        let bar = Bar::start(self.report, unit, done, total);
        *current = Some(Work { bar, what: what.to_owned(), message: String::new(), done });
    }

    /// `done` units are done in all.
    pub(crate) fn advance(&self, done: u64, message: &str) {
        if let Some(work) = self.current().as_mut() {
            work.advance(done, message);
        }
    }

    /// This many more units are done.
    pub(crate) fn add(&self, units: u64) {
        if let Some(work) = self.current().as_mut() {
            let message = std::mem::take(&mut work.message);
            work.advance(work.done + units, &message);
            work.message = message;
        }
    }

    /// What stands beside the units that are counted from here on.
    #[cfg(feature = "learn")]
    pub(crate) fn describe(&self, message: String) {
        if let Some(work) = self.current().as_mut() {
            work.message = message;
        }
    }

    /// A remark, above the bar if there is one.
    pub(crate) fn note(&self, text: &str) {
        match self.current().as_ref() {
            Some(work) => work.bar.note(text),
            None => self.report.note(text),
        }
    }

    /// Takes the bar away, so that what follows starts on a clean line.
    pub(crate) fn end(&self) {
        end(&mut self.current());
    }

    /// A panic in another thread is reported there; the bar is whole between calls.
    fn current(&self) -> MutexGuard<'_, Option<Work>> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for ProgressBars {
    fn drop(&mut self) {
        self.end();
    }
}

impl Work {
    /// Threads may overtake one another: what is done never becomes less.
    fn advance(&mut self, done: u64, message: &str) {
        self.done = self.done.max(done);
        let what = &self.what;
        self.bar.set(self.done, || match (what.is_empty(), message.is_empty()) {
            (false, false) => format!("{what}, {message}"),
            _ => format!("{what}{message}"),
        });
    }
}

fn end(current: &mut Option<Work>) {
    if let Some(work) = current.take() {
        work.bar.finish();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_done_never_becomes_less_and_new_work_begins_at_zero() {
        let progress = ProgressBars::new(Report::new(false, true));
        let done = || progress.current().as_ref().map(|work| work.done);
        progress.advance(3, "");
        assert_eq!(done(), None, "nothing has begun");
        progress.begin_after(2, "", "row", Some(9));
        assert_eq!(done(), Some(2));
        progress.advance(5, "");
        progress.advance(4, "late");
        progress.add(2);
        assert_eq!(done(), Some(7));
        progress.begin("", "row", None);
        assert_eq!(done(), Some(0));
        progress.end();
        assert_eq!(done(), None);
    }
}
