//! Settings of where panoramas are held, which change no result.

use veni_data::Holding;

/// Which of the settings of holding a `--set` gives.
pub(super) fn held_by(set: &str) -> Option<&'static str> {
    let (key, _) = set.split_once('=')?;
    let key = key.trim().strip_prefix("data.")?;
    Holding::KEYS.into_iter().find(|held| *held == key)
}
