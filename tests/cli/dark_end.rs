//! Precision at the dark end, and panoramas in any unit of radiance.

use serde_json::Value;
use veni_image::{Panorama, Precision, WriteFormat, WriteOptions};

use crate::readers;
use crate::util::{Dir, file, panorama};

/// Times a factor, as floats, without attributes.
fn times(dir: &Dir, from: &str, factor: f32, to: &str) {
    let mut image = Panorama::read(from).unwrap();
    image.scale(factor);
    image.write(dir.path(to), &WriteOptions::new(WriteFormat::Exr(Precision::Float))).unwrap();
}

fn one(dir: &Dir, args: &[&str]) -> Value {
    let [value] = &dir.json(args)[..] else { panic!("one object of {args:?}") };
    value.clone()
}

fn numbers(value: &Value) -> Vec<f64> {
    let rows = value.as_array().unwrap().iter();
    rows.flat_map(|v| v.as_array().unwrap()).map(|v| v.as_f64().unwrap()).collect()
}

/// A generated night: half precision would round an eighth of its values to nothing.
#[test]
fn a_night_keeps_its_dark_end() {
    let dir = Dir::new();
    dir.ok(&["encode", &file("night.exr"), "-o", "n.json", "-q"]);
    let run = dir.run(&["bake", "n.json", "-o", "n.exr", "--size", "128"]);
    assert_eq!(run.code, Some(0), "{}", run.err);
    assert!(
        run.out.contains("float") && run.err.contains("half precision loses bits"),
        "{}{}",
        run.out,
        run.err
    );
    dir.ok(&["bake", "n.json", "-o", "float.exr", "--size", "128", "--float", "-q"]);
    let (default, float) = (readers::exr(&dir.path("n.exr")), readers::exr(&dir.path("float.exr")));
    assert_eq!(default.pixels, float.pixels);
    assert!(default.pixels.iter().flatten().all(|v| *v > 0.0));
    let words = ["half.exr", " of 24576 values", "6.1e-5", "--half", "brighten"];
    dir.refused(&["bake", "n.json", "-o", "half.exr", "--size", "128", "--half"], &words);
    // brighter by 2^24, all fits
    dir.ok(&["bake", "n.json", "-o", "lit.exr", "--size", "128", "--half", "--exposure", "24", "-q"]);
    let lit = readers::exr(&dir.path("lit.exr"));
    let worst = lit.pixels.iter().flatten().zip(float.pixels.iter().flatten());
    assert!(worst.map(|(a, b)| (a / (b * 24f32.exp2()) - 1.0).abs()).fold(0.0, f32::max) < 1e-3);
}

#[test]
fn a_sky_of_any_exposure_is_a_sky() {
    let dir = Dir::new();
    let bake = |name: &str, rest: &[&str]| {
        let args = ["bake", "--seed", "1", "--size", "64", "--json", "-o", name];
        dir.run(&[&args[..], rest].concat())
    };
    let plain = bake("plain.exr", &["--float"]);
    assert_eq!(plain.code, Some(0));
    let plain = readers::exr(&dir.path("plain.exr"));
    for (name, stops) in [("dark.exr", -28), ("darker.exr", -64), ("bright.exr", 40)] {
        let stops_text = stops.to_string();
        let run = bake(name, &["--exposure", &stops_text]);
        assert!(run.code == Some(0) && run.out.contains("\"float\""), "{}{}", run.out, run.err);
        let image = readers::exr(&dir.path(name));
        let factor = (stops as f32).exp2();
        let pairs = image.pixels.iter().flatten().zip(plain.pixels.iter().flatten());
        assert!(pairs.map(|(a, b)| (a / (b * factor) - 1.0).abs()).fold(0.0, f32::max) < 1e-4, "{name}");
    }
    // within half precision it is the default, as ever
    assert!(bake("half.exr", &[]).out.contains("\"half\""));
    let run = bake("no.exr", &["--half", "--exposure", "-28"]);
    assert!(
        run.code == Some(2) && run.err.contains("leave --half out") && !dir.path("no.exr").exists(),
        "{}",
        run.err
    );
}

#[test]
fn the_latent_does_not_depend_on_the_unit() {
    let dir = Dir::new();
    for from in [panorama(), file("night.exr")] {
        times(&dir, &from, 1.0, "one.exr");
        let first = one(&dir, &["encode", "one.exr"])["latent"].clone();
        for factor in [1e-8f32, 1e8, 1e-20, 1e20] {
            let name = format!("{factor:e}.exr");
            times(&dir, &from, factor, &name);
            let other = one(&dir, &["encode", &name])["latent"].clone();
            let shift = other["exposure"].as_f64().unwrap() - first["exposure"].as_f64().unwrap();
            assert!((shift - f64::from(factor).ln()).abs() < 1e-3, "{name}: {shift}");
            let pairs = numbers(&first["vectors"]).into_iter().zip(numbers(&other["vectors"]));
            let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 2e-3, "{name}: {worst}");
            std::fs::remove_file(dir.path(&name)).unwrap();
        }
        std::fs::remove_file(dir.path("one.exr")).unwrap();
    }
}

#[test]
fn fits_probes_and_facts_do_not_depend_on_the_unit() {
    let dir = Dir::new();
    times(&dir, &panorama(), 1.0, "one.exr");
    // the exposure that surfaces need would follow what 20 steps leave open
    let fit =
        |name: &str| one(&dir, &["fit", name, "--steps", "20", "--resolution", "32", "--exposure", "fixed"]);
    let first = fit("one.exr");
    let facts = one(&dir, &["inspect", "one.exr"]);
    let probe = |name: &str| {
        let out = format!("probe-{name}");
        dir.ok(&["render-probe", name, "-o", &out, "--size", "16", "-q"]);
        readers::exr(&dir.path(out))
    };
    let lit = probe("one.exr");
    for factor in [1e-8f32, 1e8, 1e-25, 1e25] {
        let name = format!("{factor:e}.exr");
        times(&dir, &panorama(), factor, &name);
        let other = fit(&name);
        let (a, b) = (&first["latent"], &other["latent"]);
        let shift = b["exposure"].as_f64().unwrap() - a["exposure"].as_f64().unwrap();
        assert!((shift - f64::from(factor).ln()).abs() < 1e-3, "{name}: {shift}");
        let loss = |v: &Value| v["loss"].as_f64().unwrap();
        assert!(
            (loss(&other) / loss(&first) - 1.0).abs() < 0.02,
            "{name}: {} {}",
            loss(&first),
            loss(&other)
        );
        let pixels = probe(&name).pixels;
        let pairs = pixels.iter().flatten().zip(lit.pixels.iter().flatten());
        assert!(
            pairs.filter(|(_, b)| **b > 0.0).all(|(a, b)| (a / (b * factor) - 1.0).abs() < 1e-4),
            "{name}"
        );
        let other = one(&dir, &["inspect", &name]);
        for key in ["min", "median", "mean", "max"] {
            let of = |v: &Value| v["radiance"][key].as_f64().unwrap();
            assert!((of(&other) / (of(&facts) * f64::from(factor)) - 1.0).abs() < 5e-3, "{name} {key}");
        }
        let share = |v: &Value| v["sun"]["share"].as_f64().unwrap();
        assert!((share(&other) / share(&facts) - 1.0).abs() < 0.02, "{name}");
    }
}
