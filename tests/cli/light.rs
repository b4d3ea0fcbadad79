//! `light`: the sun of a real panorama, of generated ones, of latents, and what is refused.

use serde_json::Value;

use crate::util::{Dir, panoramas, text};

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn degrees(a: &[f64], b: &[f64]) -> f64 {
    let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    let lengths: f64 = [a, b].map(|v| v.iter().map(|c| c * c).sum::<f64>().sqrt()).iter().product();
    (dot / lengths).clamp(-1.0, 1.0).acos().to_degrees()
}

#[test]
fn the_sun_of_a_generated_scene_is_where_it_was_put() {
    let dir = Dir::new();
    dir.ok(&["synth", "-o", "set", "-n", "1", "--seed", "3", "--size", "512x256", "--scene", "clear", "-q"]);
    let file = text(&dir.path("set/synth-000000.exr"));
    let [facts] = &dir.json(&["inspect", &file])[..] else { panic!("one object") };
    let scene = &facts["attributes"]["veni:scene"];
    let scene: Value = scene.as_str().map_or_else(|| scene.clone(), |s| serde_json::from_str(s).unwrap());
    let angle = |name: &str| scene[name].as_f64().unwrap_or_else(|| panic!("{name} in {facts}")).to_radians();
    let (azimuth, elevation) = (angle("sun_azimuth"), angle("sun_elevation"));
    let truth = [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()];
    let [light] = &dir.json(&["light", &file, "--lux"])[..] else { panic!("one object") };
    let off = degrees(&numbers(&light["sun"]["direction"]), &truth);
    assert!(off < 0.5 * 360.0 / 512.0, "{off}°: {}", light["sun"]);
    assert_eq!(light["sun"], light["lights"][0]);
    assert_eq!(light["sun"]["kind"], "disc");
    assert_eq!(light["sh"].as_array().unwrap().len(), 9);
    // a clear day: some ten thousand lux
    let lux = light["lux"]["up"].as_f64().unwrap();
    assert!((2e3..2e5).contains(&lux), "{lux}");
    // mean radiance is the first harmonic over √4π
    let mean = numbers(&light["mean"])[1];
    let first = numbers(&light["sh"][0])[1] / (4.0 * std::f64::consts::PI).sqrt();
    assert!((first / mean - 1.0).abs() < 1e-5, "{first} {mean}");
    let human = dir.ok(&["light", &file]);
    assert!(human.contains("sun ") && human.contains("el ") && human.contains("disc"), "{human}");
}

#[test]
fn residual_and_sharpened_panoramas_hold_the_energy() {
    let dir = Dir::new();
    let file = text(&panoramas().join("val/garden_nook.exr"));
    let args = ["light", &file, "--residual", "r.exr", "--sharpened", "s.exr", "-o", "light.json"];
    let [light] = &dir.json(&args)[..] else { panic!("one object") };
    let stored: Value =
        serde_json::from_str(&std::fs::read_to_string(dir.path("light.json")).unwrap()).unwrap();
    assert_eq!(&stored, light);
    let of = |name: &str| dir.json(&["light", name, "--sun", "none"]).remove(0);
    let (whole, residual, sharp) = (of(&file), of("r.exr"), of("s.exr"));
    assert!(whole["sun"].is_null() && whole["lights"].as_array().unwrap().is_empty());
    for c in 0..3 {
        let mean = |v: &Value| numbers(&v["mean"])[c];
        let lights: f64 =
            light["lights"].as_array().unwrap().iter().map(|l| numbers(&l["irradiance"])[c]).sum();
        let sum = mean(&residual) + lights / (4.0 * std::f64::consts::PI);
        assert!((sum / mean(&whole) - 1.0).abs() < 1e-4, "{sum} {}", mean(&whole));
        assert!((mean(&sharp) / mean(&whole) - 1.0).abs() < 1e-3);
    }
    assert!(
        residual["mean"][0].as_f64().unwrap() < 0.9 * whole["mean"][0].as_f64().unwrap(),
        "the sun is gone"
    );
    dir.refused(&args, &["r.exr", "exists", "--force"]);
    dir.ok(&[&args[..], &["--force"]].concat());
}

