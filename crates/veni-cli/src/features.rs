//! What this build can do, for texts that must not promise more.

/// Whether it learns: `evaluate` and `train`.
pub(crate) const LEARN: bool = cfg!(feature = "learn");
/// Whether it can use graphics devices.
pub(crate) const GPU: bool = cfg!(feature = "gpu");

/// A part of a text about something that this build may lack.
pub(crate) fn only(has: bool, text: &'static str) -> &'static str {
    if has { text } else { "" }
}
