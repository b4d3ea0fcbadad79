//! `encode`: panoramas to latents.

use serde_json::Value;

use crate::util::{Dir, model, panorama, panoramas, text};

#[test]
fn the_latent_goes_to_a_file_or_to_stdout() {
    let dir = Dir::new();
    let out = dir.ok(&["encode", &panorama(), "--model", model(), "-o", "code.json"]);
    assert!(out.contains("code.json") && out.contains("dB"), "{out}");
    let file: Value = serde_json::from_slice(&std::fs::read(dir.path("code.json")).unwrap()).unwrap();
    assert_eq!(file["n"], 4);
    let printed: Value = serde_json::from_str(&dir.ok(&["encode", &panorama(), "--model", model()])).unwrap();
    assert_eq!(file, printed, "stdout is the file's content");
    let [object] = &dir.json(&["encode", &panorama(), "--model", model()])[..] else { panic!("one object") };
    assert_eq!(object["latent"], file);
    assert!(object["ldr_psnr"].as_f64().unwrap().is_finite() && object["ssim"].as_f64().unwrap() <= 1.0);
}

#[test]
fn many_panoramas_go_to_a_folder() {
    let dir = Dir::new();
    let mut files: Vec<_> =
        std::fs::read_dir(panoramas().join("train")).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|p| p.extension().is_some_and(|e| e == "exr" || e == "hdr"));
    files.sort();
    files.truncate(2);
    let [a, b] = &files.iter().map(|p| text(p)).collect::<Vec<_>>()[..] else { panic!("two panoramas") };
    let results = dir.json(&["encode", a, b, "--model", model(), "--out-dir", "codes"]);
    assert_eq!(results.len(), 2);
    for file in &files {
        let code = dir.path("codes").join(file.file_stem().unwrap()).with_extension("json");
        assert!(code.is_file(), "{}", code.display());
    }
    dir.refused(&["encode", a, b, "--model", model(), "--out-dir", "codes"], &["--force"]);
    dir.refused(&["encode", a, b, "--model", model(), "-o", "one.json"], &["--out-dir"]);
    dir.refused(&["encode", a, a, "--model", model(), "--out-dir", "twice"], &["twice"]);
}

#[test]
fn a_preview_shows_target_and_reconstruction() {
    let dir = Dir::new();
    dir.ok(&["encode", &panorama(), "--model", model(), "-o", "code.json", "--preview", "pair.png"]);
    let image = image::open(dir.path("pair.png")).unwrap().to_rgb8();
    let (width, height) = image.dimensions();
    assert!(width > 2 * height, "two panoramas side by side, not {width} x {height}");
    let half = |from: u32| -> Vec<_> {
        image.enumerate_pixels().filter(|p| p.0 / (width / 2) == from).map(|p| p.2.0).collect()
    };
    assert!(half(0) != half(1), "the reconstruction after two steps is the panorama itself");
}

#[test]
fn exposure_is_taken_out_and_recorded() {
    let dir = Dir::new();
    let base = ["bake", "--model", model(), "--seed", "2", "--size", "128", "--float", "-q"];
    let strip = |name: &str| {
        // an image without its latent, so that it is encoded as a panorama
        let image = crate::readers::exr(&dir.path(format!("{name}.exr")));
        exr::prelude::write_rgb_file(dir.path(format!("{name}-plain.exr")), 128, 64, |x, y| {
            let [r, g, b] = image.pixels[y * 128 + x];
            (r, g, b)
        })
        .unwrap();
    };
    let code = |name: &str| -> Value {
        strip(name);
        serde_json::from_str(&dir.ok(&["encode", &format!("{name}-plain.exr"), "--model", model()])).unwrap()
    };
    dir.ok(&[&base[..], &["-o", "plain.exr"]].concat());
    dir.ok(&[&base[..], &["-o", "bright.exr", "--exposure", "3"]].concat());
    let (plain, bright) = (code("plain"), code("bright"));
    let exposure = |v: &Value| v["exposure"].as_f64().unwrap();
    let stops = (exposure(&bright) - exposure(&plain)) / std::f64::consts::LN_2;
    assert!((stops - 3.0).abs() < 1e-3, "{stops}");
    let numbers = |v: &Value| -> Vec<f64> {
        v["vectors"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(|p| p.as_array().unwrap())
            .map(|c| c.as_f64().unwrap())
            .collect()
    };
    for (a, b) in numbers(&plain).iter().zip(numbers(&bright)) {
        assert!((a - b).abs() < 1e-3, "vectors do not depend on exposure: {a} against {b}");
    }
}

#[test]
fn a_model_without_encoder_says_so() {
    // nothing in the command line strips an encoder yet: the shape of a model that only decodes is made here
    let dir = Dir::new();
    let decode_only = dir.path("decode-only.safetensors");
    let full = veni_light::model::Model::load(model()).unwrap();
    full.without_encoder()
        .save(&decode_only, veni_light::model::StoredType::F32, veni_light::output::Overwrite::Refuse)
        .unwrap();
    let name = text(&decode_only);
    dir.refused(&["encode", &panorama(), "--model", &name, "-o", "a.json"], &["decode-only", "no encoder"]);
    dir.refused(
        &["bake", &panorama(), "--model", &name, "-o", "a.exr", "-q"],
        &["decode-only", "no encoder"],
    );
    assert!(dir.ok(&["inspect", &name]).contains("decodes only"));
    // a latent of the full model still belongs to it
    dir.ok(&["encode", &panorama(), "--model", model(), "-o", "code.json"]);
    dir.ok(&["bake", "code.json", "--model", &name, "--size", "16", "-o", "sky.exr"]);
}

#[cfg(feature = "pretrained")]
#[test]
fn the_model_inside_the_program_encodes() {
    let dir = Dir::new();
    let object = &dir.json(&["encode", &panorama()])[0];
    assert!(object["ldr_psnr"].as_f64().unwrap() > 12.0, "{object}");
}