#[test]
fn latents_and_seeds_have_lights_too() {
    let dir = Dir::new();
    dir.ok(&["bake", "--seed", "19", "--size", "128", "-o", "sky.exr", "--quiet"]);
    let [seed] = &dir.json(&["light", "--seed", "19", "--size", "256"])[..] else { panic!("one object") };
    let [baked] = &dir.json(&["light", "sky.exr"])[..] else { panic!("one object") };
    // the same sky: its mean is the same, whatever the size
    let (a, b) = (numbers(&seed["mean"])[1], numbers(&baked["mean"])[1]);
    assert!((a / b - 1.0).abs() < 0.01, "{a} {b}");
    let sun = &seed["sun"];
    assert!(sun["elevation"].as_f64().unwrap() > 5.0, "{seed}");
    let args = ["light", "--seed", "19", "--size", "256", "--sun-radius", "0.2665"];
    let [small] = &dir.json(&args)[..] else { panic!("one object") };
    assert_eq!(
        (&small["sun"]["radius_source"], &small["sun"]["kind"]),
        (&"requested".into(), &"disc".into())
    );
    assert_eq!(small["sun"]["irradiance"], sun["irradiance"]);
}

#[test]
fn harmonics_come_as_engines_want_them() {
    let dir = Dir::new();
    let file = text(&panoramas().join("val/kloppenheim_06.exr"));
    let coefficients = |convention: &str| {
        let value = dir.json(&["light", &file, "--sh", convention]).remove(0);
        assert_eq!(value["converted"]["convention"], convention);
        let sh = value["converted"]["sh"].as_array().unwrap().iter().map(numbers).collect::<Vec<_>>();
        (sh, value)
    };
    let (native, value) = coefficients("native");
    assert_eq!(value["converted"]["sh"], value["sh"]);
    let (filament, _) = coefficients("filament");
    // E/π of the constant band: Y00² π / π L00 … = Y00 L00
    assert!((filament[0][0] - 0.282_095 * native[0][0]).abs() < 1e-5 * native[0][0]);
    let (irradiance, _) = coefficients("irradiance");
    assert!((irradiance[2][1] / native[2][1] - 2.0 * std::f64::consts::PI / 3.0).abs() < 1e-5);
    let (three, _) = coefficients("three");
    // up: native z is y there, without the sign
    assert!((three[1][1] - native[2][1]).abs() < 1e-5 * native[0][1]);
    let human = dir.ok(&["light", &file, "--sh", "babylon"]);
    assert!(human.contains("babylon"), "{human}");
}

#[test]
fn what_makes_no_sense_is_refused() {
    let dir = Dir::new();
    let file = text(&panoramas().join("val/kloppenheim_06.exr"));
    for (args, words) in [
        (&["light"][..], &["required"][..]),
        (&["light", "missing.exr"], &["missing.exr"]),
        (&["light", &file, "--seed", "1"], &["--seed"]),
        (&["light", &file, "--sun", "noon"], &["AZIMUTH,ELEVATION"]),
        (&["light", &file, "--sun", "10,95"], &["95"]),
        (&["light", &file, "--sun-radius", "0"], &["not more than 0"]),
        (&["light", &file, "--sun-radius", "120"], &["120"]),
        (&["light", &file, "--size", "64"], &["--size"]),
        (&["light", "--seed", "1", "--size", "63"], &["--size"]),
        (&["light", &file, "--residual", "r.png"], &["r.png", ".exr"]),
        (&["light", &file, "-o", "light.txt"], &["light.txt", ".json"]),
        (&["light", &file, "--lux", "-3"], &["-3"]),
    ] {
        let run = dir.run(args);
        assert_eq!(run.code, Some(2), "{args:?}: {}{}", run.out, run.err);
        assert_eq!(run.out, "");
        assert!(words.iter().all(|w| run.err.contains(w)), "{args:?}: {}", run.err);
    }
    dir.write(
        "black.hdr",
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n"
            .iter()
            .copied()
            .chain([0; 128])
            .collect::<Vec<_>>(),
    );
    dir.refused(&["light", "black.hdr"], &["black.hdr", "black"]);
}
