//! What is remembered of each file that was examined.

use std::path::Path;

use serde::{Deserialize, Serialize};
use veni_data::expand::network::Estimate;
use veni_data::prepare::{Examined, Fingerprint, Split, capture};
use veni_image::Sanitised;
use veni_light::digest::Digest;

use super::network::NetworkSettings;
use super::scan::Source;

/// One examined file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Record {
    /// Its one true name; with size and time it tells whether the file is still the one examined.
    pub(super) key: String,
    pub(super) bytes: u64,
    pub(super) modified: u64,
    /// As the user named it.
    pub(super) source: String,
    pub(super) given: Option<Split>,
    pub(super) fate: Fate,
}

/// Whether a file is fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Fate {
    Fit(Box<Facts>),
    Refused(String),
}

/// What is known of a panorama that is fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Facts {
    /// Hash of the file's content; the prepared image is kept under it.
    pub(super) id: String,
    pub(super) width: usize,
    pub(super) height: usize,
    /// Stops from median to brightest luminance.
    pub(super) stops: f32,
    /// Mean ln luminance.
    pub(super) log_exposure: f32,
    pub(super) replaced: Replaced,
    pub(super) expanded: Option<Expansion>,
    pub(super) fingerprint: Fingerprint,
    /// What was said of the file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) notes: Vec<String>,
}

/// Values that were painted over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Replaced {
    pub(super) nan: usize,
    pub(super) infinite: usize,
    // before it was negative ones alone, zeros counted too
    #[serde(alias = "not_positive")]
    pub(super) negative: usize,
}

/// What was rebuilt of an LDR panorama.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Expansion {
    /// Share of the sphere that was clipped.
    pub(super) clipped: f64,
    pub(super) sun_direction: Option<[f32; 3]>,
    pub(super) sun_energy: Option<f64>,
    /// The network that did it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) network: Option<ByNetwork>,
}

/// What a network did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ByNetwork {
    pub(super) model: String,
    pub(super) sha256: Digest,
    /// What its radiance was multiplied by.
    pub(super) factor: f32,
    /// Share of the clipped values for which it gave less than is stored.
    pub(super) below: f64,
}

impl Record {
    pub(super) fn new(source: &Source, fate: Fate) -> Self {
        let Source { key, bytes, modified, path, given } = source.clone();
        Self { key, bytes, modified, source: path.display().to_string(), given, fate }
    }

    /// Whether `source` is the file that this was written about, unchanged since.
    pub(super) fn is_of(&self, source: &Source) -> bool {
        (&self.key, self.bytes, self.modified) == (&source.key, source.bytes, source.modified)
    }

    pub(super) fn facts(&self) -> Option<&Facts> {
        match &self.fate {
            Fate::Fit(facts) => Some(facts),
            Fate::Refused(_) => None,
        }
    }

    /// The file's name without folder and extension.
    pub(super) fn stem(&self) -> String {
        Path::new(&self.source).file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    pub(super) fn capture(&self) -> String {
        capture(Path::new(&self.source))
    }
}

impl Facts {
    pub(super) fn new(id: String, examined: &Examined, network: Option<&NetworkSettings>) -> Self {
        let Sanitised { nan, infinite, negative, .. } = examined.replaced;
        let by = |(estimate, network): (Estimate, &NetworkSettings)| ByNetwork {
            model: network.model.clone(),
            sha256: network.sha256,
            factor: estimate.factor,
            below: estimate.below,
        };
        let expansion = |done: veni_data::prepare::Expansion| Expansion {
            clipped: done.clipped,
            sun_direction: done.sun.map(|s| s.direction),
            sun_energy: done.sun.map(|s| s.energy),
            network: done.estimate.zip(network).map(by),
        };
        Self {
            id,
            width: examined.size.width,
            height: examined.size.height,
            stops: examined.stops,
            log_exposure: examined.panorama.mean_log_luminance(),
            replaced: Replaced { nan, infinite, negative },
            expanded: examined.expanded.map(expansion),
            fingerprint: examined.fingerprint.clone(),
            notes: examined.notes.clone(),
        }
    }
}
