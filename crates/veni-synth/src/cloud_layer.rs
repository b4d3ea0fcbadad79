//! Parameters of a cloud layer.

use serde::{Deserialize, Serialize};

/// Whether a cloud layer has height.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CloudKind {
    /// Cumulus and stratocumulus: flat bases, rising tops.
    #[serde(rename = "heap")]
    Cumulus,
    /// Cirrus, altocumulus, altostratus and stratus: no height.
    #[serde(rename = "sheet")]
    Stratus,
}

/// One cloud layer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CloudLayer {
    /// Cumulus or stratus.
    pub kind: CloudKind,
    /// Height of the base, km.
    pub base: f32,
    /// From the base to the highest tops, km.
    pub thickness: f32,
    /// Share of the layer that is cloud, 0 to 1.
    pub cover: f32,
    /// Vertical optical depth where it is dense.
    pub depth: f32,
    /// Size of the largest features, km.
    pub scale: f32,
    /// Features are this many times longer along the wind than across.
    pub stretch: f32,
    /// Bearing of the wind, radians.
    pub wind: f32,
    /// How ragged the edges and how uneven stratus is, 0 to 1.
    pub ragged: f32,
    /// How much of it falls apart into small cells (altocumulus), 0 to 1.
    pub cells: f32,
    /// Seed of its noise.
    pub seed: u32,
}
