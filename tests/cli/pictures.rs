//! Pictures as other programs write them: what they say of their numbers, layers and holes, by every command.

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

#[test]
fn colour_spaces_of_exr_are_applied_or_refused_by_name() {
    let dir = Dir::new();
    let named = |name: &str, id: &'static str| {
        plain(&dir.path(name), rgb("", 1.0), |own| {
            own.other.insert("colorInteropID".into(), exr::meta::attribute::AttributeValue::Text(id.into()));
        });
    };
    named("ref.exr", "lin_rec709_scene");
    named("ap1.exr", "lin_ap1_scene");
    named("srgb.exr", "srgb_rec709_scene");
    named("log.exr", "acescct_ap1_scene");
    let [r, g, b] = means(&prepared(&dir, "ref.exr", "64x32", &[]).0.unwrap());
    // ACEScg to linear Rec. 709, as published with ACES
    let expected = [
        1.705_05 * r - 0.621_79 * g - 0.083_26 * b,
        -0.130_26 * r + 1.140_80 * g - 0.010_55 * b,
        -0.024_00 * r - 0.128_97 * g + 1.152_97 * b,
    ];
    near(means(&prepared(&dir, "ap1.exr", "64x32", &[]).0.unwrap()), expected);
    assert!(mean(&dir, &["srgb.exr"]) > 10.0 * mean(&dir, &["ref.exr"]), "40 by the sRGB curve is 7,000");
    dir.refused(&["encode", "log.exr", "-q"], &["log.exr", "colorInteropID", "acescct_ap1_scene"]);
    dir.refused(&["fit", "log.exr", "-q"], &["acescct_ap1_scene"]);
    dir.refused(&["render-probe", "log.exr", "-o", "ball.exr", "-q"], &["acescct_ap1_scene"]);
}

#[test]
fn radiance_headers_are_obeyed() {
    let dir = Dir::new();
    dir.write("ref.hdr", hdr("", "\n"));
    let plain = mean(&dir, &["ref.hdr"]);
    for (lines, end, factor) in [
        ("EXPOSURE=2\nEXPOSURE=4\n", "\n", 0.125),
        ("GAMMA=1\nEXPOSURE=0\n", "\n", 1.0),
        ("COLORCORR=2 2 2\n", "\n", 0.5),
        ("PRIMARIES=0 0 0 0 0 0 0 0\n", "\n", 1.0),
        ("", "\r\n", 1.0),
    ] {
        dir.write("a.hdr", hdr(lines, end));
        let found = mean(&dir, &["a.hdr"]);
        assert!((found / plain / factor - 1.0).abs() < 1e-4, "{lines:?}: {found} for {plain}");
    }
    dir.write("zero.hdr", hdr("EXPOSURE=0\n", "\n"));
    let run = dir.run(&["encode", "zero.hdr"]);
    assert!(run.code == Some(0) && run.err.contains("zero.hdr: EXPOSURE=0"), "{run:?}");
    let facts = one(&dir, &["inspect", "zero.hdr"]);
    let notes = facts["notes"].as_array().unwrap();
    assert!(notes.len() == 1 && notes[0].as_str().unwrap().contains("EXPOSURE=0"), "{facts}");
    // Display P3 to linear Rec. 709 (CSS Color 4, 10.1)
    dir.write("wide.hdr", hdr("PRIMARIES=0.68 0.32 0.265 0.69 0.15 0.06 0.3127 0.329\n", "\n"));
    let [r, g, b] = means(&prepared(&dir, "ref.hdr", "64x32", &[]).0.unwrap());
    let expected = [
        1.224_94 * r - 0.224_94 * g,
        -0.042_06 * r + 1.042_06 * g,
        -0.019_64 * r - 0.078_64 * g + 1.098_27 * b,
    ];
    near(means(&prepared(&dir, "wide.hdr", "64x32", &[]).0.unwrap()), expected);
    dir.write("odd.hdr", hdr("PRIMARIES=1 2 3\n", "\n"));
    dir.refused(&["encode", "odd.hdr", "-q"], &["odd.hdr", "PRIMARIES=1 2 3"]);
}

