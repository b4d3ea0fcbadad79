//! What becomes of images with a display's range: `--expand` and its kin.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use veni_data::expand::ExpandOptions;
use veni_data::expand::network::{
    ExpansionNetwork, NetworkInput, NetworkOptions, NetworkOutput, NetworkScale,
};
use veni_data::prepare::Expander;
use veni_image::TransferFunction;
use veni_light::digest::Digest;
use veni_light::sphere::Equirect;

use super::network::NetworkSettings;
use super::record::Fate;
use super::store::Store;
use crate::report::Report;
use crate::size::Size;

/// Under which the options of a network stand in `--help`.
const NETWORK: &str = "Expansion by a network of your own";

#[derive(Args, Debug)]
pub(super) struct Expand {
    /// What becomes of images with a display's range
    #[arg(long, value_enum, default_value_t)]
    expand: Mode,

    /// They were encoded by this power instead of the sRGB curve
    #[arg(long, value_name = "G", value_parser = gamma)]
    gamma: Option<f32>,

    /// Rebuild what is clipped by this network (build with --features onnx)
    #[arg(long, value_name = "MODEL.onnx", help_heading = NETWORK)]
    expand_with: Option<PathBuf>,

    /// What it is given, in [0, 1]
    #[arg(long, value_enum, default_value_t, requires = "expand_with", help_heading = NETWORK)]
    expand_input: Input,

    /// What it gives
    #[arg(long, value_enum, default_value_t, requires = "expand_with", help_heading = NETWORK)]
    expand_output: Output,

    /// The unit of that
    #[arg(long, value_enum, default_value_t, requires = "expand_with", help_heading = NETWORK)]
    expand_scale: Scale,

    /// The size at which it sees them, if it takes any [default: the image's own, at most 1024x512]
    #[arg(long, value_name = "W|WxH", requires = "expand_with", help_heading = NETWORK)]
    expand_size: Option<Size>,
}

/// What becomes of LDR images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Mode {
    /// Rebuild what is clipped
    #[default]
    Auto,
    /// Refuse them
    Off,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Input {
    /// sRGB-coded values
    #[default]
    Srgb,
    /// Linear values
    Linear,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Output {
    /// Radiance
    #[default]
    Linear,
    /// Its natural logarithm
    Log,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Scale {
    /// White of the image is radiance 1
    #[default]
    White,
    /// Its own: matched where nothing is clipped
    Match,
}

impl Expand {
    /// What expands, and what is remembered of the network that does.
    pub(super) fn expander(&self) -> Result<(Option<Expander>, Option<NetworkSettings>)> {
        let transfer = self.gamma.map_or(TransferFunction::Srgb, TransferFunction::Gamma);
        match (self.expand, &self.expand_with) {
            (Mode::Off, Some(model)) => bail!(
                "--expand off refuses what --expand-with {} would expand: give one of the two",
                model.display()
            ),
            (Mode::Off, None) => Ok((None, None)),
            (Mode::Auto, None) => {
                Ok((Some(Expander::Fitted(ExpandOptions { transfer, ..ExpandOptions::default() })), None))
            }
            (Mode::Auto, Some(model)) => {
                let grid = match self.expand_size.map(Size::equirect).transpose() {
                    Ok(grid) => grid.map(|(width, height)| Equirect::new(width, height)),
                    // the message is about --size
                    Err(error) => bail!("{}", error.to_string().replace("--size", "--expand-size")),
                };
                let options = NetworkOptions {
                    transfer,
                    input: self.expand_input.into(),
                    output: self.expand_output.into(),
                    scale: self.expand_scale.into(),
                    grid,
                };
                let (network, sha256) = load(model)?;
                options.check(network.as_ref())?;
                let word = |value: Option<clap::builder::PossibleValue>| {
                    value.map(|v| v.get_name().to_owned()).unwrap_or_default()
                };
                let settings = NetworkSettings {
                    model: network.name().to_owned(),
                    sha256,
                    input: word(self.expand_input.to_possible_value()),
                    output: word(self.expand_output.to_possible_value()),
                    scale: word(self.expand_scale.to_possible_value()),
                    size: grid.map(|g| format!("{}x{}", g.width, g.height)),
                };
                Ok((Some(Expander::Network(network, options)), Some(settings)))
            }
        }
    }
}

/// The network and its file's digest.
#[cfg(feature = "onnx")]
fn load(model: &Path) -> Result<(Arc<dyn ExpansionNetwork>, Digest)> {
    let network = veni_data::expand::network::OnnxNetwork::load(model)?;
    let digest = network.digest();
    Ok((Arc::new(network), digest))
}

#[cfg(not(feature = "onnx"))]
fn load(model: &Path) -> Result<(Arc<dyn ExpansionNetwork>, Digest)> {
    bail!(
        "--expand-with {}: this veni-cli was built without an ONNX runtime; build it with --features onnx",
        model.display()
    )
}

/// Says so if the network seldom made anything brighter than it was stored: its options are wrong more likely than not.
pub(super) fn warn(store: &Store, network: Option<&NetworkSettings>, report: Report) {
    let Some(NetworkSettings { model, .. }) = network else { return };
    let below: Vec<f64> = (store.records().into_iter())
        .filter_map(|r| match &r.fate {
            Fate::Fit(facts) => Some(facts.expanded.as_ref()?.network.as_ref()?.below),
            Fate::Refused(_) => None,
        })
        .collect();
    let mean = below.iter().sum::<f64>() / below.len().max(1) as f64;
    if mean > 0.5 {
        report.note(format_args!(
            "{model} gave less than is stored for {:.0} % of the clipped values: are --expand-input, --expand-output and \
             --expand-scale what it was trained with?",
            100.0 * mean
        ));
    }
}

impl From<Input> for NetworkInput {
    fn from(input: Input) -> Self {
        match input {
            Input::Srgb => Self::Srgb,
            Input::Linear => Self::Linear,
        }
    }
}

impl From<Output> for NetworkOutput {
    fn from(output: Output) -> Self {
        match output {
            Output::Linear => Self::Linear,
            Output::Log => Self::Log,
        }
    }
}

impl From<Scale> for NetworkScale {
    fn from(scale: Scale) -> Self {
        match scale {
            Scale::White => Self::White,
            Scale::Match => Self::Match,
        }
    }
}

fn gamma(text: &str) -> Result<f32, String> {
    let gamma = text.parse().ok().filter(|g| (0.5..=4.0).contains(g));
    gamma.ok_or_else(|| format!("'{text}' is not a gamma: give a number from 0.5 to 4, like 2.2"))
}
