//! Files: round trips, files of other software's habits, poisoned files, random damage.

mod foreign;
mod metadata;
mod poisoned;
mod remembered;
mod round_trips;

use std::path::Path;

use exr::prelude::*;

use super::*;
use veni_light::sphere::Equirect;

/// Deterministic radiance with a wide range; no value is exact in half precision.
fn sky(width: usize, height: usize) -> Panorama {
    Panorama::from_fn(Equirect::new(width, height), |[x, y, z]| {
        [(3.1 * x).exp() + 0.013, (5.3 * y).exp() + 0.007, (7.7 * z).exp() + 0.003]
    })
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn options(format: WriteFormat) -> WriteOptions {
    WriteOptions::new(format)
}

fn assert_close(a: &Panorama, b: &Panorama, relative: f32) {
    assert_eq!(a.grid(), b.grid());
    for (i, (p, q)) in a.pixels().iter().zip(b.pixels()).enumerate() {
        let largest = p.iter().fold(0f32, |m, v| m.max(v.abs()));
        for (x, y) in p.iter().zip(q) {
            assert!((x - y).abs() <= relative * largest, "pixel {i}: {p:?} came back as {q:?}");
        }
    }
}

/// Any channels, encoding and attributes through the exr crate's own writer.
fn exr_file(
    path: &Path,
    size: (usize, usize),
    channels: Vec<(&str, FlatSamples)>,
    encoding: Encoding,
    change: impl Fn(&mut ImageAttributes, &mut LayerAttributes),
) {
    let list = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
    let mut own = LayerAttributes::default();
    let mut shared = ImageAttributes::with_size(size);
    change(&mut shared, &mut own);
    let layer = Layer::new(size, own, encoding, AnyChannels::sort(list));
    Image::empty(shared).with_layer(layer).write().to_file(path).unwrap();
}

fn plane(image: &Panorama, channel: usize) -> Vec<f32> {
    image.pixels().iter().map(|p| p[channel]).collect()
}

fn rgb(image: &Panorama) -> Vec<(&'static str, FlatSamples)> {
    ["R", "G", "B"]
        .into_iter()
        .enumerate()
        .map(|(i, name)| (name, FlatSamples::F32(plane(image, i))))
        .collect()
}
