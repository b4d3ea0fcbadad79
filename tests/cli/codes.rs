//! Codes with lights: encoded, fitted, baked in every layout, read again.

use serde_json::Value;

use crate::util::{Dir, panoramas, text};
use veni_image::{Panorama, ReadOptions};
use veni_light::latent::Latent;
use veni_light::light::CompactLight;
use veni_light::sphere::CubeFace;

/// A sunny panorama, its measured sun by `light`, and what an encoded code says of it.
fn encoded(dir: &Dir) -> (Value, Latent) {
    let file = text(&panoramas().join("val/garden_nook.exr"));
    let [measured] = &dir.json(&["light", &file])[..] else { panic!("one object") };
    let said = dir.ok(&["encode", &file, "--compact-lights", "1", "-o", "sky.json"]);
    assert!(said.contains("vectors, the sun, exposure"), "{said}");
    (measured.clone(), Latent::load(dir.path("sky.json")).unwrap())
}

fn sums(file: &std::path::Path) -> [f64; 3] {
    Panorama::read(file).unwrap().environment().unwrap().integral()
}

fn close(a: [f64; 3], b: [f64; 3], tolerance: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a / b - 1.0).abs() < tolerance)
}

#[test]
fn the_sun_of_a_panorama_is_in_its_code_and_its_energy_in_every_picture() {
    let dir = Dir::new();
    let (measured, latent) = encoded(&dir);
    let sun = latent.lights.sun().expect("a sun");
    for (k, own) in sun.direction.iter().enumerate() {
        assert!((f64::from(*own) - measured["sun"]["direction"][k].as_f64().unwrap()).abs() < 1e-6);
        let irradiance = f64::from(sun.irradiance[k]) * f64::from(latent.log_exposure).exp();
        let expected = measured["sun"]["irradiance"][k].as_f64().unwrap();
        assert!((irradiance / expected - 1.0).abs() < 1e-4, "{irradiance} {expected}");
    }
    let [facts] = &dir.json(&["inspect", "sky.json"])[..] else { panic!("one object") };
    let radius = facts["sun"]["radius"].as_f64().unwrap();
    assert!((radius - f64::from(sun.radius.to_degrees())).abs() < 1e-4, "{facts}");
    let said = dir.ok(&["inspect", "sky.json"]);
    assert!(said.contains("(D = 34)") && said.contains("elevation") && said.contains("E⊥"), "{said}");
    let raw = std::fs::read_to_string(dir.path("sky.json")).unwrap();
    assert!(raw.contains("\"format\":2") && raw.contains("\"sun\":{"), "{raw}");
    // without its lights the same code is one of format 1
    let plain = Latent { lights: veni_light::light::Lights::default(), ..latent.clone() };
    std::fs::write(dir.path("plain.json"), plain.to_json().unwrap()).unwrap();
    let factor = latent.log_exposure.exp();
    let own = sun.irradiance.map(|e| f64::from(e * factor));
    let baked = |latent: &str, out: &str, more: &[&str]| {
        dir.ok(&[&["bake", latent, "-o", out, "--float"], more].concat());
        dir.path(out)
    };
    for size in ["64x32", "512x256"] {
        let lit = sums(&baked("sky.json", &format!("{size}.exr"), &["--size", size]));
        let rest = sums(&baked("plain.json", &format!("{size}-plain.exr"), &["--size", size]));
        assert!(close([0, 1, 2].map(|c| lit[c] - rest[c]), own, 1e-3), "{size}: {lit:?} {rest:?} {own:?}");
    }
    // the faces of a cube map hold as much
    let cube = |latent: &str, out: &str| -> [f64; 3] {
        let path = baked(latent, out, &["--size", "32", "--layout", "cubemap"]);
        let options = ReadOptions { any_aspect: true, ..ReadOptions::default() };
        let faces = Panorama::read_with(&path, &options).unwrap();
        let mut sum = [0.0; 3];
        for (index, pixel) in faces.pixels().iter().enumerate() {
            let area = CubeFace::solid_angle(32, index % 32, index / 32 % 32);
            sum = [0, 1, 2].map(|c| sum[c] + area * f64::from(pixel[c]));
        }
        sum
    };
    let (lit, rest) = (cube("sky.json", "c.exr"), cube("plain.json", "cp.exr"));
    assert!(close([0, 1, 2].map(|c| lit[c] - rest[c]), own, 1e-3), "{lit:?} {rest:?} {own:?}");
    // a sun that half precision does not hold is known before it is met
    let run = dir.run(&["bake", "sky.json", "-o", "half.exr", "--size", "256", "--exposure", "5"]);
    assert!(run.code == Some(0) && run.err.matches("beyond half precision").count() == 1, "{}", run.err);
    // a baked file gives back the code, lights included, and rotates with it
    dir.ok(&["bake", "512x256.exr", "--turn", "90", "-o", "rotated.exr"]);
    let [rotated] = &dir.json(&["light", "rotated.exr"])[..] else { panic!("one object") };
    let azimuth = (rotated["sun"]["azimuth"].as_f64().unwrap() - f64::from(sun.azimuth().to_degrees()))
        .rem_euclid(360.0);
    assert!((azimuth - 90.0).abs() < 0.5, "{azimuth}: {rotated}");
}

