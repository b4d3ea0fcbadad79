//! `encode` and `fit` with the model inside the program: what every build can do.

use serde_json::Value;

use crate::util::{Dir, panorama, text};

/// A photograph or damaged file of the image crate's tests.
fn file(name: &str) -> String {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../veni-image/tests/files");
    text(&folder.join(name))
}

fn latent(value: &Value) -> Vec<f64> {
    let vectors = value["latent"]["vectors"].as_array().unwrap();
    vectors.iter().flat_map(|v| v.as_array().unwrap()).map(|v| v.as_f64().unwrap()).collect()
}

fn one(dir: &Dir, args: &[&str]) -> Value {
    let results = dir.json(args);
    let [result] = &results[..] else { panic!("{args:?}: {} results", results.len()) };
    result.clone()
}

#[test]
fn a_panorama_is_encoded_and_a_fit_improves_on_that() {
    let dir = Dir::new();
    let encoded = one(&dir, &["encode", &panorama()]);
    let psnr = |value: &Value| value["ldr_psnr"].as_f64().unwrap();
    // held out, and of an easy kind: what the model card says of it is above 20 dB
    assert!(psnr(&encoded) > 15.0, "{encoded}");
    assert_eq!(latent(&encoded).len(), 27);
    let fitted = one(&dir, &["fit", &panorama()]);
    assert!(psnr(&fitted) > psnr(&encoded), "{} dB after {} dB", psnr(&fitted), psnr(&encoded));
    assert!(fitted["loss"].as_f64().unwrap() > 0.0);
    // and a baked latent is encoded on the fly
    dir.ok(&["bake", &panorama(), "--size", "64", "--device", "cpu", "-o", "again.exr"]);
}

#[test]
fn a_photograph_stands_upright_as_its_exif_data_says() {
    let dir = Dir::new();
    // so heavy a prior that there is one minimum: the pictures differ by what JPEG made of each orientation
    let fit = |name: &str, look: &str| {
        let how = [
            "--fov",
            "65",
            "--look",
            look,
            "--starts",
            "1",
            "--steps",
            "25",
            "--prior",
            "1",
            "--resolution",
            "64",
        ];
        latent(&one(&dir, &[&["fit", &file(name)][..], &how].concat()))
    };
    let upright = fit("photo_upright.jpg", "30,10,0");
    let apart = |found: &[f64]| upright.iter().zip(found).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    for turned in ["photo_exif3.jpg", "photo_exif6.jpg"] {
        let apart = apart(&fit(turned, "30,10,0"));
        assert!(apart < 0.02, "{turned}: {apart}");
    }
    // a picture that stands on its head is another one
    let upside_down = apart(&fit("photo_upright.jpg", "30,10,180"));
    assert!(upside_down > 1.0, "{upside_down}");
}

#[test]
fn a_truncated_photograph_is_refused() {
    let dir = Dir::new();
    dir.refused(
        &["fit", &file("photo_trunc.jpg"), "--fov", "65"],
        &["photo_trunc.jpg", "truncated JPEG file"],
    );
    dir.refused(&["fit", &file("trunc.jpg")], &["trunc.jpg", "truncated JPEG file"]);
}

#[test]
fn light_and_ibl_agree_on_the_sun() {
    let dir = Dir::new();
    let folder = crate::util::panoramas();
    let panoramas =
        ["train/snowy_field", "train/venice_sunset", "train/qwantani_night", "val/kloppenheim_06"];
    let panoramas = panoramas.map(|name| text(&folder.join(format!("{name}.exr"))));
    let seeds = ["3", "6", "19", "21"];
    let mut skies: Vec<(Vec<&str>, Vec<&str>)> =
        panoramas.iter().map(|p| (vec![p.as_str()], vec![])).collect();
    skies.extend(seeds.map(|s| (vec!["--seed", s], vec!["--sky-size", "512"])));
    let (mut with, mut without) = (0, 0);
    for (at, (sky, grid)) in skies.iter().enumerate() {
        let light = one(&dir, &[&["light"], &sky[..]].concat());
        let folder = format!("sky{at}");
        let to = ["--engine", "blender", "--size", "16", "-o", &folder];
        let ibl = one(&dir, &[&["ibl"], &sky[..], &grid[..], &to].concat());
        for key in ["direction", "irradiance", "radius_source"] {
            assert_eq!(light["sun"][key], ibl["sun"][key], "{sky:?}: {key}");
        }
        *if ibl["sun"].is_null() { &mut without } else { &mut with } += 1;
    }
    assert!(with >= 3 && without >= 2, "{with} with a sun, {without} without");
}
