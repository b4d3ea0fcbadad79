//! What is written comes back.

use std::fs;

use exr::meta::BlockDescription;
use exr::prelude::*;

use super::super::tonemap::Tonemap;
use super::super::*;
use super::{assert_close, folder, options, sky};
use crate::Error;
use veni_light::output::Overwrite;

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
    // samples are at the centres of pixels, not on the edges as OpenEXR means by latlong
    assert_eq!(header.own_attributes.environment_map, None);
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
    fs::write(&path, b"#?RADIANCE\nFORMAT=32-bit_rle_abcd\n\n-Y 1 +X 2\n12345678").unwrap();
    assert!(
        matches!(Panorama::read(&path), Err(Error::Unsupported { message, .. }) if message.contains("32-bit_rle_abcd"))
    );
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
    assert!(matches!(error, Error::LowRange { format: "PNG", .. }), "{error}");
    // unless there is something else to be said of it
    fs::write(&path, b"\xFF\xD8\xFF\xE0rest of a JPEG").unwrap();
    let error = Panorama::read(&path).unwrap_err();
    assert!(matches!(error, Error::Invalid { .. }) && error.to_string().contains("JPEG"), "{error}");
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