/// CRC-32 of PNG chunks (ISO 3309), bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 })
    })
}

/// A PNG of 16 bits with a chunk behind its header.
fn png(name: &[u8; 4], content: &[u8], code: impl Fn(f32) -> f32) -> Vec<u8> {
    let image = image::ImageBuffer::from_fn(WIDTH as u32, HEIGHT as u32, |x, y| {
        image::Rgb(sky(x as usize, y as usize).map(|v| (65535.0 * code(v).clamp(0.0, 1.0)).round() as u16))
    });
    let mut bytes = Vec::new();
    image::DynamicImage::ImageRgb16(image)
        .write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png)
        .unwrap();
    let body = [name.as_slice(), content].concat();
    let mut chunk = u32::try_from(content.len()).unwrap().to_be_bytes().to_vec();
    chunk.extend(&body);
    chunk.extend(crc(&body).to_be_bytes());
    bytes.splice(33..33, chunk);
    bytes
}

/// SMPTE ST 2084 of luminance in units of 203 cd/m².
fn pq(v: f32) -> f32 {
    let y = (f64::from(v) * 203.0 / 10_000.0).powf(2610.0 / 16384.0);
    let (c1, c2, c3) = (3424.0 / 4096.0, 2413.0 / 128.0, 2392.0 / 128.0);
    ((c1 + c2 * y) / (1.0 + c3 * y)).powf(2523.0 / 32.0) as f32
}

#[test]
fn png_files_are_decoded_by_the_curve_they_state() {
    let dir = Dir::new();
    plain(&dir.path("ref.exr"), rgb("", 1.0), |_| ());
    let expected = means(&prepared(&dir, "ref.exr", "64x32", &[]).0.unwrap());
    // high dynamic range: no expansion, and for every command that reads radiance
    dir.write("pq.png", png(b"cICP", &[1, 16, 0, 1], pq));
    near(means(&prepared(&dir, "pq.png", "64x32", &["--expand", "off"]).0.unwrap()), expected);
    let latent = |name: &str| one(&dir, &["encode", name])["latent"]["exposure"].as_f64().unwrap();
    assert!((latent("pq.png") - latent("ref.exr")).abs() < 0.01);
    dir.ok(&["render-probe", "pq.png", "-o", "ball.exr", "--size", "16", "-q"]);
    assert!((mean(&dir, &["pq.png"]) / mean(&dir, &["ref.exr"]) - 1.0).abs() < 0.01);
    // linear, of a display's range
    dir.write("linear.png", png(b"gAMA", &100_000u32.to_be_bytes(), |v| v / 50.0));
    let (found, _) = prepared(&dir, "linear.png", "64x32", &[]);
    near(means(&found.unwrap()).map(|v| 50.0 * v), expected);
    dir.write("odd.png", png(b"cICP", &[1, 9, 0, 1], |v| v));
    dir.refused(&["fit", "odd.png", "-q"], &["odd.png", "cICP", "9"]);
}

#[test]
fn profiles_are_applied() {
    let dir = Dir::new();
    for name in ["icc_p3.png", "icc_p3.jpg"] {
        dir.write(name, file(name));
        let (found, _) = prepared(&dir, name, "128x64", &[]);
        near(means(&found.unwrap()), [0.242, 0.307, 0.415]);
        let facts = one(&dir, &["inspect", name]);
        assert!(facts["values"].as_str().unwrap().contains("other primaries"), "{facts}");
    }
}

