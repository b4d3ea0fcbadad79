//! Pictures as other programs write them: what they say of their numbers, layers and holes, by every command.

mod colour;
mod layers;

use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, Vec2, WritableImage,
};
use serde_json::Value;
use veni_image::Panorama;

use crate::util::{Dir, Run, text};

const WIDTH: usize = 64;
const HEIGHT: usize = 32;

/// A file beside these tests.
fn file(name: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/cli/files").join(name)).unwrap()
}

/// A sky with a sun, of values from 0.2 to 40.
fn sky(x: usize, y: usize) -> [f32; 3] {
    let sun = if (20..23).contains(&x) && (8..10).contains(&y) { 40.0 } else { 0.0 };
    let (u, v) = (x as f32 / WIDTH as f32, y as f32 / HEIGHT as f32);
    [0.2 + 0.5 * u + sun, 0.3 + 0.4 * v + sun, 0.9 - 0.5 * v + sun]
}

fn pixels() -> impl Iterator<Item = [f32; 3]> {
    (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| sky(x, y)))
}

/// Channels R, G, B below a prefix.
fn rgb(prefix: &str, factor: f32) -> Vec<(String, Vec<f32>)> {
    let channel =
        |(c, name): (usize, &str)| (format!("{prefix}{name}"), pixels().map(|p| factor * p[c]).collect());
    ["R", "G", "B"].into_iter().enumerate().map(channel).collect()
}

fn layer(
    name: &str,
    channels: Vec<(String, Vec<f32>)>,
    change: impl Fn(&mut LayerAttributes),
) -> Layer<AnyChannels<FlatSamples>> {
    let channels =
        channels.into_iter().map(|(n, v)| AnyChannel::new(n.as_str(), FlatSamples::F32(v))).collect();
    let mut own = LayerAttributes::default();
    if !name.is_empty() {
        own = LayerAttributes::named(name);
    }
    change(&mut own);
    Layer::new((WIDTH, HEIGHT), own, Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels))
}

fn exr(path: &Path, layers: Vec<Layer<AnyChannels<FlatSamples>>>, window: (usize, usize)) {
    let attributes = ImageAttributes::new(IntegerBounds::from_dimensions(window));
    Image::from_layers(attributes, layers).write().to_file(path).unwrap();
}

fn plain(path: &Path, channels: Vec<(String, Vec<f32>)>, change: impl Fn(&mut LayerAttributes)) {
    exr(path, vec![layer("", channels, change)], (WIDTH, HEIGHT));
}

fn hdr(lines: &str, end: &str) -> Vec<u8> {
    let head =
        format!("#?RADIANCE\n{lines}FORMAT=32-bit_rle_rgbe\n\n-Y {HEIGHT} +X {WIDTH}\n").replace('\n', end);
    let code = |p: [f32; 3]| {
        let exponent = p.iter().fold(0f32, |m, v| m.max(*v)).log2().floor() + 1.0;
        let [r, g, b] = p.map(|v| (v * (8.0 - exponent).exp2()) as u8);
        [r, g, b, (exponent + 128.0) as u8]
    };
    head.into_bytes().into_iter().chain(pixels().flat_map(code)).collect()
}

/// A panorama of this size brought to itself by `prepare`, and what was said.
fn prepared(dir: &Dir, name: &str, size: &str, more: &[&str]) -> (Option<Panorama>, Run) {
    let args = ["prepare", name, "-o", "data", "--size", size, "--val", "0", "--force"];
    let run = dir.run(&[&args[..], more].concat());
    let stem = Path::new(name).file_stem().unwrap().to_str().unwrap();
    (Panorama::read(dir.path(format!("data/train/{stem}.exr"))).ok(), run)
}

fn means(panorama: &Panorama) -> [f32; 3] {
    let count = panorama.pixels().len() as f32;
    [0, 1, 2].map(|c| panorama.pixels().iter().map(|p| p[c]).sum::<f32>() / count)
}

fn near(found: [f32; 3], expected: [f32; 3]) {
    let off = found.iter().zip(expected).fold(0f32, |m, (a, b)| m.max((a / b - 1.0).abs()));
    assert!(off < 0.01, "{found:?} is not {expected:?}");
}

fn one(dir: &Dir, args: &[&str]) -> Value {
    let results = dir.json(args);
    let [result] = &results[..] else { panic!("{args:?}: {} results", results.len()) };
    result.clone()
}

/// What `inspect` says of a picture's mean luminance.
fn mean(dir: &Dir, args: &[&str]) -> f64 {
    one(dir, &[&["inspect"], args].concat())["radiance"]["mean"].as_f64().unwrap()
}
