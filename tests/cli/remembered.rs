//! What files remember beside their pixels is believed only of the pixels it was written with.

use std::collections::BTreeMap;
use std::path::Path;

use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, WritableImage, f16};
use serde_json::Value;
use veni_image::{Panorama, Provenance, RADIANCE_SCALE, attributes};

use crate::readers;
use crate::util::{Dir, file, panoramas};

/// Other software: reads every sample and attribute, changes the samples, keeps the attributes, writes without compression.
fn edit(from: &Path, to: &Path, change: impl Fn(f32) -> f32) {
    let read = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
    let mut image = read.all_layers().all_attributes().from_file(from).unwrap();
    for layer in &mut image.layer_data {
        layer.encoding.compression = exr::prelude::Compression::Uncompressed;
        for channel in &mut layer.channel_data.list {
            match &mut channel.sample_data {
                FlatSamples::F16(all) => all.iter_mut().for_each(|v| *v = f16::from_f32(change(v.to_f32()))),
                FlatSamples::F32(all) => all.iter_mut().for_each(|v| *v = change(*v)),
                FlatSamples::U32(_) => panic!("an image of integers"),
            }
        }
    }
    image.write().to_file(to).unwrap();
}

fn latent(dir: &Dir, args: &[&str]) -> Value {
    let [value] = &dir.json(args)[..] else { panic!("one object of {args:?}") };
    value["latent"].clone()
}

/// The latent that `bake` takes, and what it says on stderr.
fn baked(dir: &Dir, name: &str) -> (Value, String) {
    let run = dir.run(&["bake", name, "-o", "again.exr", "--size", "64", "--force", "--json"]);
    assert_eq!(run.code, Some(0), "{}", run.err);
    let value: Value = serde_json::from_str(&run.out).unwrap();
    (value["latent"].clone(), run.err)
}

/// Made by an older version, which recorded no digest, then times 10 by OpenImageIO, which kept the attributes.
#[test]
fn an_image_of_an_older_version_that_was_edited_is_encoded() {
    let dir = Dir::new();
    let edited = file("edited_elsewhere.exr");
    let run = dir.run(&["bake", &edited, "-o", "again.exr", "--size", "64x32"]);
    assert_eq!(run.code, Some(0), "{}", run.err);
    assert!(run.err.contains("edited_elsewhere.exr") && run.err.contains("changed"), "{}", run.err);
    assert!(run.err.contains("was encoded"), "{}", run.err);
    // ten times as bright as what the latent inside gives
    let mean = |pixels: &[[f32; 3]]| pixels.iter().flatten().sum::<f32>() / (3 * pixels.len()) as f32;
    let (given, made) = (Panorama::read(&edited).unwrap(), readers::exr(&dir.path("again.exr")));
    let ratio = mean(&made.pixels) / mean(given.pixels());
    assert!((0.7..1.4).contains(&ratio), "{ratio}");
    let (latent, _) = baked(&dir, &edited);
    assert_eq!(latent, self::latent(&dir, &["encode", &edited]));
    assert_eq!(latent["source"], "edited_elsewhere.exr");
}

/// Older versions: the latent on one line or in one text, no digest. It is decoded again, and it is that of the pixels.
#[test]
fn images_of_older_versions_are_baked_from_their_latents() {
    let dir = Dir::new();
    for name in ["one_line_27.hdr", "one_line_300.hdr", "one_text_300.exr"] {
        let path = file(name);
        let (latent, said) = baked(&dir, &path);
        let stored: Value = serde_json::from_str(&attributes(&path).unwrap()["veni:latent"]).unwrap();
        assert_eq!(latent, stored, "{name}");
        assert!(!said.contains("changed"), "{said}");
        assert_eq!(latent["source"], "seed 7");
    }
    // another latent of the same model in its place is not that of the pixels
    let bytes = std::fs::read(file("one_line_27.hdr")).unwrap();
    let at = bytes.windows(12).position(|w| w == b"-0.41010714,").unwrap();
    dir.write("other.hdr", [&bytes[..at], b" 0.91010714,", &bytes[at + 12..]].concat());
    let (latent, said) = baked(&dir, "other.hdr");
    assert!(said.contains("changed") && latent["source"] == "other.hdr", "{said}");
}