#[test]
fn parts_of_panoramas_are_placed_or_refused() {
    let dir = Dir::new();
    for name in ["gpano_crop.jpg", "gpano_full.jpg"] {
        dir.write(name, file(name));
    }
    let (none, run) = prepared(&dir, "gpano_crop.jpg", "128x64", &[]);
    assert!(none.is_none() && run.code != Some(0), "{run:?}");
    assert!(format!("{}{}", run.out, run.err).contains("75 % of it are unknown"), "{run:?}");
    assert!(prepared(&dir, "gpano_full.jpg", "128x64", &[]).0.is_some());
    let fitted = |name: &str| one(&dir, &["fit", name, "--steps", "5"])["known_share"].as_f64().unwrap();
    assert!((fitted("gpano_full.jpg") - 1.0).abs() < 1e-3);
    // half of the circle between 45° above and below: sin 45° / 2
    let share = fitted("gpano_crop.jpg");
    assert!((share - 0.5f64.sqrt() / 2.0).abs() < 0.01, "{share}");
    let run = dir.run(&["fit", "gpano_crop.jpg", "--steps", "2"]);
    assert!(run.err.contains("is a part, at (64, 32), of a panorama of 256 × 128"), "{run:?}");
    // what a photograph says of itself is not asked
    let run = dir.run(&["fit", "gpano_crop.jpg", "--fov", "60", "--steps", "2"]);
    assert!(run.code == Some(0) && run.err.contains("ignored"), "{run:?}");
    let facts = one(&dir, &["inspect", "gpano_crop.jpg"]);
    assert!((facts["unknown"].as_f64().unwrap() - 0.75).abs() < 1e-9, "{facts}");
}

fn xmp(properties: &str) -> Vec<u8> {
    let packet = format!(
        "http://ns.adobe.com/xap/1.0/\0<rdf:Description xmlns:hdrgm='http://ns.adobe.com/hdr-gain-map/1.0/' {properties}/>"
    );
    [&[0xFF, 0xE1][..], &u16::try_from(packet.len() + 2).unwrap().to_be_bytes(), packet.as_bytes()].concat()
}

fn jpeg(image: image::DynamicImage, properties: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    image.write_with_encoder(image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 100)).unwrap();
    bytes.splice(2..2, xmp(properties));
    bytes
}

#[test]
fn gain_maps_make_high_dynamic_range_or_are_named() {
    let dir = Dir::new();
    let shown = |x: u32, y: u32| {
        image::Rgb(
            sky(x as usize, y as usize)
                .map(|v| (255.0 * veni_image::tonemap::srgb(v.min(1.0))).round() as u8),
        )
    };
    let base =
        image::DynamicImage::ImageRgb8(image::ImageBuffer::from_fn(WIDTH as u32, HEIGHT as u32, shown));
    // log2 of how much is missing, over 6 stops
    let map =
        image::DynamicImage::ImageRgb8(image::ImageBuffer::from_fn(WIDTH as u32, HEIGHT as u32, |x, y| {
            image::Rgb(sky(x as usize, y as usize).map(|v| (255.0 * v.max(1.0).log2() / 6.0).round() as u8))
        }));
    let second = "hdrgm:GainMapMin='0' hdrgm:GainMapMax='6' hdrgm:OffsetSDR='0' hdrgm:OffsetHDR='0'";
    dir.write("hdr.jpg", [jpeg(base, "hdrgm:Version='1.0'"), jpeg(map, second)].concat());
    plain(&dir.path("ref.exr"), rgb("", 1.0), |_| ());
    let (found, run) = prepared(&dir, "hdr.jpg", "64x32", &["--expand", "off"]);
    let expected = prepared(&dir, "ref.exr", "64x32", &[]).0.unwrap();
    let off = means(&found.unwrap())
        .iter()
        .zip(means(&expected))
        .fold(0f32, |m, (a, b)| m.max((a / b - 1.0).abs()));
    assert!(off < 0.05, "{off}");
    assert!(run.err.contains("gain map is applied"), "{run:?}");
    dir.write("named.jpg", file("ultrahdr.jpg"));
    for args in [
        &["fit", "named.jpg", "--steps", "2"][..],
        &["prepare", "named.jpg", "-o", "other", "--size", "64x32"],
    ] {
        let run = dir.run(args);
        assert!(run.code == Some(0) && run.err.contains("gain map"), "{run:?}");
    }
}

