//! Golden vectors: numbers of the reference implementation, compared with ours under each file's own tolerance.
//!
//! Every `*.safetensors` file in the folder named by `VENI_GOLDEN_DIR` (default: `tests/golden`) is one
//! case. Which module computes it is read from the file's metadata, sizes from its tensors; a kind that
//! no module here knows fails, and so does the run if other cases were computed than are listed ([`report`]). Devices: flex, and ndarray where that feature
//! is compiled in; `VENI_GOLDEN_DEVICE` restricts the run to one of them.
//! With the feature `gpu`, the fields are computed by the GPU decoder too ([`gpu`]).
//! `VENI_GOLDEN_VERBOSE` lists how much of its tolerance every tensor uses.

mod baselines;
mod bindings;
mod case;
mod compare;
mod directions;
mod double;
mod encoder;
mod field;
mod filler;
mod fit;
mod fit_rounding;
#[cfg(feature = "gpu")]
mod gpu;
mod image_loading;
mod layers;
mod losses;
mod metrics;
mod official;
mod report;
mod schedules;
mod self_test;
mod shading;
mod tensors;
mod training;
mod vectors;

use burn::tensor::Device;
use case::Case;
use std::path::PathBuf;
use veni::model;

/// What a module says about a case that it recognises.
pub(crate) enum Outcome {
    /// Everything was computed and handed to [`Case::compare`].
    Compared,
    /// Recognised, but not computed here; the reason is reported.
    Skipped(String),
    /// Computed by another process ([`double`]).
    Elsewhere(report::Verdict),
}

/// A module's entry: `None` when the case is not of its kind.
pub(crate) type Family = fn(&Case, &Device) -> Option<Outcome>;

/// All modules; the first that recognises a case computes it.
pub(crate) const FAMILIES: &[Family] = &[
    layers::run,
    encoder::run,
    directions::run,
    field::run,
    losses::run,
    metrics::run,
    schedules::run,
    training::run,
    fit::run,
    shading::run,
    image_loading::run,
    baselines::run,
];

/// The folder of case files.
pub(crate) fn folder() -> PathBuf {
    std::env::var_os("VENI_GOLDEN_DIR")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests").join("golden"), PathBuf::from)
}

/// Whether `VENI_GOLDEN_DEVICE` allows this device.
fn wanted(device: &str) -> bool {
    let named = std::env::var("VENI_GOLDEN_DEVICE").unwrap_or_default();
    assert!(
        ["", "flex", "ndarray"].contains(&named.as_str()),
        "VENI_GOLDEN_DEVICE is {named:?}; it must be flex or ndarray"
    );
    assert!(
        named != "ndarray" || cfg!(feature = "ndarray"),
        "VENI_GOLDEN_DEVICE is ndarray: compile with --features ndarray"
    );
    named.is_empty() || named == device
}

#[test]
fn golden_on_flex() {
    if wanted("flex") {
        report::run_folder("flex", &folder(), &Device::flex().autodiff());
    }
}

#[cfg(feature = "ndarray")]
#[test]
#[allow(deprecated, reason = "kept and tested while burn ships it")]
fn golden_on_ndarray() {
    if wanted("ndarray") {
        report::run_folder("ndarray", &folder(), &Device::ndarray().autodiff());
    }
}
