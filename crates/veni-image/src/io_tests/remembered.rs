//! What files remember beside their pixels: texts of any length, a digest of the pixels, a factor.

use std::fs;

use super::*;
use crate::provenance::Provenance;
use veni_light::output::Overwrite;

/// As long as a latent of dimension 300.
fn long() -> String {
    (0..400).map(|k| format!("[{k},{}]", k * k)).collect()
}

fn with(format: WriteFormat) -> WriteOptions {
    let mut with = options(format);
    with.attributes.insert("veni:latent".into(), long());
    with.attributes.insert("veni:frame".into(), "blender".into());
    with.overwrite = Overwrite::Replace;
    with
}

#[test]
fn no_header_line_is_longer_than_a_hundred_bytes_and_the_format_comes_first() {
    let dir = folder();
    let path = dir.path().join("sky.hdr");
    sky(16, 8).write(&path, &with(WriteFormat::Hdr)).unwrap();
    let bytes = fs::read(&path).unwrap();
    let end = bytes.windows(2).position(|w| w == b"\n\n").unwrap();
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    let lines: Vec<_> = header.lines().collect();
    assert_eq!(lines[..2], ["#?RADIANCE", "FORMAT=32-bit_rle_rgbe"]);
    assert!(lines.len() > 40 && lines.iter().all(|line| line.len() < 100), "{header}");
    assert!(lines.iter().any(|line| line.starts_with("veni:latent[01/")), "{header}");
    assert_eq!(attributes(&path).unwrap()["veni:latent"], long());
    // the form of before is read as well
    let old = header.lines().filter(|line| !line.starts_with("veni:latent[")).collect::<Vec<_>>().join("\n");
    let old = format!("{old}\nveni:latent={}", long());
    fs::write(&path, [old.as_bytes(), &bytes[end..]].concat()).unwrap();
    let back = Panorama::read(&path).unwrap();
    assert_eq!((&back.attributes()["veni:latent"], back.provenance()), (&long(), Provenance::Same));
}

#[test]
fn no_exr_text_is_longer_than_other_software_reads() {
    let dir = folder();
    let path = dir.path().join("sky.exr");
    sky(16, 8).write(&path, &with(WriteFormat::Exr(Precision::Half))).unwrap();
    let header = MetaData::read_from_file(&path, true).unwrap().headers.remove(0);
    let texts = header.own_attributes.other.iter().filter_map(|(name, value)| match value {
        AttributeValue::Text(text) => Some((name.to_string(), text.as_slice().len())),
        _ => None,
    });
    let texts: Vec<_> = texts.collect();
    assert!(texts.len() > 10 && texts.iter().all(|(_, length)| *length <= 255), "{texts:?}");
    let back = Panorama::read(&path).unwrap();
    assert_eq!((&back.attributes()["veni:latent"], back.provenance()), (&long(), Provenance::Same));
    assert_eq!(back.attributes()["colorInteropID"], "lin_rec709_scene");
}

#[test]
fn numbers_that_are_no_colours_name_no_colour_space() {
    let dir = folder();
    let path = dir.path().join("normals.exr");
    let mut with = options(WriteFormat::Exr(Precision::Float));
    with.colour = false;
    sky(16, 8).write(&path, &with).unwrap();
    let header = MetaData::read_from_file(&path, true).unwrap().headers.remove(0);
    assert_eq!(header.shared_attributes.chromaticities, None);
    assert!(!attributes(&path).unwrap().contains_key("colorInteropID"));
}