#[test]
fn an_image_that_was_edited_is_encoded_and_one_that_was_only_stored_again_is_not() {
    let dir = Dir::new();
    let bake = |extra: &[&str]| dir.ok(&[&["bake", "--seed", "7", "--size", "64", "-q"], extra].concat());
    bake(&["-o", "half.exr", "-o", "sky.hdr"]);
    bake(&["-o", "float.exr", "--float"]);
    for name in ["half.exr", "float.exr"] {
        let (path, other) = (dir.path(name), dir.path("other.exr"));
        edit(&path, &other, |v| v);
        assert_ne!(std::fs::read(&path).unwrap(), std::fs::read(&other).unwrap());
        let (kept, said) = baked(&dir, "other.exr");
        assert!(kept["source"] == "seed 7" && said.is_empty(), "{said}");
        assert_eq!(dir.json(&["inspect", "other.exr"])[0]["pixels"], "same");
        // one stop up, by other software
        edit(&path, &other, |v| 2.0 * v);
        let (encoded, said) = baked(&dir, "other.exr");
        assert!(said.contains("other.exr") && said.contains("changed"), "{said}");
        assert_eq!(encoded, latent(&dir, &["encode", "other.exr"]));
        assert_eq!(dir.json(&["inspect", "other.exr"])[0]["pixels"], "changed");
        let exposure = |v: &Value| v["exposure"].as_f64().unwrap();
        let stops =
            (exposure(&encoded) - exposure(&latent(&dir, &["encode", name]))) / std::f64::consts::LN_2;
        assert!((stops - 1.0).abs() < 1e-3, "{stops}");
    }
    // one byte of a pixel of the .hdr
    let mut bytes = std::fs::read(dir.path("sky.hdr")).unwrap();
    assert_eq!(baked(&dir, "sky.hdr").0["source"], "seed 7");
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    dir.write("touched.hdr", bytes);
    let (encoded, said) = baked(&dir, "touched.hdr");
    assert!(said.contains("changed") && encoded["source"] == "touched.hdr", "{said}");
}

#[test]
fn a_cube_map_that_was_edited_is_refused() {
    let dir = Dir::new();
    let args = ["bake", "--seed", "7", "--size", "16", "--layout", "cubemap", "-q", "-o", "cube.exr"];
    dir.ok(&args);
    assert_eq!(baked(&dir, "cube.exr").0["source"], "seed 7");
    edit(&dir.path("cube.exr"), &dir.path("edited.exr"), |v| 2.0 * v);
    dir.refused(&["bake", "edited.exr", "-o", "no.exr", "-q"], &["edited.exr", "cube map", "changed"]);
}

/// Other software divided the factor out and kept the attribute: it is not divided out again.
#[test]
fn a_factor_is_divided_out_once() {
    let dir = Dir::new();
    // by an older version: no digest, so the factor is believed
    let night = file("night.exr");
    let factor: f32 = attributes(&night).unwrap()[RADIANCE_SCALE].parse().unwrap();
    assert_eq!(factor, 1_048_576.0);
    let exposure = |name: &str| latent(&dir, &["encode", name])["exposure"].as_f64().unwrap();
    let level = exposure(&night);
    assert!(level < -15.0, "{level}");
    // and by this one
    dir.ok(&["prepare", &night, "-o", "set", "-q"]);
    let name = "set/train/night.exr";
    let said = attributes(dir.path(name)).unwrap();
    let factor: f32 = said[RADIANCE_SCALE].parse().unwrap();
    assert!(factor > 1000.0 && said.contains_key("veni:pixels"), "{said:?}");
    assert!((exposure(name) - level).abs() < 1e-3, "{} and {level}", exposure(name));
    // stored as floats, since such values are no halves
    let out = dir.path("divided.exr");
    let true_values = Panorama::read(dir.path(name)).unwrap();
    assert_eq!(true_values.provenance(), Provenance::Same);
    exr_with(&out, &true_values, &said);
    let run = dir.run(&["encode", "divided.exr", "--json"]);
    assert_eq!(run.code, Some(0), "{}", run.err);
    assert!(run.err.contains("divided.exr") && run.err.contains(RADIANCE_SCALE), "{}", run.err);
    let again: Value = serde_json::from_str(&run.out).unwrap();
    let again = again["latent"]["exposure"].as_f64().unwrap();
    assert!((again - level).abs() < 1e-3, "{again} and {level}");
    // prepare says it too, and goes on
    let run = dir.run(&["prepare", "divided.exr", "-o", "other"]);
    assert!(run.code == Some(0) && run.err.contains(RADIANCE_SCALE), "{}", run.err);
}

