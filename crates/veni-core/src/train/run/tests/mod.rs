//! Whole runs of the tiny preset on synthetic skies.

use std::fs;

mod gradients;
mod large;
mod learning;
mod resuming;
mod stages;

use super::*;
use crate::train::config::{DecoderBackend, DeviceKind, Devices};
use crate::train::loss::LossForm;
use crate::train::presets::Preset;
use std::panic::{AssertUnwindSafe, catch_unwind};
use veni_fit::schedule::{LearningRate, WeightSchedule};
use veni_image::{Panorama, Precision, WriteFormat, WriteOptions};
use veni_light::latent::Latent;
use veni_light::model::Model;
use veni_light::progress::Observer;
use veni_light::random::{Purpose, stream};
use veni_light::sphere::Equirect;

/// A sky with a sun at `azimuth` over dark ground.
fn sky(azimuth: f32) -> Panorama {
    let sun = [azimuth.cos() * 0.8, azimuth.sin() * 0.8, 0.6];
    Panorama::from_fn(Equirect::new(32, 16), |d| {
        let toward = d.iter().zip(sun).map(|(a, b)| a * b).sum::<f32>();
        let base = if d[2] > 0.0 { [0.4, 0.6, 1.0] } else { [0.12, 0.1, 0.08] };
        base.map(|v| v + 20.0 * (12.0 * (toward - 1.0)).exp())
    })
}

/// A folder with `train/` (two skies) and `val/` (one), and a short run of the auto-encoder on it.
fn setup(steps: u64) -> (tempfile::TempDir, TrainConfig) {
    setup_of(Preset::Tiny.config(3), steps)
}

fn setup_of(config: TrainConfig, steps: u64) -> (tempfile::TempDir, TrainConfig) {
    let folder = tempfile::tempdir().unwrap();
    for (name, azimuth) in [("train/a", 0.3), ("train/b", 2.0), ("val/c", 4.0)] {
        let path = folder.path().join("data").join(name).with_extension("exr");
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        sky(azimuth).write(&path, &WriteOptions::new(WriteFormat::Exr(Precision::Float))).unwrap();
    }
    let mut config = config.with_overrides(&[format!("steps={steps}")]).unwrap();
    config.data.folders = vec![folder.path().join("data")];
    (folder, config)
}

/// Raises the stop flag, or panics, after an update.
struct After<'a> {
    step: u64,
    stop: &'a AtomicBool,
    panic: bool,
}

impl Observer for After<'_> {
    fn begin(&self, _: &'static str, _: &str, _: usize, _: usize) {}

    fn advance(&self, _: usize) {}
}

impl Progress for After<'_> {
    fn step(&self, report: &StepReport, _remaining: f64) {
        if report.step == self.step {
            assert!(!self.panic, "killed");
            self.stop.store(true, Ordering::Relaxed);
        }
    }
}

fn complete(trainer: &mut Trainer) {
    let finish = trainer.run(&AtomicBool::new(false), &crate::train::progress::Silent).unwrap();
    assert_eq!(finish, Finish::Complete);
}

fn file(folder: &Path, name: &str) -> Vec<u8> {
    fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Loss and step of every line, without wall-clock times.
fn losses(folder: &Path) -> Vec<(u64, Option<f64>)> {
    let text = String::from_utf8(file(folder, "metrics.jsonl")).unwrap();
    let record = |line: &str| serde_json::from_str::<serde_json::Value>(line).unwrap();
    text.lines().map(record).map(|r| (r["step"].as_u64().unwrap(), r["loss"].as_f64())).collect()
}
