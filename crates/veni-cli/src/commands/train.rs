//! `veni-cli train`: a model from a folder of panoramas.

mod config;
mod folder;
mod resume;
mod watch;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use serde_json::json;
use veni_data::Fold;
use veni_light::model::ModelKind;
use veni_core::train::config::{DeviceKind, Devices, TrainConfig};
use veni_core::train::init::Initialised;
use veni_core::train::presets::Preset;
use veni_core::train::run::{Finish, Trainer};

use crate::commands::inspect::run::{self, Best};
use crate::loading::Loading;
use crate::output::with_remedy;
use crate::progress::duration;
use crate::report::{Outcome, Report, to_stderr};
use watch::Watch;

/// Train a model on HDR panoramas
#[derive(Args, Debug)]
#[command(
    long_about = "Train a model on HDR panoramas.\n\n\
        DIR holds equirectangular OpenEXR or Radiance files. If it has the folders train/ and val/, they are used \
        as such; otherwise a tenth of the files, chosen by seed, validates. RUN receives config.toml (everything \
        that defines the run), metrics.jsonl (one line per step and validation), preview/*.png (target | \
        reconstruction | random sample), checkpoint/ and model.safetensors, the weights that validated best; with \
        --system reni++ also latents.safetensors, the latents of the training panoramas.\n\n\
        --pretrain makes a run of two stages; config.toml may describe others ([[stage]], see docs/MODEL.md): each has \
        updates, panoramas, learning rates, losses and augmentation of its own, and all are validated on the \
        panoramas of --data.\n\n\
        More panoramas than --set data.memory_mib=4096 holds are kept in a file without a name beside RUN, or in the \
        folder of --set data.scratch=DIR, and read from there; both may be given anew with --resume.\n\n\
        Ctrl-C writes a checkpoint and ends; a second one ends at once. A run that was stopped or killed continues \
        with --resume from its last checkpoint as if nothing had happened, to the bit on the same machine.",
    after_help = "Examples:\n  \
        veni-cli train --data assets/panoramas --preset tiny --out runs/try\n  \
        veni-cli train --data hdri --preset small --latent-vectors 9 --seed 1 --out runs/small\n  \
        veni-cli train --data hdri --system reni++ --preset small --out runs/reni\n  \
        veni-cli train --resume --out runs/small\n  \
        veni-cli train --data hdri --pretrain skies ldr --pretrain-steps 20000 --out runs/two\n  \
        veni-cli train --data hdri --pretrain-synthetic 5000 --out runs/three\n  \
        veni-cli train --data indoor --init runs/small --steps 3000 --out runs/indoor\n  \
        veni-cli train --data hdri --synthetic 10000 --out runs/more   beside 10,000 generated scenes\n  \
        veni-cli train --data hdri --preset paper --device cuda --devices 0,1,2,3 --set batch=16 --out runs/cards\n  \
        veni-cli train --data hdri --out runs/kld --set loss.kld=0.001 --set batch=8\n  \
        veni-cli train --config runs/small/config.toml --seed 2 --out runs/second"
)]
pub(crate) struct Train {
    /// Folders of panoramas (or files)
    #[arg(long, value_name = "DIR", num_args = 1..,
        required_unless_present_any = ["resume", "config", "synthetic"])]
    data: Vec<PathBuf>,

    /// Also train on N generated scenes, as 'veni-cli synth' makes them, drawn with the run's seed; how often one is
    /// drawn follows from the numbers, or is set by --set data.synthetic_share=0.5
    #[arg(long, value_name = "N")]
    synthetic: Option<usize>,

    /// Cross-validation: hold back the I-th of N parts of the panoramas, and validate by it instead of by val/;
    /// 'veni-cli evaluate --fold I/N' reports on it
    #[arg(long, value_name = "I/N")]
    fold: Option<Fold>,

    /// Folder of the run
    #[arg(long, short, value_name = "RUN")]
    out: PathBuf,

    /// Begin with the weights of this model (or run) instead of random ones; a model without encoder, or --system
    /// reni++, takes the decoder alone
    #[arg(long, value_name = "MODEL")]
    init: Option<PathBuf>,

    /// Train on other panoramas first (synthetic skies, expanded photographs), then on those of --data with a tenth of
    /// the learning rates (--set stage.finetune.encoder.learning_rate.rate=1e-3, and likewise decoder, for others)
    #[arg(long, value_name = "DIR", num_args = 1.., conflicts_with = "config")]
    pretrain: Vec<PathBuf>,

    /// The same with N generated scenes, alone or beside the panoramas of --pretrain
    #[arg(long, value_name = "N", conflicts_with = "config")]
    pretrain_synthetic: Option<usize>,

    /// Number of updates of --pretrain and --pretrain-synthetic [default: as many as follow]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pretrain_steps: Option<u64>,

    /// What is trained [default: veni]
    #[arg(long, value_enum, conflicts_with = "config")]
    system: Option<SystemName>,

    /// Starting point for all settings [default: small]
    #[arg(long, value_enum, conflicts_with = "config")]
    preset: Option<PresetName>,

    /// Number N of latent vectors; the article's D is 3N [default: 9]
    #[arg(long, short = 'n', value_name = "N", conflicts_with = "config")]
    latent_vectors: Option<usize>,

    /// Seed of everything random [default: the preset's]
    #[arg(long, short, value_name = "S")]
    seed: Option<u64>,

    /// Number of updates; learning rates fall accordingly [default: the preset's]
    #[arg(long, value_name = "N")]
    steps: Option<u64>,

    /// Settings from a file, such as another run's config.toml, instead of a preset
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,

    /// Change one setting by its name in config.toml; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,

    /// What computes [default: flex, or what the file of --config says]
    #[arg(long, value_enum)]
    device: Option<TrainDevice>,

    /// Which devices of that kind, counted from 0: each computes a part of every batch [default: the first; on a
    /// processor as many shares of its threads as divide a batch evenly]
    #[arg(long, value_name = "I,J,…")]
    devices: Option<Devices>,

    /// Multiply the decoder's matrices in bfloat16, sums and all else in f32 (decoder_by = kernels-bfloat16): faster on
    /// processors with AVX512-BF16, an error on others
    #[arg(long)]
    mixed_precision: bool,

    /// Continue the run in RUN; other settings, if given, must be its own, but for --set data.scratch and
    /// data.memory_mib, which change no result
    #[arg(long, conflicts_with = "force")]
    resume: bool,

    /// Begin anew in place of the run in RUN, once the data is known to be good
    #[arg(long, short)]
    force: bool,
}

