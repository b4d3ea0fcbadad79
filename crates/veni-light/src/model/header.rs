//! What a model file says about itself: the JSON under the key `veni` of the safetensors header.

use serde::{Deserialize, Serialize};

use super::{ModelConfig, ModelKind};
use crate::{Error, Result};

/// The newest format. It is that of models whose panoramas were without their compact lights, or that know of suns: a program that
/// knows neither would make skies without light of them.
pub const FORMAT: u32 = 2;
/// Of other models, which older programs read too.
const PLAIN: u32 = 1;
/// The native frame, the only one weights are stored in.
const FRAME: &str = "z-up";

/// Provenance of the weights. Nothing here changes what is computed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ModelInfo {
    /// How the weights were made, if they were trained.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub training: Option<Training>,
    /// Where the prior came from, e.g. "76 training latents, Ledoit–Wolf 0.31".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<String>,
    /// SPDX expression of the weights' licence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub licence: Option<String>,
}

/// How a model was trained.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Training {
    /// The data set, in words.
    pub data: String,
    /// Number of photographed panoramas trained on; absent in files written before there was this entry.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub panoramas: Option<usize>,
    /// Optimiser steps taken.
    pub steps: u64,
    /// Seed of the run.
    pub seed: u64,
    /// The command line that repeats it.
    pub command: String,
    /// Revision of this program.
    pub git: String,
    /// The model that training began with, by file name and [`digest`](super::Model::digest); absent: weights from the
    /// seed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub init: Option<String>,
}

#[derive(Serialize, Deserialize)]
struct Header {
    format: u32,
    kind: ModelKind,
    config: ModelConfig,
    frame: String,
    #[serde(flatten)]
    info: ModelInfo,
}

/// Only the format, so that an unknown one is refused before anything else of it is read.
#[derive(Deserialize)]
struct Format {
    format: u32,
}

pub(super) fn to_json(config: &ModelConfig, info: &ModelInfo, has_sun: bool) -> Result<String> {
    let header = Header {
        format: if config.lights > 0 || has_sun { FORMAT } else { PLAIN },
        kind: config.kind,
        config: config.clone(),
        frame: FRAME.into(),
        info: info.clone(),
    };
    serde_json::to_string(&header).map_err(|e| Error::invalid(format!("the header cannot be written: {e}")))
}

pub(super) fn from_json(json: &str) -> Result<(ModelConfig, ModelInfo)> {
    let broken = |e: serde_json::Error| Error::invalid(format!("header entry `veni`: {e}"));
    let Format { format } = serde_json::from_str(json).map_err(broken)?;
    if ![PLAIN, FORMAT].contains(&format) {
        return Err(Error::unsupported(format!(
            "model format {format} is unknown (this program reads formats {PLAIN} and {FORMAT}); use the program that wrote it"
        )));
    }
    let header: Header = serde_json::from_str(json).map_err(broken)?;
    if header.frame != FRAME {
        let frame = header.frame;
        return Err(Error::unsupported(format!(
            "frame \"{frame}\" is unknown; weights are stored in \"{FRAME}\""
        )));
    }
    if header.kind != header.config.kind {
        let (outer, inner) = (header.kind, header.config.kind);
        return Err(Error::invalid(format!("the header says kind {outer:?}, its config {inner:?}")));
    }
    header.config.validate()?;
    Ok((header.config, header.info))
}
