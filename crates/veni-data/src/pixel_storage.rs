//! Pixel storage options: where panoramas are kept during a run.

use std::path::PathBuf;

/// Where a run's panoramas are kept, as far as it differs from its configuration. No result depends on it, and a run that is
/// resumed elsewhere finds other disks and another memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PixelStorage {
    /// In place of [`DataConfig::memory_mib`](super::DataConfig::memory_mib).
    pub memory_mib: Option<u64>,
    /// In place of [`DataConfig::scratch`](super::DataConfig::scratch).
    pub scratch: Option<PathBuf>,
}

impl PixelStorage {
    /// The settings that it is about, as keys of a table `data`.
    pub const KEYS: [&str; 2] = ["memory_mib", "scratch"];
}
