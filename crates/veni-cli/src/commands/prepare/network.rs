//! The network that expanded images, as far as it is remembered.

use serde::{Deserialize, Serialize};
use veni_light::digest::Digest;

/// What is remembered of the network: images made by another one are not gone on with.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct NetworkSettings {
    /// The file's name; it does not matter where it is.
    pub(super) model: String,
    /// Of the file.
    pub(super) sha256: Digest,
    pub(super) input: String,
    pub(super) output: String,
    pub(super) scale: String,
    /// As asked for; without, the network's or the image's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) size: Option<String>,
}

impl PartialEq for NetworkSettings {
    /// The same network in a renamed file is the same.
    fn eq(&self, other: &Self) -> bool {
        let rest = |s: &Self| [&s.input, &s.output, &s.scale].map(String::clone);
        self.sha256 == other.sha256 && rest(self) == rest(other) && self.size == other.size
    }
}

impl std::fmt::Display for NetworkSettings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { model, sha256, input, output, scale, size } = self;
        write!(f, "{model} (sha256 {sha256}…; input {input}, output {output}, scale {scale}")?;
        size.as_ref().map_or(Ok(()), |size| write!(f, ", size {size}"))?;
        write!(f, ")")
    }
}