#[test]
fn layers_are_chosen_by_name_and_vectors_are_none() {
    let dir = Dir::new();
    let stereo = || vec![layer("left", rgb("", 1.0), |_| ()), layer("right", rgb("", 3.0), |_| ())];
    exr(&dir.path("stereo.exr"), stereo(), (WIDTH, HEIGHT));
    plain(&dir.path("ref.exr"), rgb("", 1.0), |_| ());
    let vector = |prefix: &str| ["X", "Y", "Z"].map(|n| (format!("{prefix}{n}"), vec![0.5; WIDTH * HEIGHT]));
    plain(
        &dir.path("karma.exr"),
        [rgb("C.", 1.0), rgb("albedo.", 9.0), vector("N.").to_vec()].concat(),
        |_| (),
    );
    plain(
        &dir.path("blender.exr"),
        [rgb("View.Combined.", 1.0), rgb("View.Diffuse.", 9.0), vector("View.Normal.").to_vec()].concat(),
        |_| (),
    );
    plain(
        &dir.path("prefix.exr"),
        [rgb("HDR.", 1.0), rgb("N.", 9.0), vector("Position.").to_vec()].concat(),
        |_| (),
    );
    plain(&dir.path("views.exr"), [rgb("A.Combined.", 1.0), rgb("B.Combined.", 3.0)].concat(), |_| ());
    plain(&dir.path("vectors.exr"), vector("N.").to_vec(), |_| ());
    let expected = mean(&dir, &["ref.exr"]);
    let is = |args: &[&str], factor: f64| {
        let found = mean(&dir, args);
        assert!((found / expected / factor - 1.0).abs() < 1e-4, "{args:?}: {found} for {expected}");
    };
    for name in ["karma.exr", "blender.exr", "prefix.exr"] {
        is(&[name], 1.0);
    }
    is(&["stereo.exr", "--layer", "right"], 3.0);
    is(&["views.exr", "--layer", "B.Combined"], 3.0);
    // every command names the layers and the option, and has it
    for (args, more) in [
        (&["encode", "stereo.exr"][..], &[][..]),
        (&["fit", "stereo.exr"], &["--steps", "2"]),
        (&["inspect", "stereo.exr"], &[]),
        (&["bake", "stereo.exr", "-o", "b.exr"], &["--size", "16", "--device", "cpu"]),
        (&["render-probe", "stereo.exr", "-o", "p.exr"], &["--size", "16"]),
    ] {
        dir.refused(&[args, more, &["-q"]].concat(), &["stereo.exr", "\"left\", \"right\"", "--layer NAME"]);
        dir.refused(
            &[args, more, &["--layer", "middle", "-q"]].concat(),
            &["\"middle\"", "\"left\", \"right\""],
        );
        dir.ok(&[args, more, &["--layer", "left", "-q"]].concat());
    }
    let run = prepared(&dir, "stereo.exr", "64x32", &[]).1;
    assert!(format!("{}{}", run.out, run.err).contains("--layer NAME"), "{run:?}");
    let [r, ..] = means(&prepared(&dir, "stereo.exr", "64x32", &["--layer", "right"]).0.unwrap());
    let [wanted, ..] = means(&prepared(&dir, "ref.exr", "64x32", &[]).0.unwrap());
    assert!((r / wanted / 3.0 - 1.0).abs() < 0.01);
    dir.refused(&["encode", "vectors.exr", "-q"], &["vectors.exr", "N.X, N.Y, N.Z", "vectors"]);
}

