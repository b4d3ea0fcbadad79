//! Bad headers, truncated files, random damage.

use std::fs;
use std::path::{Path, PathBuf};

use exr::prelude::*;

use super::super::*;
use super::{exr_file, folder, options, rgb, sky};
use crate::Error;

fn error_of(path: &Path) -> String {
    let error = Panorama::read(path).unwrap_err();
    assert!(matches!(error, Error::Invalid { .. } | Error::TooLarge { .. }), "{error:?}");
    error.to_string()
}

#[test]
fn poisoned_headers_and_truncated_files() {
    let dir = folder();
    let path = dir.path().join("p.exr");
    // 3:1
    let wide = sky(24, 8);
    wide.write(&path, &options(WriteFormat::Exr(Precision::Half))).unwrap();
    assert!(error_of(&path).contains("24 × 8"));
    assert!(Panorama::read_with(&path, &ReadOptions { any_aspect: true, ..ReadOptions::default() }).is_ok());
    // the limit
    let limit = ReadOptions { max_pixels: 100, any_aspect: true, ..ReadOptions::default() };
    assert!(Panorama::read_with(&path, &limit).unwrap_err().to_string().contains("the limit of 100"));
    // a good file, cut everywhere: an error naming the file, never a partial image
    let image = sky(32, 16);
    let good = dir.path().join("good.exr");
    image.write(&good, &options(WriteFormat::Exr(Precision::Half))).unwrap();
    let bytes = fs::read(&good).unwrap();
    for cut in (0..bytes.len()).step_by(7).chain([bytes.len() - 1]) {
        fs::write(&path, &bytes[..cut]).unwrap();
        let error = Panorama::read(&path).unwrap_err().to_string();
        assert!(error.contains("p.exr"), "cut at {cut}: {error}");
    }
    // windows rewritten in the header: 10⁹ pixels and more, nothing, turned inside out
    for (x, y, part) in
        [(99_999, 49_999, "limit"), (i32::MAX - 1, i32::MAX - 1, ""), (-1, -1, ""), (-5, -9, "")]
    {
        let mut bytes = bytes.clone();
        for name in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
            let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4 + 8;
            bytes[at..at + 4].copy_from_slice(&i32::to_le_bytes(x));
            bytes[at + 4..at + 8].copy_from_slice(&i32::to_le_bytes(y));
        }
        let name = b"chunkCount\0int\0";
        let at = bytes.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
        bytes[at..at + 4].copy_from_slice(&i32::to_le_bytes(y / 16 + 1));
        fs::write(&path, &bytes).unwrap();
        let error = error_of(&path);
        assert!(error.contains(part), "{error}");
    }
    // the same for .hdr
    let hdr = dir.path().join("p.hdr");
    for (size, part) in [
        ("-Y 100000 +X 200000", "limit"),
        ("-Y 0 +X 0", "0 × 0"),
        ("-Y 8 +X 24", "24 × 8"),
        ("-Y 16 +X 32", "truncated"),
        ("", "damaged"),
    ] {
        fs::write(&hdr, format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\nabcd")).unwrap();
        let error = error_of(&hdr);
        assert!(error.contains(part) && error.contains("p.hdr"), "{size}: {error}");
    }
    fs::write(&path, b"").unwrap();
    assert!(error_of(&path).contains("empty"));
    assert!(matches!(Panorama::read(dir.path().join("missing.exr")), Err(Error::Io { .. })));
    assert!(error_of(dir.path()).contains("folder"));
    fs::write(&path, b"just text").unwrap();
    assert!(matches!(Panorama::read(&path), Err(Error::Unsupported { .. })));
}

/// Flips bytes of small files of several kinds; reading must return, whatever it returns.
#[test]
fn random_damage_never_panics() {
    let dir = folder();
    let image = sky(32, 16);
    let tiled = Encoding { blocks: Blocks::Tiles(Vec2(8, 8)), ..Encoding::FAST_LOSSLESS };
    let mut seeds: Vec<(PathBuf, Vec<u8>)> = Vec::new();
    for (name, compression) in
        [("piz", Compression::PIZ), ("pxr", Compression::PXR24), ("b44", Compression::B44)]
    {
        let path = dir.path().join(format!("{name}.exr"));
        exr_file(&path, (32, 16), rgb(&image), Encoding { compression, ..tiled }, |_, _| ());
        seeds.push((path, Vec::new()));
    }
    let plain = dir.path().join("plain.exr");
    image.write(&plain, &options(WriteFormat::Exr(Precision::Half))).unwrap();
    let hdr = dir.path().join("plain.hdr");
    image.write(&hdr, &options(WriteFormat::Hdr)).unwrap();
    seeds.extend([(plain, Vec::new()), (hdr, Vec::new())]);
    for (path, bytes) in &mut seeds {
        *bytes = fs::read(&*path).unwrap();
    }
    let mut state = 1u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let (mut refused, rounds) = (0, 1500);
    let damaged = dir.path().join("damaged");
    for _ in 0..rounds {
        let (_, good) = &seeds[random(seeds.len())];
        let mut bytes = good.clone();
        for _ in 0..=random(4) {
            // headers and tables are worth most of the attention
            let at = if random(3) > 0 { random(bytes.len().min(700)) } else { random(bytes.len()) };
            bytes[at] = [random(256) as u8, 0, 255, 128][random(4)];
        }
        if random(8) == 0 {
            bytes.truncate(random(bytes.len()));
        }
        fs::write(&damaged, &bytes).unwrap();
        refused += usize::from(Panorama::read(&damaged).is_err());
        let _ = attributes(&damaged);
    }
    assert!(
        refused > rounds / 4,
        "only {refused} of {rounds} were noticed: the damage does not reach the reader"
    );
}