/// The systems by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum SystemName {
    /// The auto-encoder of the article
    #[default]
    Veni,
    /// The auto-decoder that it is compared with: no encoder, a latent for each training panorama
    #[value(name = "reni++")]
    Reni,
}

/// The presets by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PresetName {
    /// Trains in seconds and is good for nothing but tests
    Tiny,
    /// As good as an hour or two on two CPU cores can buy
    Small,
    /// The article's sizes, for a graphics card
    Paper,
}

impl From<PresetName> for Preset {
    fn from(name: PresetName) -> Self {
        match name {
            PresetName::Tiny => Self::Tiny,
            PresetName::Small => Self::Small,
            PresetName::Paper => Self::Paper,
        }
    }
}

/// The devices by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TrainDevice {
    /// The fastest of this build and machine: cuda, then wgpu on a graphics card, then flex
    Auto,
    /// All CPU cores, through burn's flex backend
    Flex,
    /// All CPU cores, through burn's ndarray backend (feature ndarray)
    Ndarray,
    /// A graphics device by Vulkan, Metal or DirectX 12 (feature wgpu)
    Wgpu,
    /// An NVIDIA card by CUDA (feature cuda)
    Cuda,
}

impl From<TrainDevice> for DeviceKind {
    fn from(device: TrainDevice) -> Self {
        match device {
            TrainDevice::Auto => Self::fastest(),
            TrainDevice::Flex => Self::Flex,
            TrainDevice::Ndarray => Self::Ndarray,
            TrainDevice::Wgpu => Self::Wgpu,
            TrainDevice::Cuda => Self::Cuda,
        }
    }
}

impl Train {
    pub(crate) fn run(self, report: Report) -> Result<Outcome> {
        crate::allocator::keep_memory();
        let started = Instant::now();
        let mut trainer = if self.resume { self.continued(report)? } else { self.begun(report)? };
        note_device(trainer.config(), report)?;
        note_file(&trainer, report);
        if trainer.initialised() == Some(Initialised::Decoder) {
            let model = trainer.config().init.as_ref().map(|init| init.model.display().to_string());
            report.note(format_args!(
                "{}: only its decoder is taken; {}",
                model.unwrap_or_default(),
                match trainer.config().model.kind {
                    ModelKind::Veni => "it has no encoder, so that the run's starts from random weights",
                    ModelKind::Reni =>
                        "an auto-decoder has no encoder, and its latents start from random numbers",
                }
            ));
        }
        let stop = stop_on_signal()?;
        let mut watch = Watch::new(report);
        let finish = trainer.run(&stop, &mut watch).map_err(with_remedy)?;
        watch.finish();
        let (done, total) = (trainer.steps_done(), trainer.config().steps);
        let best = run::best(&self.out)?;
        self.report(report, finish, [done, total], best.as_ref(), started)?;
        if finish == Finish::Complete {
            return Ok(Outcome::Fine);
        }
        let out = shell_word(&self.out);
        report.note(format_args!(
            "stopped after step {done} of {total}; to go on: veni-cli train --resume --out {out}"
        ));
        Ok(Outcome::Negative)
    }

