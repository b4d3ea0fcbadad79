//! Files made to end or fill a program: each costs itself only, and is named; memory follows the declared pixels.

use std::time::Duration;

use image::{Rgb, RgbImage};

use crate::util::{Dir, Run};

const PREPARE: [&str; 9] = ["prepare", "in", "-o", "data", "--size", "64", "--val", "0", "-q"];

/// A folder `in` with two panoramas that are fine.
fn folder() -> Dir {
    let dir = Dir::new();
    std::fs::create_dir(dir.path("in")).unwrap();
    for (name, shift) in [("a.png", 0), ("z.png", 90)] {
        let at = |x, y| Rgb([(30 + x + shift) as u8, (40 + 2 * y) as u8, (60 + (x * y + shift) % 50) as u8]);
        RgbImage::from_fn(64, 32, at).save(dir.path("in").join(name)).unwrap();
    }
    dir
}

/// `prepare` does the good files and names the bad one.
fn costs_itself(dir: &Dir, bad: &str, words: &[&str]) {
    let run = dir.run(&PREPARE);
    checked(dir, &run, bad, words);
    for good in ["a.exr", "z.exr"] {
        assert!(dir.path("data/train").join(good).is_file(), "{good}: {run:?}");
    }
    std::fs::remove_dir_all(dir.path("data")).unwrap();
    std::fs::remove_file(dir.path(bad)).unwrap();
}

fn checked(_: &Dir, run: &Run, bad: &str, words: &[&str]) {
    assert_eq!(run.code, Some(1), "{bad}: {run:?}");
    let line = run.err.lines().find(|line| line.contains(bad)).unwrap_or_else(|| panic!("{bad}: {run:?}"));
    for word in words {
        assert!(line.contains(word), "{bad}: '{word}' is missing in: {line}");
    }
    assert!(!run.err.contains("panicked"), "{bad}: {}", run.err);
}

fn chunk(name: &[u8; 4], body: &[u8]) -> Vec<u8> {
    let crc = !name.iter().chain(body).fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ ((sum & 1) * 0xEDB8_8320))
    });
    [&(body.len() as u32).to_be_bytes()[..], name, body, &crc.to_be_bytes()].concat()
}

/// A PNG of 16 × 8 pixels with indices, and these chunks before its pixels.
fn png(chunks: &[Vec<u8>]) -> Vec<u8> {
    let pixels = miniz_oxide::deflate::compress_to_vec_zlib(&[0; 17 * 8], 6);
    let header = chunk(b"IHDR", &[0, 0, 0, 16, 0, 0, 0, 8, 8, 3, 0, 0, 0]);
    let end = [chunk(b"IDAT", &pixels), chunk(b"IEND", &[])].concat();
    [&b"\x89PNG\r\n\x1a\n"[..], &header, &chunks.concat(), &end].concat()
}

/// A baseline JPEG of one shade, mid-grey or white, whose tables make a block of eight by eight equal pixels out of two zero
/// bits.
fn jpeg(width: u16, height: u16, white: bool) -> Vec<u8> {
    let quantisation = [&[0xFF, 0xDB, 0, 67, 0][..], &[1; 64]].concat();
    let [a, b] = height.to_be_bytes();
    let [c, d] = width.to_be_bytes();
    let frame = [0xFF, 0xC0, 0, 11, 8, a, b, c, d, 1, 1, 0x11, 0];
    // "0": as bright as the block before; "10": ten bits of difference follow
    let first = [&[0xFF, 0xC4, 0, 21, 0, 1, 1][..], &[0; 14], &[0, 10]].concat();
    // "0": no other frequency
    let others = [&[0xFF, 0xC4, 0, 20, 0x10, 1][..], &[0; 15], &[0]].concat();
    let scan = [0xFF, 0xDA, 0, 8, 1, 1, 0, 0, 63, 0];
    let blocks = usize::from(width).div_ceil(8) * usize::from(height).div_ceil(8);
    let mut data = vec![0; blocks.div_ceil(4)];
    if white {
        // 8 · 127
        data[..2].copy_from_slice(&[0b1011_1111, 0b1000_0000]);
        data.extend([0; 2]);
    }
    [&[0xFF, 0xD8], &quantisation[..], &frame, &first, &others, &scan, &data, &[0xFF, 0xD9]].concat()
}

#[test]
fn a_palette_on_which_the_decoder_panics() {
    let dir = folder();
    let bad = png(&[chunk(b"PLTE", &[1, 2, 3, 4])]);
    assert!(bad.len() < 100);
    dir.write("bad.png", &bad);
    dir.write("in/bad.png", &bad);
    costs_itself(&dir, "in/bad.png", &["palette of 4 bytes"]);
    let words = ["bad.png", "palette of 4 bytes"];
    #[cfg(feature = "pretrained")]
    for args in [
        &["fit", "bad.png", "--model", "27", "-o", "x.json", "-q"][..],
        &["fit", "in/a.png", "--mask", "bad.png", "--model", "27", "-o", "x.json", "-q"],
        &["fit", "in/a.png", "--normals", "bad.png", "--model", "27", "-o", "x.json", "-q"],
        &["encode", "bad.png", "--model", "27", "-o", "x.json", "-q"],
    ] {
        let said = dir.run(args);
        assert_eq!(said.code, Some(2), "{args:?}: {said:?}");
        // encode takes no formats of limited range, whatever is in them
        if args[0] == "fit" {
            dir.refused(args, &words);
        }
    }
    let _ = words;
}

