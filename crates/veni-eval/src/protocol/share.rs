//! Dividing a protocol's work among processes that know nothing of each other.
//!
//! `keep` of a protocol computes its share of what takes long into the [`Store`](crate::store::Store), without
//! tables or figures. Once all shares are there, `run` finds them and makes both.

/// Items `index` with `index % of == at`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// Which one, from 0.
    pub at: usize,
    /// How many there are.
    pub of: usize,
}

impl Share {
    /// Whether an item belongs to this share.
    pub fn has(self, index: usize) -> bool {
        index % self.of.max(1) == self.at
    }
}
