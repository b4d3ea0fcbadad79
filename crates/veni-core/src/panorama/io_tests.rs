//! Files: round trips, files of other software's habits, poisoned files, random damage.

use std::fs;
use std::path::{Path, PathBuf};

use exr::meta::BlockDescription;
use exr::meta::attribute::EnvironmentMap;
use exr::prelude::*;

use super::tonemap::Tonemap;
use super::*;
use crate::output::Overwrite;
use crate::{Error, sphere::Equirect};

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

#[test]
fn exr_float_is_exact_and_half_is_rounded() {
    let dir = folder();
    // 50 rows: the last ZIP block is not full
    let image = sky(100, 50);
    let (float, half) = (dir.path().join("f.exr"), dir.path().join("h.exr"));
    let mut with = options(WriteFormat::Exr(Precision::Float));
    with.attributes.insert("veni:latent".into(), "{\"n\": 9, \"name\": \"Zürich\"}".into());
    with.attributes.insert("comments".into(), "a test".into());
    image.write(&float, &with).unwrap();
    image.write(&half, &options(WriteFormat::Exr(Precision::Half))).unwrap();
    let back = Panorama::read(&float).unwrap();
    assert_eq!(back.pixels(), image.pixels());
    assert_eq!(back.attributes()["veni:latent"], "{\"n\": 9, \"name\": \"Zürich\"}");
    assert_eq!(&attributes(&float).unwrap(), back.attributes());
    assert_eq!(attributes(&float).unwrap()["comments"], "a test");
    assert!(attributes(&float).unwrap()["software"].starts_with("veni "));
    assert_close(&image, &Panorama::read(&half).unwrap(), 5e-4);
}

#[test]
fn the_same_image_gives_the_same_file() {
    let dir = folder();
    let mut with = options(WriteFormat::Exr(Precision::Half));
    for name in ["e", "d", "a", "c", "b"] {
        with.attributes.insert(name.into(), name.to_uppercase());
    }
    let write = |name: &str| {
        sky(16, 8).write(dir.path().join(name), &with).unwrap();
        fs::read(dir.path().join(name)).unwrap()
    };
    let first = write("0.exr");
    assert!((1..10).all(|k| write(&format!("{k}.exr")) == first));
}

#[test]
fn written_exr_has_the_promised_header() {
    let dir = folder();
    let path = dir.path().join("sky.exr");
    sky(64, 32).write(&path, &options(WriteFormat::Exr(Precision::Half))).unwrap();
    let header = MetaData::read_from_file(&path, true).unwrap().headers.remove(0);
    assert_eq!(header.own_attributes.environment_map, Some(EnvironmentMap::LatitudeLongitude));
    assert_eq!(header.compression, Compression::ZIP16);
    assert_eq!(header.line_order, LineOrder::Increasing);
    assert_eq!(header.blocks, BlockDescription::ScanLines);
    let chromaticities = header.shared_attributes.chromaticities.unwrap();
    assert_eq!((chromaticities.red, chromaticities.white), (Vec2(0.64, 0.33), Vec2(0.3127, 0.3290)));
    let names: Vec<String> = header.channels.list.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["B", "G", "R"]);
    // and the crate's own high-level reader sees the same pixels
    let other = read_first_rgba_layer_from_file(
        &path,
        |size, _| vec![[0f32; 3]; size.area()],
        |pixels, at, (r, g, b, _): (f32, f32, f32, f32)| pixels[at.1 * 64 + at.0] = [r, g, b],
    )
    .unwrap();
    assert_eq!(other.layer_data.channel_data.pixels, Panorama::read(&path).unwrap().pixels());
}

