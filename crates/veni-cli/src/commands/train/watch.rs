//! What a person sees of a run while it goes.

use veni_image::metrics::MeanScores;
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

impl progress::Progress for Watch {
    fn start(&mut self, done: u64, total: u64) {
        self.bar = Some(Progress::start(self.report, "step", done, total));
    }

    fn step(&mut self, step: &StepReport, _remaining: f64) {
        if let Some(bar) = &mut self.bar {
            bar.set(step.step, || {
                let parts: Vec<_> =
                    step.parts.iter().map(|(name, value)| format!("{name} {value:.4}")).collect();
                let stage = step.stage.as_ref().map(|stage| format!("{stage}, ")).unwrap_or_default();
                format!("{stage}loss {:.4} ({})", step.loss, parts.join(", "))
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