/// Every format: the pixels that come back are those that the digest is of, and one changed value is noticed.
#[test]
fn changed_pixels_are_noticed() {
    let dir = folder();
    let mut image = sky(40, 20);
    image.pixels_mut()[7] = [0.0, 1e-7, 65_000.0];
    for (name, format, range) in [
        ("half.exr", WriteFormat::Exr(Precision::Half), HalfRange::Factor(1.0)),
        ("scaled.exr", WriteFormat::Exr(Precision::Half), HalfRange::Factor(0.25)),
        ("float.exr", WriteFormat::Exr(Precision::Float), HalfRange::Refuse),
        ("sky.hdr", WriteFormat::Hdr, HalfRange::Refuse),
    ] {
        let path = dir.path().join(name);
        let with = WriteOptions { half_range: range, ..with(format) };
        image.write(&path, &with).unwrap();
        let same = Panorama::read(&path).unwrap();
        assert_eq!(same.provenance(), Provenance::Same, "{name}");
        assert_close(&image, &same, 0.01);
        // the same attributes over other pixels
        let mut said = same.attributes().clone();
        said.retain(|name, _| name != "software");
        let scaled = said.remove(RADIANCE_SCALE).is_some();
        let digest = said.remove("veni:pixels").unwrap();
        let mut edited = Panorama::new(same.grid(), same.pixels().to_vec());
        edited.scale(if scaled { 0.25 } else { 1.0 });
        edited.pixels_mut()[39][2] *= 1.5;
        let other = dir.path().join(format!("edited-{name}"));
        let with = WriteOptions { attributes: said.clone(), half_range: range, ..with.clone() };
        if format == WriteFormat::Hdr {
            edited.write(&other, &with).unwrap();
            let written = attributes(&other).unwrap()["veni:pixels"].clone();
            let bytes = fs::read(&other).unwrap();
            let at = bytes.windows(written.len()).position(|w| w == written.as_bytes()).unwrap();
            fs::write(&other, [&bytes[..at], digest.as_bytes(), &bytes[at + digest.len()..]].concat())
                .unwrap();
        } else {
            exr_file(&other, (40, 20), rgb(&edited), Encoding::FAST_LOSSLESS, |_, own| {
                for (name, value) in same.attributes().iter().filter(|(name, _)| *name != "software") {
                    own.other.insert(Text::from(name.as_str()), AttributeValue::Text(value.as_str().into()));
                }
            });
        }
        let changed = Panorama::read(&other).unwrap();
        assert_eq!(changed.provenance(), Provenance::Changed, "{name}");
        assert_eq!(scaled, name == "scaled.exr");
        // as they are stored: nothing is divided by a factor that these values never had
        assert_close(&edited, &changed, 0.01);
        assert_eq!(Panorama::new(image.grid(), image.pixels().to_vec()).provenance(), Provenance::Unrecorded);
    }
}

/// Other software stores the same values in another way: they are the same pixels.
#[test]
fn another_compression_and_sample_type_change_no_pixel() {
    let dir = folder();
    let (path, other) = (dir.path().join("half.exr"), dir.path().join("tiles.exr"));
    let with = WriteOptions { half_range: HalfRange::Factor(4.0), ..with(WriteFormat::Exr(Precision::Half)) };
    sky(40, 20).write(&path, &with).unwrap();
    let back = Panorama::read(&path).unwrap();
    let mut stored = back.clone();
    stored.scale(4.0);
    exr_file(&other, (40, 20), rgb(&stored), Encoding::FAST_LOSSLESS, |_, own| {
        for (name, value) in back.attributes().iter().filter(|(name, _)| *name != "software") {
            own.other.insert(Text::from(name.as_str()), AttributeValue::Text(value.as_str().into()));
        }
    });
    let again = Panorama::read(&other).unwrap();
    assert_eq!((again.provenance(), again.pixels()), (Provenance::Same, back.pixels()));
}

#[test]
fn what_is_said_of_the_values_cannot_be_said_twice() {
    let dir = folder();
    for name in [RADIANCE_SCALE, "veni:pixels", "colorInteropID", "veni:latent[1/2]"] {
        for format in [WriteFormat::Exr(Precision::Half), WriteFormat::Hdr] {
            let mut with = options(format);
            with.attributes.insert(name.into(), "2".into());
            let error = sky(16, 8).write(dir.path().join("a"), &with).unwrap_err().to_string();
            assert!(error.contains(name) && error.contains("not free"), "{error}");
        }
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}

/// The darkest that half precision keeps, and the next darker.
#[test]
fn half_precision_refuses_what_it_would_lose_at_the_dark_end() {
    let dir = folder();
    let path = dir.path().join("dark.exr");
    let mut image = sky(16, 8);
    let with = options(WriteFormat::Exr(Precision::Half));
    image.pixels_mut()[3] = [0.0, 6.103_515_6e-5, 65_504.0];
    image.write(&path, &with).unwrap();
    image.pixels_mut()[4] = [6.103e-5, 2e-9, 1.0];
    let with = WriteOptions { overwrite: Overwrite::Replace, ..with };
    let error = image.write(&path, &with).unwrap_err().to_string();
    assert!(error.contains("2 of 384 values") && error.contains("2.0e-9"), "{error}");
    // floats take them, and so does another unit
    image.write(&path, &WriteOptions { format: WriteFormat::Exr(Precision::Float), ..with.clone() }).unwrap();
    image.pixels_mut()[3][2] = 1.0;
    image.write(&path, &WriteOptions { half_range: HalfRange::Fit, ..with }).unwrap();
    assert_eq!(attributes(&path).unwrap()[RADIANCE_SCALE], "32");
    let back = Panorama::read(&path).unwrap();
    assert!((back.pixels()[4][0] / 6.103e-5 - 1.0).abs() < 5e-4);
}
