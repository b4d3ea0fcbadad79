//! Preparing an HDR image for the model.

use crate::case::{Case, Data};
use crate::{Outcome, Outcome::Compared};
use burn::tensor::Device;
use veni::panorama::log_reference;

/// In the files this number stands for +∞, which their writer could not store.
const INFINITY: f32 = 3.4e38;

/// See [`Family`](crate::Family). No tensors: the device plays no part.
pub(crate) fn run(case: &Case, _device: &Device) -> Option<Outcome> {
    if case.module() != "image loading" {
        return None;
    }
    for output in case.tensors.keys().filter(|n| n.starts_with("out.")) {
        let Some(kind) = output.strip_prefix("out.log_") else { continue };
        let mirrored = kind.strip_prefix("mirrored_");
        let raw = case.data(&format!("in.raw_{}", mirrored.unwrap_or(kind)));
        let [height, width, channels] = raw.shape[..] else { panic!("{:?} is no image", raw.shape) };
        let values: Vec<f32> =
            raw.values.iter().map(|&v| if v >= INFINITY { f32::INFINITY } else { v }).collect();
        let mut pixels = log_reference(&values, channels).unwrap_or_else(|e| panic!("{output}: {e}"));
        if mirrored.is_some() {
            pixels.chunks_mut(width).for_each(<[_]>::reverse);
        }
        case.compare(output, &Data::new([height, width, 3], pixels.into_flattened()));
    }
    Some(Compared)
}
