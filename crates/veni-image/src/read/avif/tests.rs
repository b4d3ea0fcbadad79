//! 64 × 32 pixels, red from 0 to 1 along the rows, green from 0 to 1 down the columns, blue 128/255, in several codings:
//! `avifenc -d BITS -y LAYOUT -r RANGE --cicp 1/13/MATRIX --min 4 --max 8` (libavif 0.11.1), those with 4:2:0, grey and alpha by
//! Pillow 12 at quality 95.

use super::super::meaning::Curve;
use super::*;
use crate::panorama::Panorama;
use crate::tonemap::srgb_to_linear;
use crate::{Content, TransferFunction};

const FILES: [(&str, &[u8]); 6] = [
    ("10 bits, 4:4:4, BT.2020, full", include_bytes!("files/10-bit-444-bt2020.avif")),
    ("12 bits, 4:2:2, BT.709, limited", include_bytes!("files/12-bit-422-bt709-limited.avif")),
    ("8 bits, identity, full", include_bytes!("files/8-bit-identity.avif")),
    ("8 bits, 4:2:0, BT.601, limited", include_bytes!("files/8-bit-420-bt601-limited.avif")),
    ("8 bits, 4:2:0, BT.601, limited, alpha", include_bytes!("files/8-bit-alpha.avif")),
    ("8 bits, grey", GREY),
];
const GREY: &[u8] = include_bytes!("files/8-bit-grey.avif");

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn read(&self, content: &[u8]) -> Result<LdrPanorama> {
        let path = self.0.path().join("a.avif");
        std::fs::write(&path, content).unwrap();
        LdrPanorama::read(path)
    }
}

/// The largest distance from what was encoded.
fn distance(ldr: &LdrPanorama, grey: bool) -> f32 {
    assert_eq!((ldr.grid().width, ldr.grid().height), (64, 32));
    let apart = ldr.values().iter().enumerate().map(|(at, found)| {
        let rgb = [(at % 64) as f32 / 63.0, (at / 64) as f32 / 31.0, 128.0 / 255.0];
        let luma = 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
        let expected = if grey { [luma; 3] } else { rgb };
        found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    });
    apart.fold(0.0, f32::max)
}

#[test]
fn every_coding_gives_the_colours_that_were_encoded() {
    let folder = Folder::new();
    for (name, content) in FILES {
        let ldr = folder.read(content).unwrap();
        let found = distance(&ldr, content == GREY);
        assert!(found < 0.03, "{name}: {found}");
        let hidden = if name.ends_with("alpha") { 0.25 } else { 0.0 };
        assert!((ldr.unknown() - hidden).abs() < 0.01, "{name}: {}", ldr.unknown());
    }
    let path = folder.0.path().join("a.avif");
    assert!(LdrPanorama::recognise(&path).unwrap());
    let error = Panorama::read(&path).unwrap_err().to_string();
    assert!(error.contains("AVIF") && error.contains("expand"), "{error}");
}

/// Without an `nclx` box the stream's own code points count, which are the same in these files.
#[test]
fn a_stream_tells_its_own_coding() {
    let folder = Folder::new();
    for (name, content) in &FILES[..4] {
        let mut content = content.to_vec();
        let at = content.windows(8).position(|w| w == b"colrnclx").unwrap();
        content[at + 4..at + 8].copy_from_slice(b"none");
        let found = distance(&folder.read(&content).unwrap(), false);
        assert!(found < 0.03, "{name}: {found}");
    }
}

/// With another matrix or range in its `nclx` box the same stream has other colours: the box is obeyed, and the comparison
/// above sees it.
#[test]
fn a_wrong_matrix_or_range_is_seen() {
    let folder = Folder::new();
    for (at, value) in [(5, 9), (6, 0x80)] {
        let mut content = FILES[3].1.to_vec();
        let box_at = content.windows(8).position(|w| w == b"colrnclx").unwrap() + 8;
        assert!(content[box_at + at] != value);
        content[box_at + at] = value;
        let found = distance(&folder.read(&content).unwrap(), false);
        assert!(found > 0.04, "byte {at}: {found}");
    }
}

/// Linear radiance of the pixel in row 16, column 40 of a file with other bytes behind the name of its `nclx` box.
fn coded(folder: &Folder, changes: &[(usize, u8)]) -> (Content, [f32; 3], [f32; 3]) {
    // full range, 4:4:4, 10 bits: primaries, transfer, matrix of 16 bits each
    let mut content = FILES[0].1.to_vec();
    let box_at = content.windows(8).position(|w| w == b"colrnclx").unwrap() + 8;
    changes.iter().for_each(|(at, value)| content[box_at + at] = *value);
    let path = folder.0.path().join("a.avif");
    std::fs::write(&path, content).unwrap();
    let read = Content::read(path, &ReadOptions::default()).unwrap();
    let linear = match &read {
        Content::Radiance(panorama) => panorama.clone(),
        Content::Display(ldr) => ldr.linear(TransferFunction::Srgb),
    };
    (read, linear.pixel(40, 16), [40.0 / 63.0, 16.0 / 31.0, 128.0 / 255.0])
}

