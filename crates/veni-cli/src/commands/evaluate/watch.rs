//! Progress of several tasks, told by several threads.

use std::sync::{Mutex, PoisonError};

use veni_eval::protocol::Watch;

use crate::progress::Progress;
use crate::report::Report;

/// One bar at a time: that of the task that began last.
pub(super) struct Bars {
    report: Report,
    current: Mutex<Option<Task>>,
}

struct Task {
    bar: Progress,
    name: String,
    done: u64,
}

impl Bars {
    pub(super) fn new(report: Report) -> Self {
        Self { report, current: Mutex::new(None) }
    }

    /// Takes the bar away.
    pub(super) fn finish(&self) {
        if let Some(task) = self.current.lock().unwrap_or_else(PoisonError::into_inner).take() {
            task.bar.finish();
        }
    }
}

impl Watch for Bars {
    fn begin(&self, unit: &'static str, task: &str, done: usize, total: usize) {
        self.finish();
        if done > 0 {
            self.report.note(format_args!("{task}: {done} of {total} {unit}s kept from an earlier run"));
        }
        if done < total {
            let bar = Progress::start(self.report, unit, done as u64, total as u64);
            let task = Task { bar, name: task.to_owned(), done: done as u64 };
            *self.current.lock().unwrap_or_else(PoisonError::into_inner) = Some(task);
        }
    }

    fn advance(&self, units: usize) {
        if let Some(task) = self.current.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
            task.done += units as u64;
            let name = &task.name;
            task.bar.set(task.done, || name.clone());
        }
    }
}