#[test]
fn what_is_transparent_or_not_stored_is_unknown() {
    let dir = Dir::new();
    let below = |y: usize| y >= 28;
    // an eighth is transparent at the nadir; the rest is stored times its alpha of a half
    let alpha: Vec<f32> = (0..WIDTH * HEIGHT).map(|at| if below(at / WIDTH) { 0.0 } else { 0.5 }).collect();
    let mut channels = rgb("", 1.0);
    for (_, values) in &mut channels {
        values.iter_mut().zip(&alpha).for_each(|(v, a)| *v *= a);
    }
    channels.push(("A".to_owned(), alpha));
    plain(&dir.path("alpha.exr"), channels, |_| ());
    exr(
        &dir.path("crop.exr"),
        vec![layer("", rgb("", 1.0), |own| own.layer_position = Vec2(32, 0))],
        (128, 64),
    );
    plain(&dir.path("ref.exr"), rgb("", 1.0), |_| ());
    for (name, percent) in [("alpha.exr", "12"), ("crop.exr", "75")] {
        let (none, run) = prepared(&dir, name, "64x32", &[]);
        let said = format!("{}{}", run.out, run.err);
        assert!(none.is_none() && said.contains(&format!("{percent} % of it are unknown")), "{name}: {said}");
        for args in [&["encode", name][..], &["render-probe", name, "-o", "p.exr", "--size", "16", "--force"]]
        {
            let run = dir.run(args);
            assert!(run.code == Some(0) && run.err.contains("% of it are unknown"), "{run:?}");
        }
        let share = one(&dir, &["fit", name, "--steps", "2"])["known_share"].as_f64().unwrap();
        assert!(share < 0.99, "{name}: {share}");
        assert!(one(&dir, &["inspect", name])["unknown"].as_f64().unwrap() > 0.12);
    }
    // divided by alpha: the sky is as bright as the whole one, and what is filled is no black hole
    let exposure = |name: &str| one(&dir, &["encode", name])["latent"]["exposure"].as_f64().unwrap();
    assert!((exposure("alpha.exr") - exposure("ref.exr")).abs() < 0.02);
    // less than one pixel in a hundred is filled
    let mut channels = rgb("", 1.0);
    channels.push(("A".to_owned(), (0..WIDTH * HEIGHT).map(|at| if at < 16 { 0.0 } else { 1.0 }).collect()));
    plain(&dir.path("hole.exr"), channels, |_| ());
    let filled = prepared(&dir, "hole.exr", "64x32", &[]).0.unwrap();
    assert!(filled.pixel(3, 0)[0] > 0.1, "{:?}", filled.pixel(3, 0));
}

#[test]
fn a_damaged_palette_costs_its_own_file_only() {
    let dir = Dir::new();
    std::fs::create_dir(dir.path("in")).unwrap();
    dir.write("plte4.png", file("plte4.png"));
    dir.write("in/plte4.png", file("plte4.png"));
    plain(&dir.path("in/ref.exr"), rgb("", 1.0), |_| ());
    plain(&dir.path("ref.exr"), rgb("", 1.0), |_| ());
    let words = ["plte4.png", "palette of 4 bytes"];
    dir.refused(&["fit", "plte4.png", "-q"], &words);
    dir.refused(&["fit", "ref.exr", "--mask", "plte4.png", "-q"], &words);
    dir.refused(&["fit", "ref.exr", "--normals", "plte4.png", "-o", "light.json", "-q"], &words);
    let run = dir.run(&["prepare", "in", "-o", "data", "--size", "64x32", "--val", "0"]);
    assert_eq!(run.code, Some(1), "{run:?}");
    assert!(run.err.contains("palette of 4 bytes") && dir.path("data/train/ref.exr").is_file(), "{run:?}");
}

#[cfg(feature = "avif")]
#[test]
fn reserved_code_points_are_one_error() {
    let dir = Dir::new();
    dir.write("trc.avif", file("avif-trc.avif"));
    dir.refused(&["fit", "trc.avif", "-q"], &["trc.avif"]);
}

#[test]
fn what_a_picture_of_a_display_says_is_shown() {
    let dir = Dir::new();
    dir.write("sky.png", png(b"sRGB", &[0], |v| veni_image::tonemap::srgb(v.min(1.0))));
    let facts = one(&dir, &["inspect", "sky.png"]);
    assert_eq!(
        (&facts["size"], &facts["values"]),
        (&serde_json::json!([64, 32]), &"sRGB curve, Rec. 709 primaries".into())
    );
    dir.refused(&["encode", "sky.png", "-q"], &["PNG", "prepare"]);
    assert!(!text(&dir.path("sky.png")).is_empty());
}
