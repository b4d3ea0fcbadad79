//! Progress as the libraries report it.

#[cfg(feature = "learn")]
use veni_core::train::progress::{Progress, StepReport, ValidationReport};
#[cfg(feature = "learn")]
use veni_image::metrics::Scores;
use veni_light::progress::Observer;

use super::ProgressBars;

impl Observer for ProgressBars {
    fn begin(&self, unit: &'static str, task: &str, done: usize, total: usize) {
        self.end();
        if done > 0 {
            self.note(&format!("{task}: {done} of {total} {unit}s kept from an earlier run"));
        }
        if done < total {
            self.begin_after(done as u64, task, unit, Some(total as u64));
        }
    }

    fn advance(&self, units: usize) {
        self.add(units as u64);
    }

    fn note(&self, sentence: &str) {
        Self::note(self, sentence);
    }
}

#[cfg(feature = "learn")]
impl Progress for ProgressBars {
    fn step(&self, step: &StepReport, _remaining: f64) {
        crate::interrupt::heard();
        let parts: Vec<_> = step.parts.iter().map(|(name, value)| format!("{name} {value:.4}")).collect();
        let stage = step.stage.as_ref().map(|stage| format!("{stage}, ")).unwrap_or_default();
        self.describe(format!("{stage}loss {:.4} ({})", step.loss, parts.join(", ")));
    }

    fn validation(&self, report: &ValidationReport) {
        crate::interrupt::heard();
        let psnr = |name, scores: &Option<_>| {
            scores.as_ref().map(|s: &Scores| format!("{name} {:.2} dB", s.ldr_psnr))
        };
        let scores: Vec<_> =
            [psnr("val", &report.val), psnr("train", &report.train)].into_iter().flatten().collect();
        if !scores.is_empty() {
            let best = if report.best { " (best so far)" } else { "" };
            self.note(&format!("step {}: LDR PSNR {}{best}", report.step, scores.join(", ")));
        }
    }
}
