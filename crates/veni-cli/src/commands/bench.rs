//! `veni-cli bench`: how fast the devices of this machine bake.

mod cases;
mod cpu;
#[cfg(feature = "gpu")]
mod gpu;
mod measure;
mod subject;
mod table;

use anyhow::{Context, Result};
use clap::Args;
use veni_light::sphere::Equirect;

use crate::args::ModelArgs;
use crate::features::{GPU, only};
use crate::report::{self, Outcome, Report};
use crate::size::Size;
use cases::Case;
use measure::Stopwatch;
use subject::Subject;
use table::{Row, Table};

#[cfg_attr(
    feature = "gpu",
    doc = "Measure how fast this machine bakes, on the CPU and on every graphics device"
)]
#[cfg_attr(not(feature = "gpu"), doc = "Measure how fast this machine bakes")]
#[derive(Args, Debug)]
#[command(
    long_about = format!("Measure how fast this machine bakes{}.\n\n\
        Each line is one device, model and size: the time of one panorama in milliseconds (the best of several, \
        within about a second), millions of directions per second, GFLOP/s (10^9 floating-point operations per \
        second), and the share of the rate of f32 multiply-adds (FMA) that the same device was measured to do at \
        most. Only the decoder's own multiply-adds count, two operations each.\n\n\
        Only decoding is timed: no files{}. Close other programs first. A size that would take longer than ten \
        seconds is skipped{}.",
        only(GPU, ", on the CPU and on every graphics device"),
        only(GPU, ", and on graphics devices no transfer of the pixels back"),
        only(GPU, ", which software devices make likely")),
    after_help = "Examples:\n  \
        veni-cli bench\n  \
        veni-cli bench --sizes 1024x512 --latent-vectors 9,49,100\n  \
        veni-cli bench --json | jq 'select(.width == 1024) | [.device, .milliseconds]'"
)]
pub(crate) struct Bench {
    #[command(flatten)]
    model: ModelArgs,

    /// Also decoders with N latent vectors, of the paper's size and with weights made by formula
    #[arg(long, value_name = "N", value_delimiter = ',', num_args = 1.., default_value = "9,100")]
    latent_vectors: Vec<usize>,

    /// Sizes of the panoramas, width x height
    #[arg(long, value_name = "WxH", value_delimiter = ',', num_args = 1..,
        default_value = "128x64,1024x512,2048x1024,4096x2048")]
    sizes: Vec<Size>,

    /// Also what takes longer than ten seconds, measured once
    #[arg(long)]
    all: bool,
}

impl Bench {
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        let mut grids = Vec::new();
        for size in &self.sizes {
            let (width, height) = size.equirect()?;
            grids.push(Equirect::new(width, height));
        }
        // how long a size takes is foreseen from the next smaller one
        grids.sort_by_key(|grid| grid.len());
        grids.dedup();
        let cases = cases::all(&self.model, &self.latent_vectors, report)?;
        let mut subjects = subjects(report);
        let table = Table::new(subjects.iter().map(|s| s.name()), &cases);
        table.head(report)?;
        // one device must not hide the others
        report::each(&mut subjects, |subject| {
            let measured = self.measure(subject.as_mut(), &cases, &grids, &table, report);
            measured.with_context(|| subject.name().to_owned())
        })
    }

    fn measure(
        &self,
        subject: &mut dyn Subject,
        cases: &[Case],
        grids: &[Equirect],
        table: &Table,
        report: Report,
    ) -> Result<()> {
        let mut rate = 0f64;
        for case in cases {
            // again for each: a moment in which other programs are busy must not make all shares too large
            rate = rate.max(subject.multiply_add_rate()?);
            let mut bakes = subject.load(case)?;
            let mut stopwatch = Stopwatch::start(bakes.as_mut(), self.all)?;
            for grid in grids {
                let measured = stopwatch.measure(bakes.as_mut(), *grid)?;
                let row = Row { device: subject.name(), rate, case, grid: *grid, measured };
                table.row(&row, report)?;
            }
        }
        Ok(())
    }
}

/// The CPU and all graphics devices.
#[cfg(feature = "gpu")]
fn subjects(report: Report) -> Vec<Box<dyn Subject>> {
    let adapters = crate::device::gpu::list();
    if adapters.is_empty() {
        report.note(format_args!("note: {}; measuring the CPU only", crate::device::gpu::NO_ADAPTER));
    }
    let mut all: Vec<Box<dyn Subject>> = vec![Box::new(cpu::Cpu)];
    for found in adapters {
        all.push(Box::new(gpu::Gpu::new(found)));
    }
    all
}

/// The CPU.
#[cfg(not(feature = "gpu"))]
fn subjects(report: Report) -> Vec<Box<dyn Subject>> {
    report.note(format_args!("note: {}; measuring the CPU only", crate::device::NO_GPU));
    vec![Box::new(cpu::Cpu)]
}
