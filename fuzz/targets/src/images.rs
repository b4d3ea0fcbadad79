//! Image files: panoramas, pictures of limited range, masks, the attributes of headers.

use std::io::Cursor;
use std::path::Path;

use image::{ImageFormat, Rgb, RgbImage, Rgba, RgbaImage};
use veni_image::{
    HalfRange, LdrPanorama, Panorama, Picture, Precision, ReadOptions, WriteFormat, WriteOptions, attributes,
    peak_bytes, read_mask,
};
use veni_light::sphere::Equirect;

use super::{PIXELS, Target, untouched};

pub(super) const TARGETS: &[Target] = &[
    Target { name: "exr", run: panorama, seeds: exr, repair: untouched },
    Target { name: "hdr", run: panorama, seeds: hdr, repair: untouched },
    Target { name: "attributes", run: header, seeds: headers, repair: untouched },
    Target { name: "png", run: ldr, seeds: png, repair: checksums },
    Target { name: "jpeg", run: ldr, seeds: jpeg, repair: untouched },
    Target { name: "webp", run: ldr, seeds: webp, repair: untouched },
    #[cfg(feature = "avif")]
    Target { name: "avif", run: ldr, seeds: avif, repair: untouched },
    Target { name: "mask", run: mask, seeds: masks, repair: checksums },
];

fn options() -> ReadOptions {
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

fn ldr(path: &Path) -> bool {
    let Ok(found) = LdrPanorama::read_with(path, &options()) else { return false };
    let linear = found.linear(veni_image::Transfer::Srgb);
    // colours of wider primaries are outside of 0 to 1
    assert!(linear.pixels().as_flattened().iter().all(|v| v.is_finite()), "display values");
    true
}

/// What the declared size allows: masks and pictures have no limit of their own.
fn mask(path: &Path) -> bool {
    let small = peak_bytes(path, &options()).is_ok_and(|bytes| bytes.is_some());
    small && read_mask(path).is_ok() && Picture::read(path).is_ok()
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

fn encoded(format: ImageFormat, alpha: bool) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let done = if alpha {
        let at = |x: u32, y: u32| Rgba([(8 * x) as u8, (16 * y) as u8, 77, (255 - 5 * x) as u8]);
        RgbaImage::from_fn(32, 16, at).write_to(&mut out, format)
    } else {
        RgbImage::from_fn(32, 16, |x, y| Rgb([(8 * x) as u8, (16 * y) as u8, 77])).write_to(&mut out, format)
    };
    done.expect("a seed can be encoded");
    out.into_inner()
}

fn png() -> Vec<Vec<u8>> {
    let mut all = vec![encoded(ImageFormat::Png, false), encoded(ImageFormat::Png, true)];
    let chunk =
        |name: &[u8; 4], body: &[u8]| [&(body.len() as u32).to_be_bytes()[..], name, body, &[0; 4]].concat();
    // a palette of two colours: one row of 16 pixels, stored without compression
    let header = [0, 0, 0, 16, 0, 0, 0, 1, 1, 3, 0, 0, 0];
    let data = [0x78, 1, 1, 3, 0, 0xFC, 0xFF, 0, 0x55, 0x0F, 0, 0xB9, 0, 0x65];
    let mut indexed = [
        &b"\x89PNG\r\n\x1a\n"[..],
        &chunk(b"IHDR", &header),
        &chunk(b"gAMA", &[0, 0, 0xB1, 0x8F]),
        &chunk(b"PLTE", &[0, 0, 0, 255, 128, 64]),
        &chunk(b"tRNS", &[255, 128]),
        &chunk(b"eXIf", b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"),
        &chunk(b"IDAT", &data),
        &chunk(b"IEND", &[]),
    ]
    .concat();
    checksums(&mut indexed);
    all.push(indexed);
    all
}

fn jpeg() -> Vec<Vec<u8>> {
    let plain = encoded(ImageFormat::Jpeg, false);
    let exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    let mut turned = plain[..2].to_vec();
    turned.extend([0xFF, 0xE1]);
    turned.extend((exif.len() as u16 + 2).to_be_bytes());
    turned.extend(exif);
    turned.extend(&plain[2..]);
    vec![plain, turned]
}

fn webp() -> Vec<Vec<u8>> {
    vec![encoded(ImageFormat::WebP, false), encoded(ImageFormat::WebP, true)]
}

#[cfg(feature = "avif")]
fn avif() -> Vec<Vec<u8>> {
    vec![
        include_bytes!("../../../crates/veni-image/src/read/avif/files/8-bit-420-bt601-limited.avif")
            .to_vec(),
        include_bytes!("../../../crates/veni-image/src/read/avif/files/8-bit-alpha.avif").to_vec(),
        include_bytes!("../../../crates/veni-image/src/read/avif/files/10-bit-444-bt2020.avif").to_vec(),
    ]
}

fn masks() -> Vec<Vec<u8>> {
    [png(), exr(), jpeg()].concat()
}

/// The checksums of a PNG's chunks.
fn checksums(file: &mut [u8]) {
    let mut at = 8;
    while let Some(length) =
        file.get(at..at + 4).and_then(|b| b.first_chunk()).map(|b| u32::from_be_bytes(*b))
    {
        let end = at + 8 + length as usize;
        if !file.starts_with(b"\x89PNG") || end + 4 > file.len() {
            return;
        }
        let sum = crc(&file[at + 4..end]);
        file[end..end + 4].copy_from_slice(&sum.to_be_bytes());
        at = end + 4;
    }
}

/// CRC-32 (ISO 3309), bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ ((sum & 1) * 0xEDB8_8320))
    })
}