#[test]
fn half_range_is_refused_fitted_or_scaled_but_never_infinite() {
    let dir = folder();
    let mut image = sky(32, 16);
    image.pixels_mut()[37] = [300_000.0, 1.0, 2.0];
    let path = dir.path().join("bright.exr");
    let mut with = options(WriteFormat::Exr(Precision::Half));
    let refused = image.write(&path, &with).unwrap_err().to_string();
    assert!(refused.contains("(5, 1)") && refused.contains("300000"), "{refused}");
    assert!(!path.exists());
    with.half_range = HalfRange::Fit;
    image.write(&path, &with).unwrap();
    assert_eq!(attributes(&path).unwrap()[RADIANCE_SCALE], "0.125");
    assert_close(&image, &Panorama::read(&path).unwrap(), 5e-4);
    with.overwrite = Overwrite::Replace;
    with.half_range = HalfRange::Factor(0.01);
    image.write(&path, &with).unwrap();
    assert_close(&image, &Panorama::read(&path).unwrap(), 5e-4);
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        with.half_range = HalfRange::Factor(bad);
        assert!(image.write(&path, &with).is_err());
    }
    with.half_range = HalfRange::Fit;
    assert!(write_rows(&path, image.grid(), &with, |sink| sink.push(image.pixels())).is_err());
}

#[test]
fn rows_may_come_in_any_portions_and_must_all_come() {
    let dir = folder();
    let image = sky(64, 300);
    for (name, format) in [
        ("a.exr", WriteFormat::Exr(Precision::Float)),
        ("a.hdr", WriteFormat::Hdr),
        ("a.png", WriteFormat::Png(Tonemap::reference(&image))),
    ] {
        let (whole, parts) = (dir.path().join(name), dir.path().join(format!("parts-{name}")));
        image.write(&whole, &options(format)).unwrap();
        write_rows(&parts, image.grid(), &options(format), |sink| {
            let (mut rest, mut portion) = (image.pixels(), 1);
            while !rest.is_empty() {
                let (now, later) = rest.split_at((portion * 64).min(rest.len()));
                sink.push(now)?;
                (rest, portion) = (later, portion * 2 + 1);
            }
            Ok(())
        })
        .unwrap();
        assert_eq!(fs::read(&whole).unwrap(), fs::read(&parts).unwrap(), "{name}");
        let short = dir.path().join(format!("short-{name}"));
        let error =
            write_rows(&short, image.grid(), &options(format), |sink| sink.push(&image.pixels()[..64]));
        assert!(error.unwrap_err().to_string().contains("1 of 300 rows"));
        assert!(!short.exists());
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 6, "no unfinished file stays behind");
}

#[test]
fn hdr_round_trip_and_another_reader() {
    let dir = folder();
    for width in [4, 64, 256] {
        let image = sky(width, width / 2);
        let path = dir.path().join(format!("{width}.hdr"));
        let mut with = options(WriteFormat::Hdr);
        with.attributes.insert("LATENT".into(), "{\"n\": 9}".into());
        image.write(&path, &with).unwrap();
        // half a step of eight bits
        assert_close(&image, &Panorama::read(&path).unwrap(), 0.5 / 128.0 + 1e-6);
        assert_eq!(attributes(&path).unwrap()["LATENT"], "{\"n\": 9}");
        let other = image::open(&path).unwrap().into_rgb32f();
        let other = Panorama::new(image.grid(), other.pixels().map(|p| p.0).collect());
        assert_close(&image, &other, 0.5 / 128.0 + 1e-6);
    }
    let mut with = options(WriteFormat::Hdr);
    with.attributes.insert("a".into(), "two\nlines".into());
    assert!(sky(8, 4).write(dir.path().join("x.hdr"), &with).is_err());
}

#[test]
fn hdr_exposure_and_signature() {
    let dir = folder();
    let path = dir.path().join("e.hdr");
    for signature in ["#?RADIANCE", "#?RGBE"] {
        let mut file = format!("{signature}\nEXPOSURE=2\nEXPOSURE=4\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n")
            .into_bytes();
        file.extend([128, 64, 32, 129, 64, 64, 64, 130]);
        fs::write(&path, file).unwrap();
        let image = Panorama::read(&path).unwrap();
        assert_eq!(image.pixels(), [[0.125, 0.0625, 0.031_25], [0.125; 3]]);
    }
    let xyz = b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 2\n12345678";
    fs::write(&path, xyz).unwrap();
    assert!(matches!(Panorama::read(&path), Err(Error::Unsupported(_))));
}