#[test]
fn small_chunks_and_headers_that_grow() {
    let dir = folder();
    let palette = chunk(b"PLTE", &[0, 0, 0, 255, 255, 255]);
    let profile = miniz_oxide::deflate::compress_to_vec_zlib(&vec![0; 100 << 20], 1);
    let profile = [b"name\0\0", &profile[..]].concat();
    dir.write("in/profile.png", png(&[chunk(b"iCCP", &profile), palette.clone()]));
    costs_itself(&dir, "in/profile.png", &["colour profile", "limit of 16777216"]);
    dir.write("in/text.png", png(&[chunk(b"tEXt", b"a\0b").repeat(70_000), palette]));
    costs_itself(&dir, "in/text.png", &["chunks of metadata", "limit of 65536"]);
    dir.write("in/endless.hdr", [b"#?RADIANCE\n".to_vec(), vec![b'A'; 2 << 20]].concat());
    costs_itself(&dir, "in/endless.hdr", &["bytes of header", "limit of 1048576"]);
    let attribute = b"a\0int\0\x04\0\0\0\0\0\0\0".repeat(10_000);
    dir.write("in/many.exr", [&b"\x76\x2f\x31\x01\x02\0\0\0"[..], &attribute].concat());
    costs_itself(&dir, "in/many.exr", &["attributes of a part", "limit of 8192"]);
    let mut scans = jpeg(64, 32, false);
    scans.truncate(scans.len() - 2);
    scans.extend([0xFF, 0xDA, 0, 8, 1, 1, 0, 0, 63, 0].repeat(300));
    scans.extend([0xFF, 0xD9]);
    dir.write("in/scans.jpg", scans);
    costs_itself(&dir, "in/scans.jpg", &["scans", "limit of 256"]);
}

#[cfg(feature = "avif")]
#[test]
fn code_points_that_are_reserved() {
    let dir = folder();
    dir.write("in/bad.avif", include_bytes!("../../fuzz/corpus/avif/reserved-transfer"));
    costs_itself(&dir, "in/bad.avif", &["AVIF"]);
}

#[cfg(feature = "onnx")]
#[test]
fn networks_that_abort_or_never_end() {
    let dir = folder();
    for (name, bytes) in [
        ("alloc.onnx", &include_bytes!("../../fuzz/corpus/onnx/unchecked-length")[..]),
        ("hang.onnx", include_bytes!("../../fuzz/corpus/onnx/seeks-backwards")),
        ("name.onnx", include_bytes!("../../fuzz/corpus/onnx/long-name")),
    ] {
        dir.write(name, bytes);
        dir.refused(&[&PREPARE[..], &["--expand-with", name]].concat(), &[name, "not an ONNX model"]);
    }
}

/// A few bytes that declare very many pixels are read within the memory of those pixels, as large as the limits say.
#[cfg(target_os = "linux")]
#[test]
fn memory_follows_the_declared_pixels() {
    use veni_image::limits::{BYTES_PER_FILE, EXAMINE_BYTES_PER_PIXEL};
    for white in [false, true] {
        let dir = folder();
        let (width, height) = (4096, 2048);
        let bytes = jpeg(width, height, white);
        assert!(bytes.len() < 200_000, "{} bytes", bytes.len());
        dir.write("in/flat.jpg", &bytes);
        let (code, most) = watched(&dir, &PREPARE);
        // one value throughout is nothing to learn from: read, and then refused
        assert_eq!(code, Some(1));
        let pixels = u64::from(width) * u64::from(height);
        // the program itself, and the two other pictures
        let each = most.saturating_sub(BYTES_PER_FILE + (64 << 20)) as f64 / pixels as f64;
        eprintln!("{each:.1} bytes per pixel, {} MiB", most >> 20);
        assert!(each < EXAMINE_BYTES_PER_PIXEL as f64, "{} MiB, {each:.1} bytes per pixel", most >> 20);
        // the measure sees the pixels at all
        assert!(each > 20.0, "{each:.1} bytes per pixel");
    }
}