    /// A new run.
    fn begun(&self, report: Report) -> Result<Trainer> {
        let config = self.settings()?;
        let replace = self.check_folder()?;
        let loading = Loading::new(report);
        let trainer =
            Trainer::prepare(&self.out, config, &self.command_line(), &|done, all| loading.set(done, all));
        loading.finish();
        let trainer = trainer.map_err(with_remedy)?;
        if replace {
            // what is there goes only now, when the new data is known to be good
            self.clear()?;
        }
        trainer.begin().map_err(with_remedy)?;
        Ok(trainer)
    }

    /// A run that exists.
    fn continued(&self, report: Report) -> Result<Trainer> {
        let stored = self.out.join("config.toml");
        if !stored.is_file() {
            bail!(
                "{}: no run to continue (it has no config.toml); leave --resume out to begin one",
                self.out.display()
            );
        }
        self.check_same(&stored)?;
        let holding = self.holding(&stored)?;
        let loading = Loading::new(report);
        let trainer = Trainer::resume_heard(&self.out, &self.command_line(), &holding, &|done, all| {
            loading.set(done, all);
        });
        loading.finish();
        Ok(trainer?)
    }

    fn report(
        &self,
        report: Report,
        finish: Finish,
        [done, total]: [u64; 2],
        best: Option<&Best>,
        started: Instant,
    ) -> Result<()> {
        let model = self.out.join("model.safetensors");
        let time = duration(started.elapsed());
        let valued = best.map_or_else(
            || "no validation yet".to_owned(),
            |b| format!("best validation LDR PSNR {:.2} dB at step {}", b.ldr_psnr, b.step),
        );
        let steps = if finish == Finish::Complete {
            format!("{total} steps")
        } else {
            format!("{done} of {total} steps")
        };
        let human = format!("{}: {steps} ({time}), {valued}", self.out.display());
        let value = json!({
            "run": self.out.display().to_string(),
            "finished": finish == Finish::Complete,
            "steps_done": done,
            "steps": total,
            "best": best.map(|b| json!({ "step": b.step, "ldr_psnr": b.ldr_psnr })),
            "model": model.is_file().then(|| model.display().to_string()),
            "seconds": started.elapsed().as_secs_f64(),
        });
        report.result(human, &value)
    }
}

/// How much of the data is not in memory, and how to change that.
fn note_file(trainer: &Trainer, report: Report) {
    let mib = trainer.mapped_bytes().div_ceil(1 << 20);
    if mib > 0 {
        let data = &trainer.config().data;
        let folder =
            data.scratch.as_ref().map_or("beside the run".to_owned(), |s| format!("in {}", s.display()));
        report.note(format_args!(
            "{mib} MiB of resampled panoramas are in a file without a name {folder}: a set may take data.memory_mib = {} in \
             memory, and data.scratch names the folder",
            data.memory_mib
        ));
    }
}

/// What the graphics devices are, and what about them will be slow.
fn note_device(config: &TrainConfig, report: Report) -> Result<()> {
    let kind = config.device;
    if kind.is_processor() {
        return Ok(());
    }
    for opened in kind.open_all(&config.devices)? {
        report.note(format_args!("training on {}", opened.name));
        if opened.software {
            report.note(format_args!("{} is a software adapter; --device flex is faster", opened.name));
        }
    }
    if config.decoder_by.is_kernels() {
        report.note("decoder_by = kernels: the decoder is computed by the processor, not on the device");
    }
    Ok(())
}

/// Raised by the first Ctrl-C (or a request to terminate); the second one ends the process.
fn stop_on_signal() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        to_stderr("stopping after this step and writing a checkpoint (again: end at once)\n");
    })
    .context("cannot watch for Ctrl-C")?;
    Ok(stop)
}

/// Quoted if a shell would split it.
fn shell_word(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+,=@%".contains(c);
    if text.chars().all(plain) { text } else { format!("'{}'", text.replace('\'', r"'\''")) }
}
