//! What was measured, as lines of a table or of JSON.

use anyhow::Result;
use serde_json::{Value, json};
use veni_light::sphere::Equirect;

use super::cases::Case;
use super::measure::Measured;
use crate::report::{Report, lines_to_stdout};

/// Widths of the columns that depend on what is measured.
pub(super) struct Table {
    device: usize,
    model: usize,
}

/// One measurement.
pub(super) struct Row<'a> {
    pub(super) device: &'a str,
    /// The device's multiply-adds, floating-point operations per second.
    pub(super) rate: f64,
    pub(super) case: &'a Case,
    pub(super) grid: Equirect,
    pub(super) measured: Measured,
}

impl Table {
    pub(super) fn new<'a>(devices: impl Iterator<Item = &'a str>, cases: &[Case]) -> Self {
        let width = |names: &mut dyn Iterator<Item = &str>, title: &str| {
            names.map(|name| name.chars().count()).chain([title.len()]).max().unwrap_or(0)
        };
        Self {
            device: width(&mut devices.into_iter(), "device"),
            model: width(&mut cases.iter().map(|case| case.name.as_str()), "model"),
        }
    }

    /// The titles; JSON needs none.
    pub(super) fn head(&self, report: Report) -> Result<()> {
        if report.is_json() {
            return Ok(());
        }
        let start = self.start("device", "model", "N", "size");
        let line =
            format!("{start}{:>12}{:>16}{:>11}{:>16}\n", "ms", "Mdirections/s", "GFLOP/s", "of its FMA rate");
        lines_to_stdout(&line)
    }

    pub(super) fn row(&self, row: &Row<'_>, report: Report) -> Result<()> {
        report.result(self.line(row), &row.json())
    }

    fn line(&self, row: &Row<'_>) -> String {
        let Equirect { width, height } = row.grid;
        let n = row.case.model.latent_vectors().to_string();
        let start = self.start(row.device, &row.case.name, &n, &format!("{width}x{height}"));
        match row.speed() {
            Ok(Speed { milliseconds, mdirections, gflops, percent }) => {
                let most = row.rate / 1e9;
                format!(
                    "{start}{milliseconds:12.3}{mdirections:16.3}{gflops:11.1}{percent:6.1} % of {most:.1}"
                )
            }
            Err(seconds) => format!("{start}  skipped: would take about {seconds:.0} s (--all takes them)"),
        }
    }

    /// The columns that say what was measured.
    fn start(&self, device: &str, model: &str, n: &str, size: &str) -> String {
        let Self { device: d, model: m } = self;
        format!("{device:d$}  {model:m$}{n:>5}{size:>13}")
    }
}

/// The numbers of a measurement.
struct Speed {
    milliseconds: f64,
    /// Millions of directions per second.
    mdirections: f64,
    gflops: f64,
    /// Of the device's rate of multiply-adds.
    percent: f64,
}

impl Row<'_> {
    /// The numbers, or the seconds that were too many.
    fn speed(&self) -> Result<Speed, f64> {
        match self.measured {
            Measured::Took(time) => {
                let rate = self.grid.len() as f64 / time.as_secs_f64();
                let flops = rate * self.case.operations();
                Ok(Speed {
                    milliseconds: 1e3 * time.as_secs_f64(),
                    mdirections: rate / 1e6,
                    gflops: flops / 1e9,
                    percent: 100.0 * flops / self.rate,
                })
            }
            Measured::WouldTake(time) => Err(time.as_secs_f64()),
        }
    }

    fn json(&self) -> Value {
        let mut value = json!({
            "device": self.device,
            "multiply_add_gflops": self.rate / 1e9,
            "model": self.case.name,
            "latent_vectors": self.case.model.latent_vectors(),
            "width": self.grid.width,
            "height": self.grid.height,
        });
        match self.speed() {
            Ok(speed) => {
                value["milliseconds"] = speed.milliseconds.into();
                value["mdirections_per_second"] = speed.mdirections.into();
                value["gflops"] = speed.gflops.into();
                value["percent"] = speed.percent.into();
            }
            Err(seconds) => value["would_take_seconds"] = seconds.into(),
        }
        value
    }
}
