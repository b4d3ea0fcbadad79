//! Preparing an HDR image for the model.

use crate::{
    Outcome,
    case::{Case, Data},
};
use burn::tensor::Device;
use veni::panorama::{Panorama, log_reference};
use veni::sphere::Equirect;

/// The files hold finite numbers only; this one stands for +∞.
const STANDS_FOR_INFINITY: f32 = 3.4e38;

/// See [`Family`](crate::Family).
pub(crate) fn run(case: &Case, _device: &Device) -> Option<Outcome> {
    if case.module() != "image loading" {
        return None;
    }
    let raw = case.tensors.iter().filter_map(|(name, data)| Some((name.strip_prefix("in.raw_")?, data)));
    for (kind, data) in raw {
        let [height, width, channels] = data.shape[..] else { panic!("an image of shape {:?}", data.shape) };
        let values: Vec<f32> =
            data.values.iter().map(|&v| if v >= STANDS_FOR_INFINITY { f32::INFINITY } else { v }).collect();
        let log = log_reference(&values, channels).expect("the image has positive values");
        let image = Panorama::new(Equirect::new(width, height), log);
        let flat = |image: &Panorama| Data::new([height, width, 3], image.pixels().as_flattened().to_vec());
        case.compare(&format!("out.log_{kind}"), &flat(&image));
        case.compare(&format!("out.log_mirrored_{kind}"), &flat(&image.mirror()));
    }
    Some(Outcome::Compared)
}