/// An EXR file of floats with these text attributes.
fn exr_with(path: &Path, image: &Panorama, said: &BTreeMap<String, String>) {
    use exr::prelude::*;
    let (width, height) = (image.grid().width, image.grid().height);
    let mut own = LayerAttributes::default();
    for (name, value) in said.iter().filter(|(name, _)| *name != "software") {
        own.other.insert(Text::from(name.as_str()), AttributeValue::Text(value.as_str().into()));
    }
    let pixels = SpecificChannels::rgb(|at: Vec2<usize>| {
        let [r, g, b] = image.pixel(at.x(), at.y());
        (r, g, b)
    });
    let layer = Layer::new((width, height), own, Encoding::FAST_LOSSLESS, pixels);
    Image::from_layer(layer).write().to_file(path).unwrap();
}

#[test]
fn prepare_says_which_sources_are_gone() {
    let dir = Dir::new();
    std::fs::create_dir(dir.path("src")).unwrap();
    let mut files: Vec<_> =
        std::fs::read_dir(panoramas().join("train")).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    for (from, to) in
        files.iter().filter(|f| f.extension().is_some_and(|e| e == "exr")).zip(["one", "two", "three"])
    {
        std::fs::copy(from, dir.path(format!("src/{to}.exr"))).unwrap();
    }
    let prepare = |from: &str| dir.run(&["prepare", from, "-o", "set", "--size", "32", "--val", "0"]);
    let first = prepare("src");
    assert!(first.code == Some(0) && !first.err.contains("gone"), "{}", first.err);
    // a file that is elsewhere now is found by its content
    std::fs::create_dir(dir.path("more")).unwrap();
    std::fs::rename(dir.path("src/three.exr"), dir.path("more/three.exr")).unwrap();
    let run = prepare("more");
    assert!(run.code == Some(0) && !run.err.contains("gone"), "{}", run.err);
    std::fs::remove_file(dir.path("src/one.exr")).unwrap();
    let run = prepare("src");
    assert_eq!(run.code, Some(0), "{}", run.err);
    assert!(run.err.contains("src/one.exr") && run.err.contains("--force"), "{}", run.err);
    assert!(dir.path("set/train/one.exr").is_file());
    let report: Value = serde_json::from_slice(&std::fs::read(dir.path("set/report.json")).unwrap()).unwrap();
    assert!(report["gone"].as_array().unwrap().contains(&"src/one.exr".into()), "{report}");
    assert!(std::fs::read_to_string(dir.path("set/report.md")).unwrap().contains("sources are gone"));
    let json = dir.json(&["prepare", "src", "-o", "set", "--size", "32", "--val", "0"]);
    assert_eq!(json[0]["gone"], report["counts"]["gone"]);
    let again = dir.run(&["prepare", "src", "-o", "set", "--size", "32", "--val", "0", "--force"]);
    assert!(!again.err.contains("gone") && !dir.path("set/train/one.exr").exists(), "{}", again.err);
    assert!(dir.path("set/train/two.exr").is_file());
}
