//! Stands for the command line's messages, which nobody reads here.

/// Says nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Report;

impl Report {
    pub(crate) fn note(self, _: impl std::fmt::Display) {}
}
