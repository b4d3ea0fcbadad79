//! Parameters of a deck of cloud.

use serde::{Deserialize, Serialize};

/// Whether a deck has height.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeckKind {
    /// Cumulus and stratocumulus: flat bases, rising tops.
    Heap,
    /// Cirrus, altocumulus, altostratus and stratus: a layer without height.
    Sheet,
}

/// One deck of cloud.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Deck {
    /// Heap or sheet.
    pub kind: DeckKind,
    /// Height of the base, km.
    pub base: f32,
    /// From the base to the highest tops, km.
    pub thickness: f32,
    /// Share of the deck that is cloud, 0 to 1.
    pub cover: f32,
    /// Vertical optical depth where it is dense.
    pub depth: f32,
    /// Size of the largest features, km.
    pub scale: f32,
    /// Features are this many times longer along the wind than across.
    pub stretch: f32,
    /// Bearing of the wind, radians.
    pub wind: f32,
    /// How ragged the edges and how uneven the sheets are, 0 to 1.
    pub ragged: f32,
    /// How much of it falls apart into small cells (altocumulus), 0 to 1.
    pub cells: f32,
    /// Seed of its noise.
    pub seed: u32,
}
