//! 64 × 32 pixels, red from 0 to 1 along the rows, green from 0 to 1 down the columns, blue 128/255, in several codings:
//! `avifenc -d BITS -y LAYOUT -r RANGE --cicp 1/13/MATRIX --min 4 --max 8` (libavif 0.11.1), those with 4:2:0, grey and alpha by
//! Pillow 12 at quality 95.

use super::*;
use crate::panorama::Panorama;

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
        assert!((ldr.unknown() - hidden).abs() < 0.01, "{name}: {}", ldr.transparent());
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

#[test]
fn what_is_not_read_is_named() {
    let folder = Folder::new();
    let refused = |content: &[u8], words: &[&str]| {
        let error = folder.read(content).map(|ldr| ldr.grid()).unwrap_err().to_string();
        words.iter().chain(&["a.avif"]).for_each(|w| assert!(error.contains(w), "no '{w}' in {error}"));
    };
    refused(include_bytes!("files/turned.avif"), &["turned"]);
    refused(include_bytes!("files/pq.avif"), &["PQ", "EXR"]);
    let whole = FILES[0].1;
    for cut in [20, 100, 300, whole.len() - 1] {
        refused(&whole[..cut], &["damaged or truncated AVIF"]);
    }
    let mut strange = FILES[3].1.to_vec();
    let at = strange.windows(8).position(|w| w == b"colrnclx").unwrap() + 8;
    strange[at + 5] = 8;
    refused(&strange, &["matrix coefficients 8"]);
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
