//! Pixel storage options, which change no result.

use veni_data::PixelStorage;

/// Which of the pixel storage options a `--set` gives.
pub(super) fn storage_key(set: &str) -> Option<&'static str> {
    let (key, _) = set.split_once('=')?;
    let key = key.trim().strip_prefix("data.")?;
    PixelStorage::KEYS.into_iter().find(|own| *own == key)
}
