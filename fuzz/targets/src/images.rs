//! Image files: panoramas, masks, the attributes of headers.

use std::io::Cursor;
use std::path::Path;

use veni_image::{
    HalfRange, Panorama, Picture, Precision, ReadOptions, WriteFormat, WriteOptions, attributes, peak_bytes,
    read_mask_with,
};
use veni_light::sphere::Equirect;

use super::pictures::{checksums, jpeg, png};
use super::{PIXELS, Target, untouched};

pub(super) const TARGETS: &[Target] = &[
    Target { name: "exr", run: panorama, seeds: exr, repair: untouched },
    Target { name: "hdr", run: panorama, seeds: hdr, repair: untouched },
    Target { name: "attributes", run: header, seeds: headers, repair: untouched },
    Target { name: "mask", run: mask, seeds: masks, repair: checksums },
];

pub(super) fn options() -> ReadOptions {
    ReadOptions { max_pixels: PIXELS, any_aspect: true, ..ReadOptions::default() }
}

fn panorama(path: &Path) -> bool {
    let read = Panorama::read_with(path, &options()).and_then(|mut panorama| {
        panorama.fill();
        panorama.sanitise()
    });
    read.is_ok()
}

fn header(path: &Path) -> bool {
    attributes(path).is_ok() && peak_bytes(path, &options()).is_ok_and(|bytes| bytes.is_some())
}

fn mask(path: &Path) -> bool {
    read_mask_with(path, &options()).is_ok() && Picture::read_with(path, &options()).is_ok()
}

fn sky() -> Panorama {
    Panorama::from_fn(Equirect::new(16, 8), |[x, y, z]| [1.5 + x, 1.5 + y, 20.0 * (z + 1.0)])
}

fn written(name: &str, format: WriteFormat) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    let options = WriteOptions {
        half_range: HalfRange::Refuse,
        attributes: [("veni:model".to_owned(), "0123456789abcdef".to_owned())].into(),
        ..WriteOptions::new(format)
    };
    sky().write(&path, &options).expect("a seed can be written");
    std::fs::read(path).expect("it was written")
}

fn exr() -> Vec<Vec<u8>> {
    let mut all = [Precision::Half, Precision::Float].map(|p| written("a.exr", WriteFormat::Exr(p))).to_vec();
    all.extend(foreign());
    all
}

/// Every compression, in scan lines and in tiles, by the library that others use too.
fn foreign() -> Vec<Vec<u8>> {
    use exr::prelude::*;
    let compressions = [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
        Compression::B44A,
        Compression::DWAA(None),
    ];
    let blocks = [Blocks::ScanLines, Blocks::Tiles(Vec2(8, 8))];
    let pairs = compressions.into_iter().flat_map(|c| blocks.map(|b| (c, b)));
    let one = |(compression, blocks)| {
        let half = |v: f32| f16::from_f32(v);
        let channels = SpecificChannels::rgb(move |at: Vec2<usize>| {
            (half(at.x() as f32), half(at.y() as f32), half(0.5))
        });
        let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
        let layer = Layer::new((16, 8), LayerAttributes::default(), encoding, channels);
        let mut out = Cursor::new(Vec::new());
        Image::from_layer(layer).write().to_buffered(&mut out).ok()?;
        Some(out.into_inner())
    };
    pairs.filter_map(one).collect()
}

fn hdr() -> Vec<Vec<u8>> {
    let flat = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 4 +X 8\n".to_vec();
    vec![written("a.hdr", WriteFormat::Hdr), [flat, [128, 64, 32, 129].repeat(32)].concat()]
}

fn headers() -> Vec<Vec<u8>> {
    [exr(), hdr()].concat()
}

fn masks() -> Vec<Vec<u8>> {
    [png(), exr(), jpeg()].concat()
}
