//! What a person sees of a run while it goes.

use std::sync::Mutex;

use veni_core::data::Generated;
use veni_core::eval::reconstruction::MeanScores;
use veni_core::train::progress::{self, StepReport, ValidationReport};

use crate::progress::Progress;
use crate::report::Report;

/// Shows a run's reports on stderr.
pub(super) struct Watch {
    report: Report,
    bar: Option<Progress>,
}

impl Watch {
    pub(super) fn new(report: Report) -> Self {
        Self { report, bar: None }
    }

    /// Takes the bar away.
    pub(super) fn finish(self) {
        if let Some(bar) = self.bar {
            bar.finish();
        }
    }
}

/// Shows how many scenes are generated while `open` opens a run.
pub(super) fn generating<T>(report: Report, open: impl FnOnce(&Generated<'_>) -> T) -> T {
    let bar = Mutex::new(None);
    let opened = open(&|done, total| {
        if let Ok(mut bar) = bar.lock() {
            let start = || Progress::start(report, "generated sky", 0, total as u64);
            bar.get_or_insert_with(start).set(done as u64, String::new);
        }
    });
    if let Ok(Some(bar)) = bar.into_inner() {
        bar.finish();
    }
    opened
}

impl progress::Progress for Watch {
    fn start(&mut self, done: u64, total: u64) {
        self.bar = Some(Progress::start(self.report, "step", done, total));
    }

    fn step(&mut self, step: &StepReport, _remaining: f64) {
        if let Some(bar) = &mut self.bar {
            bar.set(step.step, || {
                let parts: Vec<_> =
                    step.parts.iter().map(|(name, value)| format!("{name} {value:.4}")).collect();
                format!("loss {:.4} ({})", step.loss, parts.join(", "))
            });
        }
    }

    fn validation(&mut self, report: &ValidationReport) {
        let Some(bar) = &self.bar else { return };
        let psnr = |name, scores: &Option<_>| {
            scores.as_ref().map(|s: &MeanScores| format!("{name} {:.2} dB", s.ldr_psnr))
        };
        let scores: Vec<_> =
            [psnr("val", &report.val), psnr("train", &report.train)].into_iter().flatten().collect();
        if !scores.is_empty() {
            let best = if report.best { " (best so far)" } else { "" };
            bar.note(&format!("step {}: LDR PSNR {}{best}", report.step, scores.join(", ")));
        }
    }
}
