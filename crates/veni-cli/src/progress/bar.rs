//! How one piece of work is shown.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::report::{Report, to_stderr};

/// Work shorter than this shows no progress at all.
const PATIENCE: Duration = Duration::from_millis(700);
/// The bar is drawn at most this often: a slow terminal must not hold up the work.
const FRAME: Duration = Duration::from_millis(100);
/// At most one plain line in this time.
const LINE_INTERVAL: Duration = Duration::from_secs(5);

/// How far a piece of work has come.
pub(super) struct Bar {
    unit: String,
    total: Option<u64>,
    /// Where it stood at `started` (a resumed run does not start at 0).
    first: u64,
    started: Instant,
    shown: Option<Instant>,
    view: View,
}

enum View {
    Silent,
    Lines,
    Bar(ProgressBar),
}

impl Bar {
    /// From `first` towards `total` units ("row", "step").
    pub(super) fn start(report: Report, unit: &str, first: u64, total: Option<u64>) -> Self {
        let view = if report.is_quiet() {
            View::Silent
        } else if std::io::stderr().is_terminal() {
            let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::hidden());
            let template = match total {
                Some(_) => "{bar:24.cyan/dim} {pos}/{len} {prefix} · {eta} left{wide_msg}",
                None => "{spinner} {pos} {prefix}{wide_msg}",
            };
            // the templates are constants; a wrong one would show in the first test
            bar.set_style(ProgressStyle::with_template(template).unwrap_or(ProgressStyle::default_bar()));
            bar.set_prefix(format!("{unit}s"));
            bar.set_position(first);
            bar.reset_eta();
            View::Bar(bar)
        } else {
            View::Lines
        };
        Self { unit: unit.to_owned(), total, first, started: Instant::now(), shown: None, view }
    }

    /// `done` units are done; `detail` is only asked for when it will be shown.
    pub(super) fn set(&mut self, done: u64, detail: impl FnOnce() -> String) {
        let waited = self.started.elapsed();
        match &self.view {
            View::Silent => {}
            View::Bar(bar) => {
                let due = self.shown.map_or(waited >= PATIENCE, |last| last.elapsed() >= FRAME);
                if !due {
                    return;
                }
                if self.shown.is_none() {
                    bar.set_draw_target(ProgressDrawTarget::stderr());
                }
                self.shown = Some(Instant::now());
                let detail = detail();
                bar.set_message(if detail.is_empty() { detail } else { format!(" · {detail}") });
                bar.set_position(done);
            }
            View::Lines => {
                if self.shown.unwrap_or(self.started).elapsed() < LINE_INTERVAL {
                    return;
                }
                self.shown = Some(Instant::now());
                let line = line(&self.unit, done, self.first, self.total, waited, &detail());
                to_stderr(&format!("{line}\n"));
            }
        }
    }

    /// A remark between two updates, above the bar if there is one.
    pub(super) fn note(&self, text: &str) {
        match &self.view {
            View::Silent => {}
            View::Bar(bar) if self.shown.is_some() => bar.println(text),
            View::Bar(_) | View::Lines => to_stderr(&format!("{text}\n")),
        }
    }

    /// Removes the bar, so that what follows starts on a clean line.
    pub(super) fn finish(self) {
        if let View::Bar(bar) = self.view {
            bar.finish_and_clear();
        }
    }
}

fn line(unit: &str, done: u64, first: u64, total: Option<u64>, waited: Duration, detail: &str) -> String {
    let detail = if detail.is_empty() { String::new() } else { format!(", {detail}") };
    let Some(total) = total else { return format!("{unit} {done}{detail}") };
    let left = match done.saturating_sub(first) {
        0 => "?".to_owned(),
        progress => {
            let rate = waited.as_secs_f64() / progress as f64;
            duration(Duration::from_secs_f64(rate * total.saturating_sub(done) as f64))
        }
    };
    format!("{unit} {done}/{total}{detail}, {left} left")
}

/// A time span as a person says it: "41 s", "12 min", "3 h 05 min".
pub(crate) fn duration(span: Duration) -> String {
    let seconds = span.as_secs_f64().round() as u64;
    match seconds {
        0..120 => format!("{seconds} s"),
        120..7200 => format!("{} min", (seconds + 30) / 60),
        _ => format!("{} h {:02} min", seconds / 3600, seconds % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_counts_from_where_a_run_was_resumed() {
        let ten = Duration::from_secs(10);
        assert_eq!(line("step", 60, 50, Some(100), ten, "loss 0.5"), "step 60/100, loss 0.5, 40 s left");
        assert_eq!(line("step", 50, 50, Some(100), ten, ""), "step 50/100, ? left");
        assert_eq!(line("file", 7, 0, None, ten, "reading"), "file 7, reading");
    }

    #[test]
    fn durations_are_readable() {
        for (seconds, text) in
            [(0, "0 s"), (119, "119 s"), (125, "2 min"), (7100, "118 min"), (11100, "3 h 05 min")]
        {
            assert_eq!(duration(Duration::from_secs(seconds)), text);
        }
    }
}