#[test]
fn curves_and_primaries_are_applied() {
    let folder = Folder::new();
    let near = |a: [f32; 3], b: [f32; 3], tolerance: f32| {
        let off = a.iter().zip(b).fold(0f32, |m, (a, b)| m.max((a - b).abs() / b.max(0.1)));
        assert!(off < tolerance, "{a:?} is not {b:?}");
    };
    let (read, found, stored) = coded(&folder, &[(3, 13)]);
    assert!(matches!(read, Content::Display(_)));
    near(found, stored.map(srgb_to_linear), 0.03);
    near(coded(&folder, &[(3, 8)]).1, stored, 0.03);
    for (transfer, curve) in [(16, Curve::Pq), (18, Curve::Hlg)] {
        let (read, found, stored) = coded(&folder, &[(3, transfer)]);
        assert!(matches!(read, Content::Radiance(_)), "{transfer}");
        near(found, stored.map(|v| curve.linear(0, v)), 0.1);
    }
    // BT.2020 to BT.709 (ITU-R BT.2087)
    let (_, found, [r, g, b]) = coded(&folder, &[(1, 9), (3, 8)]);
    near(
        found,
        [
            1.6605 * r - 0.5876 * g - 0.0728 * b,
            1.1329 * g - 0.1246 * r - 0.0083 * b,
            1.1187 * b - 0.0182 * r - 0.1006 * g,
        ],
        0.05,
    );
    let pq = folder.read(include_bytes!("files/pq.avif")).unwrap();
    assert_eq!(pq.meaning.curve, Curve::Pq);
}

/// A profile goes before code points: Display P3 in a box behind all others of a file that calls itself sRGB.
#[test]
fn a_profile_goes_before_code_points() {
    let profile = moxcms::ColorProfile::new_display_p3().encode().unwrap();
    let added = [&(profile.len() as u32 + 12).to_be_bytes()[..], b"colrprof", &profile].concat();
    let mut content = FILES[0].1.to_vec();
    let number = |bytes: &[u8], at: usize| u32::from_be_bytes(*bytes[at..].first_chunk().unwrap());
    let grow = |content: &mut [u8], at: usize| {
        let longer = number(content, at) + added.len() as u32;
        content[at..at + 4].copy_from_slice(&longer.to_be_bytes());
    };
    let place = |content: &[u8], name: &[u8]| content.windows(4).position(|w| w == name).unwrap();
    let (meta, media, iloc) =
        (place(&content, b"meta") - 4, place(&content, b"mdat") + 4, place(&content, b"iloc"));
    // where the picture's bytes are said to begin
    let offset = (iloc..iloc + 40).find(|at| number(&content, *at) as usize == media).unwrap();
    let end = meta + number(&content, meta) as usize;
    grow(&mut content, meta);
    grow(&mut content, offset);
    content.splice(end..end, added.iter().copied());
    let ldr = Folder::new().read(&content).unwrap();
    let p3 = crate::colour::P3_D65.to_rec709().unwrap().unwrap();
    let found = ldr.meaning.matrix.unwrap();
    found
        .as_flattened()
        .iter()
        .zip(p3.as_flattened())
        .for_each(|(a, b)| assert!((a - b).abs() < 2e-3, "{found:?}"));
}

#[test]
fn what_is_not_read_is_named() {
    let folder = Folder::new();
    let refused = |content: &[u8], words: &[&str]| {
        let error = folder.read(content).map(|ldr| ldr.grid()).unwrap_err().to_string();
        words.iter().chain(&["a.avif"]).for_each(|w| assert!(error.contains(w), "no '{w}' in {error}"));
    };
    refused(include_bytes!("files/turned.avif"), &["turned"]);
    let whole = FILES[0].1;
    for cut in [20, 100, 300, whole.len() - 1] {
        refused(&whole[..cut], &["damaged or truncated AVIF"]);
    }
    let mut strange = FILES[3].1.to_vec();
    let at = strange.windows(8).position(|w| w == b"colrnclx").unwrap() + 8;
    strange[at + 5] = 8;
    refused(&strange, &["matrix coefficients 8"]);
    for (place, value, words) in
        [(3, 3, "transfer characteristic 3"), (3, 0, "transfer characteristic 0"), (1, 3, "primaries 3")]
    {
        let mut strange = FILES[3].1.to_vec();
        strange[at + place] = value;
        refused(&strange, &[words]);
    }
    let small = ReadOptions { max_pixels: 64 * 32 - 1, ..ReadOptions::default() };
    let path = folder.0.path().join("b.avif");
    std::fs::write(&path, whole).unwrap();
    let error = LdrPanorama::read_with(&path, &small).unwrap_err().to_string();
    assert!(error.contains("64 × 32") && error.contains("limit"), "{error}");
}

/// A stream with any byte changed is a picture or an error, never a panic.
#[test]
fn damage_is_an_error_or_a_picture() {
    let folder = Folder::new();
    for (_, content) in FILES {
        for at in 0..content.len() {
            let mut content = content.to_vec();
            content[at] ^= 0x55;
            drop(folder.read(&content));
        }
    }
}