#[test]
fn a_fit_keeps_the_sun_and_says_where_it_cannot() {
    let dir = Dir::new();
    let (_, expected) = encoded(&dir);
    let file = text(&panoramas().join("val/garden_nook.exr"));
    dir.ok(&[
        "fit",
        &file,
        "--compact-lights",
        "1",
        "--steps",
        "5",
        "-o",
        "fit.json",
        "--completed",
        "all.exr",
    ]);
    let fitted = Latent::load(dir.path("fit.json")).unwrap();
    let (a, b) = (fitted.lights.sun().unwrap(), expected.lights.sun().unwrap());
    assert_eq!(a.direction, b.direction);
    let absolute = |latent: &Latent, light: &CompactLight| light.irradiance[1] * latent.log_exposure.exp();
    assert!((absolute(&fitted, a) / absolute(&expected, b) - 1.0).abs() < 1e-3);
    for (args, says) in [
        (&["fit", &file, "--compact-lights", "1", "--fov", "60"][..], "cannot be used with '--fov"),
        (&["encode", &file, "--compact-lights", "9"], "9 is not in 0..=8"),
    ] {
        let run = dir.run(args);
        assert!(run.code == Some(2) && run.err.contains(says), "{args:?}: {}", run.err);
    }
}

#[test]
fn damaged_lights_are_refused_by_name() {
    let dir = Dir::new();
    encoded(&dir);
    let good = std::fs::read_to_string(dir.path("sky.json")).unwrap();
    for (from, to, says) in [
        ("\"radius\":", "\"radius\":-", "light 0: its radius"),
        ("\"irradiance\":[", "\"irradiance\":[-", "light 0: its irradiance"),
        ("\"sun\":{", "\"sun\":{\"colour\":1,", "colour"),
        ("\"format\":2", "\"format\":7", "formats 1 and 2"),
    ] {
        std::fs::write(dir.path("bad.json"), good.replacen(from, to, 1)).unwrap();
        dir.refused(&["bake", "bad.json", "-o", "x.exr"], &[says, "bad.json"]);
    }
}

#[test]
fn lobes_bring_detail_to_codes_that_are_encoded_and_fitted() {
    let dir = Dir::new();
    let file = text(&panoramas().join("val/kloppenheim_05.exr"));
    let score = |command: &str, lobes: &str| -> f64 {
        let out = format!("{command}-{lobes}.json");
        // one light: wide ones beside it would be detail of their own
        let args = [command, &file, "--lobes", lobes, "--compact-lights", "1", "-o", &out];
        let [said] = &dir.json(&args)[..] else { panic!("one") };
        said["ldr_psnr"].as_f64().unwrap()
    };
    let [plain, encoded] = ["0", "3"].map(|lobes| score("encode", lobes));
    let fitted = score("fit", "3");
    // (which of the two has the better picture depends on the panorama: light counts too)
    assert!(encoded.min(fitted) > plain + 1.0, "{encoded}, {fitted} and {plain} dB");
    // the encoder's vectors stay, those of a fit move with the lobes
    let [plain, encoded, fitted] =
        ["encode-0", "encode-3", "fit-3"].map(|name| Latent::load(dir.path(format!("{name}.json"))).unwrap());
    assert_eq!(plain.lobes.len() + encoded.lobes.len() + fitted.lobes.len(), 6);
    assert_eq!(plain.vectors, encoded.vectors);
    assert_ne!(plain.vectors, fitted.vectors);
    assert_eq!(fitted.dimension(), 27 + 7 + 3 * 7);
    let said = dir.ok(&["inspect", "fit-3.json"]);
    assert!(said.contains("D = 55"), "{said}");
    // what is baked is what was scored, and gives the code back
    dir.ok(&["bake", "fit-3.json", "-o", "fit.exr", "--float", "--size", "128"]);
    dir.ok(&["bake", "fit.exr", "-o", "again.exr", "--float", "--size", "128"]);
    let [once, again] = ["fit.exr", "again.exr"].map(|name| sums(&dir.path(name)));
    assert!(close(once, again, 1e-6));
    let run = dir.run(&["fit", &file, "--lobes", "257", "-o", "x.json"]);
    assert!(run.code == Some(2) && run.err.contains("257"), "{}", run.err);
}

#[test]
fn sizes_name_lobes() {
    let dir = Dir::new();
    let file = text(&panoramas().join("val/kloppenheim_05.exr"));
    dir.ok(&["encode", &file, "-o", "27.json"]);
    dir.ok(&["encode", &file, "--model", "147", "-o", "147.json"]);
    dir.ok(&["encode", &file, "--model", "147", "--lobes", "1", "-o", "1.json"]);
    dir.ok(&["bake", &file, "--model", "147", "--size", "16", "-o", "encoded.exr"]);
    let said = dir.ok(&["inspect", "encoded.exr"]);
    assert!(said.contains("vectors, the sun, 16 lobes of model"), "{said}");
    let lobes = |name: &str| Latent::load(dir.path(name)).unwrap().lobes.len();
    assert_eq!(["27.json", "147.json", "1.json"].map(lobes), [0, 16, 1]);
    // a code belongs to the model of its vectors, whichever size it was named by
    dir.ok(&["bake", "147.json", "--size", "16", "-o", "a.exr", "--float"]);
    dir.ok(&["bake", "147.json", "--model", "300", "--size", "16", "-o", "b.exr", "--float"]);
    assert_eq!(sums(&dir.path("a.exr")), sums(&dir.path("b.exr")));
}

#[test]
fn random_skies_are_those_of_the_vectors_for_every_size() {
    let dir = Dir::new();
    let bake = |model: &str| {
        let out = format!("{model}.exr");
        let run = dir.run(&["bake", "--model", model, "--seed", "7", "--size", "16", "--float", "-o", &out]);
        assert_eq!(run.code, Some(0), "{}", run.err);
        (sums(&dir.path(&out)), run.err)
    };
    let ((plain, silent), (sized, said)) = (bake("27"), bake("300"));
    assert_eq!(plain, sized);
    assert!(said.contains("no lobes") && !silent.contains("lobes"), "{said}{silent}");
}
