//! From any pile of panoramas to a training set: which files they are, whether they are fit for it, which show the
//! same place, and which side of the split each belongs on. Nothing here writes; `veni-cli prepare` does.
//!
//! | step | here |
//! |---|---|
//! | reading, expanding, checking, resampling | [`examine`] |
//! | the same file twice | [`content_hash`] |
//! | the same capture by name | [`capture`] |
//! | the same light by content, rotated, mirrored or at another exposure | [`Fingerprint`] |
//! | what must stay together, and where it goes | [`group`], [`assign`] |

mod capture;
mod content;
mod examine;
mod fingerprint;
mod group;
mod split;
#[cfg(test)]
mod tests;

pub use capture::capture;
pub use content::content_hash;
pub use examine::{Examined, Expander, Expansion, PrepareConfig, examine};
pub use fingerprint::{Fingerprint, Likeness};
pub use group::{Bond, Groups, Member, group};
pub use split::{Shares, Split, assign};
