//! What a training run reports to its observer, beside how far it has come. The library prints nothing.

use std::collections::BTreeMap;

use serde::Serialize;

use veni_image::metrics::Scores;
use veni_light::progress::Observer;

/// One update, as written to `metrics.jsonl` and shown to the user.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StepReport {
    /// Number of the update, from 1.
    pub step: u64,
    /// The stage that it belongs to; absent in a run without stages.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stage: Option<String>,
    /// Weighted sum of the losses.
    pub loss: f64,
    /// Each loss part, times its weight.
    pub parts: BTreeMap<&'static str, f64>,
    /// Learning rate of each group.
    pub learning_rate: BTreeMap<&'static str, f64>,
    /// Gradient norm of each group before clipping.
    pub gradient_norm: BTreeMap<&'static str, f64>,
    /// Wall-clock seconds of this update.
    pub seconds: f64,
    /// Panoramas per second in this update.
    pub images_per_second: f64,
}

/// A validation with the averaged weights.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ValidationReport {
    /// After how many updates.
    pub step: u64,
    /// Mean over the validation panoramas, auto-encoder pass; absent without any.
    pub val: Option<Scores>,
    /// Mean over the validated training panoramas.
    pub train: Option<Scores>,
    /// Whether this became `model.safetensors`.
    pub best: bool,
}

/// An observer of a run, whose updates it counts as units of one task, and who is told what came of them. Every method of its own
/// does nothing unless it is written.
pub trait Progress: Observer {
    /// An update has been made, which [`Observer::advance`] counts next; `remaining` is the estimated time to the last one, in seconds.
    fn step(&self, report: &StepReport, remaining: f64) {
        let _ = (report, remaining);
    }

    /// A validation has been made.
    fn validation(&self, report: &ValidationReport) {
        let _ = report;
    }

    /// A file of the run was written.
    fn wrote(&self, path: &std::path::Path) {
        let _ = path;
    }
}

pub use veni_light::progress::Silent;

impl Progress for Silent {}