/// Runs to the end; the exit code, and the largest resident size that was seen, bytes.
#[cfg(target_os = "linux")]
fn watched(dir: &Dir, args: &[&str]) -> (Option<i32>, u64) {
    let mut child = dir.command(args).stdout(std::process::Stdio::null()).spawn().unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut most = 0;
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib = line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok());
        most = most.max(1024 * kib.unwrap_or(0));
        if let Some(status) = child.try_wait().unwrap() {
            return (status.code(), most);
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// With little memory, several large files are read one after the other; one that is too large is refused by name, and the
/// rest is done. Without burn only: its allocator reserves address space far beyond what it uses.
#[cfg(all(target_os = "linux", not(feature = "learn")))]
#[test]
fn large_files_take_turns_and_a_larger_one_is_refused() {
    let limited = |dir: &Dir, kib: u64| {
        let mut command = std::process::Command::new("sh");
        command.args(["-c", &format!("ulimit -v {kib}; exec \"$0\" \"$@\""), env!("CARGO_BIN_EXE_veni-cli")]);
        command.args(PREPARE).current_dir(dir.path("."));
        crate::util::finish(&mut command)
    };
    // 8,388,608 pixels: 352 MiB each, two of which do not fit
    let dir = folder();
    for (k, name) in ["in/b.hdr", "in/c.hdr", "in/d.hdr"].into_iter().enumerate() {
        dir.write(name, hdr(4096, 2048, k + 2));
    }
    let run = limited(&dir, 740 << 10);
    for name in ["b.exr", "c.exr", "d.exr"] {
        assert!(dir.path("data/train").join(name).is_file(), "{name}: {run:?}");
    }
    dir.write("in/huge.hdr", hdr(16384, 8192, 2));
    std::fs::remove_dir_all(dir.path("data")).unwrap();
    let run = limited(&dir, 740 << 10);
    checked(&dir, &run, "in/huge.hdr", &["need 5152 MiB of memory", "MiB are available"]);
    assert!(dir.path("data/train/d.exr").is_file(), "{run:?}");
}

/// A Radiance file in bands, light and dark, in runs of 127 equal bytes.
#[cfg(all(target_os = "linux", not(feature = "learn")))]
fn hdr(width: usize, height: usize, bands: usize) -> Vec<u8> {
    let mut file = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    for y in 0..height {
        let value = if (bands * y / height).is_multiple_of(2) { 200 } else { 90 };
        file.extend([2, 2, (width >> 8) as u8, (width & 255) as u8]);
        for channel in [value, value, value, 129] {
            let mut left = width;
            while left > 0 {
                let run = left.min(127);
                file.extend([128 + run as u8, channel]);
                left -= run;
            }
        }
    }
    file
}

/// A model whose tensors are a few kB, and whose configuration asks for gigabytes.
#[cfg(target_os = "linux")]
#[test]
fn a_small_model_that_asks_for_much() {
    let dir = folder();
    for (from, to, words) in [
        ("\"stripes\":16,\"samples\":32", "\"stripes\":65536,\"samples\":32768", "samples"),
        (
            "\"stripes\":16,\"samples\":32,\"channels\":8",
            "\"stripes\":32768,\"samples\":32,\"channels\":1024",
            "buffers",
        ),
        ("\"latent_vectors\":4", "\"latent_vectors\":400000", "latent_vectors"),
    ] {
        let file = model(from, to);
        assert!(file.len() < 60_000, "{} bytes", file.len());
        dir.write("bad.safetensors", file);
        let args = ["inspect", "bad.safetensors"];
        dir.refused(&args, &["bad.safetensors", words]);
        let (code, most) = watched(&dir, &args);
        assert!(code == Some(2) && most < 256 << 20, "{code:?}, {} MiB", most >> 20);
    }
}

/// A small model with an encoder, with one replacement in its header.
#[cfg(target_os = "linux")]
fn model(from: &str, to: &str) -> Vec<u8> {
    use veni_light::model::{
        Array, EncoderConfig, Model, ModelConfig, ModelInfo, StoredType, decoder_schema,
    };
    let encoder = EncoderConfig {
        stripes: 16,
        samples: Some(32),
        channels: 8,
        depth: 1,
        heads: 1,
        head_channels: 4,
        ..EncoderConfig::default()
    };
    let mut config = ModelConfig { encoder: Some(encoder), ..ModelConfig::decode_only(4) };
    (config.decoder.hidden, config.decoder.layers, config.decoder.heads) = (8, 1, 1);
    let schema =
        decoder_schema(&config).into_iter().chain(veni_fit::encoder::encoder_schema(&config).unwrap());
    let zeros = |shape: Vec<usize>| Array { data: vec![0.0; shape.iter().product()], shape };
    let tensors = schema.map(|(name, shape)| (name, zeros(shape))).collect();
    let bytes = Model::new(config, tensors, ModelInfo::default()).unwrap().to_bytes(StoredType::F16).unwrap();
    let (length, rest) = bytes.split_first_chunk().unwrap();
    let (header, data) = rest.split_at(u64::from_le_bytes(*length) as usize);
    // JSON within JSON
    let escape = |text: &str| text.replace('"', "\\\"");
    let header = std::str::from_utf8(header).unwrap().trim_end();
    assert!(header.contains(&escape(from)), "{header}");
    let mut header = header.replace(&escape(from), &escape(to)).into_bytes();
    header.resize(header.len().next_multiple_of(8), b' ');
    [&(header.len() as u64).to_le_bytes()[..], &header, data].concat()
}
