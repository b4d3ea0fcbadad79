//! What can be typed.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use veni_core::train::config::{DeviceKind, Devices};
use veni_core::train::presets::Preset;
use veni_data::Fold;

use crate::part::fold;

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
        folder of --set data.scratch=DIR, and read from there; both may be given again with --resume.\n\n\
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
    pub(super) data: Vec<PathBuf>,

    /// Also train on N generated scenes, as 'veni-cli synth' makes them, drawn with the run's seed; how often one is
    /// drawn follows from the numbers, or is set by --set data.synthetic_share=0.5
    #[arg(long, value_name = "N")]
    pub(super) synthetic: Option<usize>,

    /// Layer of EXR files that have several [default: the one without a name, or called like a picture: Combined, beauty, C]
    #[arg(long, value_name = "NAME")]
    pub(super) layer: Option<String>,

    /// Cross-validation: hold back the I-th of N parts of the panoramas, and validate by it instead of by val/;
    /// 'veni-cli evaluate --fold I/N' reports on it
    #[arg(long, value_name = "I/N", value_parser = fold)]
    pub(super) fold: Option<Fold>,

    /// Folder of the run
    #[arg(long, short, value_name = "RUN")]
    pub(super) out: PathBuf,

    /// Initialise with the weights of this model (or run) instead of random ones; a model without encoder, or --system
    /// reni++, takes the decoder alone
    #[arg(long, value_name = "MODEL")]
    pub(super) init: Option<PathBuf>,

    /// Train on other panoramas first (synthetic skies, expanded photographs), then on those of --data with a tenth of
    /// the learning rates (--set stage.finetune.encoder.learning_rate.rate=1e-3, and likewise decoder, for others)
    #[arg(long, value_name = "DIR", num_args = 1.., conflicts_with = "config")]
    pub(super) pretrain: Vec<PathBuf>,

    /// The same with N generated scenes, alone or beside the panoramas of --pretrain
    #[arg(long, value_name = "N", conflicts_with = "config")]
    pub(super) pretrain_synthetic: Option<usize>,

    /// Number of updates of --pretrain and --pretrain-synthetic [default: as many as follow]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(super) pretrain_steps: Option<u64>,

    /// What is trained [default: veni]
    #[arg(long, value_enum, conflicts_with = "config")]
    pub(super) system: Option<SystemName>,

    /// Starting point for all settings [default: small]
    #[arg(long, value_enum, conflicts_with = "config")]
    pub(super) preset: Option<PresetName>,

    /// Number N of latent vectors; the latent dimension D is 3N [default: 9]
    #[arg(long, short = 'n', value_name = "N", conflicts_with = "config")]
    pub(super) latent_vectors: Option<usize>,

    /// Seed of everything random [default: the preset's]
    #[arg(long, short, value_name = "S")]
    pub(super) seed: Option<u64>,

    /// Number of updates; learning rates fall accordingly [default: the preset's]
    #[arg(long, value_name = "N")]
    pub(super) steps: Option<u64>,

    /// Settings from a file, such as another run's config.toml, instead of a preset
    #[arg(long, value_name = "FILE")]
    pub(super) config: Option<PathBuf>,

    /// Change one setting by its name in config.toml; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    pub(super) set: Vec<String>,

    /// What computes [default: flex, or what the file of --config says]
    #[arg(long, value_enum)]
    pub(super) device: Option<TrainDevice>,

    /// Which devices of that kind, counted from 0: each computes a part of every batch [default: the first; on a
    /// processor as many shares of its threads as divide a batch evenly]
    #[arg(long, value_name = "I,J,…")]
    pub(super) devices: Option<Devices>,

    /// Multiply the decoder's matrices in bfloat16, sums and all else in f32 (decoder_backend = kernels-bfloat16): faster on
    /// processors with AVX512-BF16, an error on others
    #[arg(long)]
    pub(super) mixed_precision: bool,

    /// Continue the run in RUN; other settings, if given, must be its own, but for --set data.scratch and
    /// data.memory_mib, which change no result
    #[arg(long, conflicts_with = "force")]
    pub(super) resume: bool,

    /// Start over in place of the run in RUN, once the data is known to be good
    #[arg(long, short)]
    pub(super) force: bool,
}

/// The systems by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum SystemName {
    /// The auto-encoder of the paper
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
    /// The paper's sizes, for a graphics card
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
