//! Directions and sampling.

use crate::{Outcome, case::Case};
use burn::tensor::Device;

/// See [`Family`](crate::Family).
pub(crate) fn run(_case: &Case, _device: &Device) -> Option<Outcome> {
    None
}