#[test]
fn png_holds_what_the_tonemap_says() {
    let dir = folder();
    let path = dir.path().join("preview.png");
    let image = sky(64, 32);
    let map = Tonemap::filmic(&image, 0.0);
    image.write(&path, &options(WriteFormat::Png(map))).unwrap();
    let shown = image::open(&path).unwrap().into_rgb8();
    assert_eq!(shown.dimensions(), (64, 32));
    for (pixel, shown) in image.pixels().iter().zip(shown.pixels()) {
        assert_eq!(map.apply_u8(*pixel), shown.0);
    }
    // and limited range is refused on the way back, with the way out
    let error = Panorama::read(&path).unwrap_err();
    assert!(matches!(&error, Error::Unsupported(m) if m.contains("veni-cli prepare")), "{error}");
    fs::write(&path, b"\xFF\xD8\xFF\xE0rest of a JPEG").unwrap();
    assert!(matches!(Panorama::read(&path), Err(Error::Unsupported(m)) if m.contains("JPEG")));
}

#[test]
fn existing_files_and_bad_values_are_respected() {
    let dir = folder();
    let path = dir.path().join("kept.exr");
    fs::write(&path, b"precious").unwrap();
    let mut image = sky(8, 4);
    let mut with = options(WriteFormat::Exr(Precision::Half));
    assert!(image.write(&path, &with).unwrap_err().to_string().contains("exists already"));
    with.overwrite = Overwrite::Replace;
    for poison in [f32::NAN, f32::INFINITY] {
        image.pixels_mut()[9][1] = poison;
        let error = image.write(&path, &with).unwrap_err().to_string();
        assert!(error.contains("(1, 1)") && error.contains("kept.exr"), "{error}");
    }
    assert_eq!(fs::read(&path).unwrap(), b"precious");
    image.pixels_mut()[9][1] = -1.0;
    let error = image.write(dir.path().join("n.hdr"), &options(WriteFormat::Hdr)).unwrap_err().to_string();
    assert!(error.contains("(1, 1)"), "{error}");
    assert!(image.write(dir.path().join("nowhere/x.exr"), &with).is_err());
    assert!(WriteFormat::of("a.jpg", Tonemap::reference(&sky(4, 2))).is_err());
    assert_eq!(WriteFormat::of("a.HDR", Tonemap::reference(&sky(4, 2))).unwrap(), WriteFormat::Hdr);
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

#[test]
fn every_compression_tiles_and_line_orders() {
    let dir = folder();
    let image = sky(80, 40);
    let path = dir.path().join("c.exr");
    let tiles = Blocks::Tiles(Vec2(32, 24));
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
        Compression::B44A,
    ] {
        for (blocks, line_order) in [
            (Blocks::ScanLines, LineOrder::Increasing),
            (Blocks::ScanLines, LineOrder::Decreasing),
            (tiles, LineOrder::Increasing),
            (tiles, LineOrder::Unspecified),
        ] {
            exr_file(&path, (80, 40), rgb(&image), Encoding { compression, blocks, line_order }, |_, _| ());
            // PXR24 keeps 16 bits of a float's significand; the others are lossless for floats
            let tolerance = if compression == Compression::PXR24 { 2e-5 } else { 0.0 };
            assert_close(&image, &Panorama::read(&path).unwrap(), tolerance);
        }
    }
}

