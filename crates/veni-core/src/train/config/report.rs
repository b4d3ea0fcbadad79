//! What a run leaves behind, and how often.

use serde::{Deserialize, Serialize};

use veni_light::model::StoredType;

/// What a run writes beside its weights, and how often.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReportConfig {
    /// Steps between validations; 0 validates only at the end.
    pub validate_every: u64,
    /// Steps between preview images; 0 writes only the last.
    pub preview_every: u64,
    /// Steps between checkpoints; 0 writes only the last.
    pub checkpoint_every: u64,
    /// Training panoramas that are validated too (the first ones), to see overfitting.
    pub train_subset: usize,
    /// Augmented copies per training panorama whose posteriors the stored prior is fitted to.
    pub prior_copies: usize,
    /// Precision of the stored model.
    pub stored: Stored,
}

/// Precision of weights in `model.safetensors`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stored {
    /// Half precision.
    F16,
    /// Single precision.
    F32,
}

impl From<Stored> for StoredType {
    fn from(stored: Stored) -> Self {
        match stored {
            Stored::F16 => Self::F16,
            Stored::F32 => Self::F32,
        }
    }
}
