//! The arguments that several commands share.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use veni_image::ReadOptions;

/// Which model decodes (and encodes).
#[derive(Args, Debug)]
pub(crate) struct ModelArgs {
    /// Model file (.safetensors, or a training run's folder), or the size D of the codes of one inside this program: 27 (9
    /// vectors; lights are 7 numbers each), 147 and 300 (the same with 16 and 38 lobes for the detail of a panorama); vectors-147
    /// and vectors-300 have 49 and 100 vectors instead [default: the one inside that a latent names, or 27]
    #[arg(long, short, value_name = "FILE|SIZE")]
    pub(crate) model: Option<PathBuf>,
}

/// Model and device of what is baked.
#[derive(Args, Debug)]
pub(crate) struct Decoding {
    #[command(flatten)]
    pub(crate) model: ModelArgs,

    /// What decodes
    #[arg(long, value_enum, default_value_t)]
    pub(crate) device: DecodeDevice,
}

/// Which layer of an EXR file is the picture.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct Layer {
    /// Layer of EXR files that have several [default: the one without a name, or called like a picture: Combined, beauty, C]
    #[arg(long, value_name = "NAME")]
    pub(crate) layer: Option<String>,
}

impl Layer {
    /// What is read of a panorama.
    pub(crate) fn options(&self) -> ReadOptions {
        ReadOptions { layer: self.layer.clone(), ..ReadOptions::default() }
    }
}

/// Whether existing files may be replaced.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Force {
    /// Replace output files that exist
    #[arg(long, short)]
    pub(crate) force: bool,
}

impl From<Force> for veni_light::output::Overwrite {
    fn from(f: Force) -> Self {
        if f.force { Self::Replace } else { Self::Refuse }
    }
}

/// What decodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum DecodeDevice {
    #[cfg_attr(
        feature = "gpu",
        doc = "The graphics card if there is one, else the CPU; never a card emulated in software"
    )]
    #[cfg_attr(not(feature = "gpu"), doc = "The CPU: this build cannot use graphics devices")]
    #[default]
    Auto,
    /// All CPU cores
    Cpu,
    /// The first device that 'veni-cli inspect --devices' lists, a software one too
    #[cfg_attr(not(feature = "gpu"), value(hide = true))]
    Gpu,
}