#[test]
fn windows_channels_layers_and_primaries_of_other_software() {
    let dir = folder();
    let path = dir.path().join("x.exr");
    let image = sky(16, 8);
    let plain = Encoding::FAST_LOSSLESS;
    // a display window elsewhere, equal to the data window
    exr_file(&path, (16, 8), rgb(&image), plain, |shared, own| {
        own.layer_position = Vec2(10, -20);
        shared.display_window.position = Vec2(10, -20);
    });
    assert_eq!(Panorama::read(&path).unwrap().pixels(), image.pixels());
    // a data window inside a larger display window: black around it
    exr_file(&path, (16, 8), rgb(&image), plain, |shared, own| {
        own.layer_position = Vec2(3, 2);
        shared.display_window = IntegerBounds::from_dimensions(Vec2(24, 12));
    });
    let padded = Panorama::read(&path).unwrap();
    assert_eq!(padded.grid(), Equirect::new(24, 12));
    assert_eq!((padded.pixel(3, 2), padded.pixel(18, 9)), (image.pixel(0, 0), image.pixel(15, 7)));
    assert_eq!((padded.pixel(2, 2), padded.pixel(19, 9)), ([0.0; 3], [0.0; 3]));
    // overscan: a data window larger than the display window is cut, in tiles too
    exr_file(&path, (16, 8), rgb(&image), plain, |shared, own| {
        own.layer_position = Vec2(-4, -2);
        shared.display_window = IntegerBounds::from_dimensions(Vec2(8, 4));
    });
    let cut = Panorama::read(&path).unwrap();
    assert_eq!((cut.pixel(0, 0), cut.pixel(7, 3)), (image.pixel(4, 2), image.pixel(11, 5)));
    // mixed sample types and an alpha that is ignored
    let uint = plane(&image, 2).iter().map(|v| v.round() as u32).collect::<Vec<_>>();
    let half = plane(&image, 0).iter().map(|&v| f16::from_f32(v)).collect::<Vec<_>>();
    let channels = vec![
        ("A", FlatSamples::F16(vec![f16::ZERO; 128])),
        ("R", FlatSamples::F16(half)),
        ("G", FlatSamples::F32(plane(&image, 1))),
        ("B", FlatSamples::U32(uint)),
    ];
    exr_file(&path, (16, 8), channels, plain, |_, _| ());
    let [r, g, b] = Panorama::read(&path).unwrap().pixel(9, 4);
    let [x, y, z] = image.pixel(9, 4);
    assert!((r - x).abs() < 5e-4 * x && g == y && b == z.round());
    // luminance alone
    exr_file(&path, (16, 8), vec![("Y", FlatSamples::F32(plane(&image, 1)))], plain, |_, _| ());
    assert_eq!(Panorama::read(&path).unwrap().pixel(5, 5), [image.pixel(5, 5)[1]; 3]);
    // no colour at all
    exr_file(&path, (16, 8), vec![("Z", FlatSamples::F32(plane(&image, 1)))], plain, |_, _| ());
    assert!(Panorama::read(&path).unwrap_err().to_string().contains("among: Z"));
    // a named main layer beside another; and two that nothing tells apart
    let named = |a: &'static str, b: &'static str| {
        let mut channels = Vec::new();
        for (layer, offset) in [(a, 0.0), (b, 1000.0)] {
            for (i, name) in ["R", "G", "B"].into_iter().enumerate() {
                let samples = plane(&image, i).iter().map(|v| v + offset).collect();
                channels.push((format!("{layer}.{name}"), FlatSamples::F32(samples)));
            }
        }
        let channels: Vec<_> = channels.iter().map(|(n, s)| (n.as_str(), s.clone())).collect();
        exr_file(&path, (16, 8), channels, plain, |_, _| ());
    };
    named("View.Combined", "View.Diffuse");
    assert_eq!(Panorama::read(&path).unwrap().pixels(), image.pixels());
    named("left", "right");
    assert!(Panorama::read(&path).unwrap_err().to_string().contains("\"left\", \"right\""));
    let pick = ReadOptions { layer: Some("left".into()), ..ReadOptions::default() };
    assert_eq!(Panorama::read_with(&path, &pick).unwrap().pixels(), image.pixels());
    // other primaries are converted, white stays white
    let grey = Panorama::new(image.grid(), vec![[0.5; 3]; 128]);
    exr_file(&path, (16, 8), rgb(&grey), plain, |shared, _| {
        let xy = [Vec2(0.713, 0.293), Vec2(0.165, 0.830), Vec2(0.128, 0.044), Vec2(0.321_68, 0.337_67)];
        let [red, green, blue, white] = xy;
        shared.chromaticities = Some(attribute::Chromaticities { red, green, blue, white });
    });
    assert_close(&grey, &Panorama::read(&path).unwrap(), 1e-5);
    // a cube map is no panorama
    exr_file(&path, (16, 8), rgb(&image), plain, |_, own| own.environment_map = Some(EnvironmentMap::Cube));
    assert!(matches!(Panorama::read(&path), Err(Error::Unsupported(m)) if m.contains("cube")));
}

fn error_of(path: &Path) -> String {
    let error = Panorama::read(path).unwrap_err();
    assert!(matches!(error, Error::Invalid(_)), "{error:?}");
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
    assert!(matches!(Panorama::read(&path), Err(Error::Unsupported(_))));
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
