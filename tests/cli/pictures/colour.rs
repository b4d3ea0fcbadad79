//! What pictures say of their numbers: colour spaces, transfer curves, profiles, gain maps, headers.

use super::*;

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
        ("EXPOSURE=2\n", "\r", 0.5),
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
    // what is said once is in the report, and is still there when nothing is examined again
    for _ in 0..2 {
        dir.ok(&["prepare", "zero.hdr", "-o", "said", "--size", "64x32", "--val", "0"]);
        let reported: Value =
            serde_json::from_slice(&std::fs::read(dir.path("said/report.json")).unwrap()).unwrap();
        assert_eq!(reported["files"][0]["notes"], facts["notes"]);
        let page = std::fs::read_to_string(dir.path("said/report.md")).unwrap();
        assert!(page.contains("## Worth knowing") && page.contains("zero.exr: EXPOSURE=0"), "{page}");
    }
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
