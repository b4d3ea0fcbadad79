//! Skies on request: what is asked is what comes, measured in the files.

use serde_json::Value;

use crate::util::Dir;

/// Angle between two directions given in degrees of azimuth and elevation.
fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    let unit = |[azimuth, elevation]: [f64; 2]| {
        let ((sa, ca), (se, ce)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
        [ce * ca, ce * sa, se]
    };
    let cosine: f64 = unit(a).iter().zip(unit(b)).map(|(a, b)| a * b).sum();
    cosine.clamp(-1.0, 1.0).acos().to_degrees()
}

fn number(value: &Value, name: &str) -> f64 {
    value[name].as_f64().unwrap_or_else(|| panic!("{name} in {value}"))
}

fn only(values: Vec<Value>) -> Value {
    let [value] = &values[..] else { panic!("one object: {values:?}") };
    value.clone()
}

/// The number before `unit`.
fn kelvins(said: &str, unit: &str) -> f64 {
    said.split(unit).next().unwrap().rsplit(' ').next().unwrap().parse().unwrap()
}

#[test]
fn the_sun_is_where_it_is_asked_to_be_and_lights_as_asked() {
    let dir = Dir::new();
    for (seed, sun, overcast) in
        [("7", [120.0, 35.0], 0.2), ("8", [-30.0, 8.0], 0.5), ("9", [179.0, 70.0], 0.12)]
    {
        let (sun_text, share) = (format!("{},{}", sun[0], sun[1]), overcast.to_string());
        let asked = ["--sun", &sun_text, "--overcast", &share];
        let out = format!("{seed}.exr");
        let said =
            only(dir.json(&[&["bake", "--seed", seed, "-o", &out, "--size", "512"], &asked[..]].concat()));
        assert!((number(&said["asked"], "azimuth") - sun[0]).abs() < 1e-9, "{said}");
        // the file itself, by the command that measures any panorama
        let light = only(dir.json(&["light", &out]));
        let found = [number(&light["sun"], "azimuth"), number(&light["sun"], "elevation")];
        assert!(apart(found, sun) < 2.0, "{sun:?}: {light}");
        let measured = &said["measured"];
        assert!(apart([number(measured, "azimuth"), number(measured, "elevation")], sun) < 2.0, "{said}");
        assert!((number(measured, "overcast") / overcast - 1.0).abs() < 0.1, "{said}");
        let text = said["latent"]["source"].as_str().unwrap();
        assert!(text.contains(&format!("seed {seed}, sun at")) && text.contains("overcast"), "{text}");
    }
    let said = dir.ok(&["bake", "--seed", "7", "-o", "warm.exr", "--size", "512", "--temperature", "4500"]);
    let kelvin = kelvins(&said, " K (");
    assert!((kelvin / 4500.0 - 1.0).abs() < 0.1, "{said}");
    // `light` measures the file, whose floats are of half precision
    let light = dir.ok(&["light", "warm.exr"]);
    assert!((kelvins(&light, " K\n") / kelvin - 1.0).abs() < 1e-3, "{light}{said}");
}

#[test]
fn with_a_sun_or_without() {
    let dir = Dir::new();
    for seed in ["1", "2", "3", "4"] {
        let bake = |sun: &str, out: &str| {
            let args = ["bake", "--seed", seed, "--sun", sun, "-o", out, "--size", "256", "--force"];
            only(dir.json(&args))["latent"]["sun"].clone()
        };
        assert!(bake("any", "any.exr").is_object(), "seed {seed}");
        assert!(bake("none", "none.exr").is_null(), "seed {seed}");
    }
    // a sheet of them
    dir.ok(&["sample", "-o", "sheet.png", "-n", "4", "--size", "64", "--sun", "any", "--latents", "codes"]);
    for seed in 0..4 {
        let code = std::fs::read_to_string(dir.path(format!("codes/sky-{seed}.json"))).unwrap();
        assert!(code.contains("\"sun\":{"), "{code}");
    }
}

#[test]
fn a_time_and_a_place() {
    let dir = Dir::new();
    let args =
        ["bake", "--seed", "8", "-o", "noon.exr", "--size", "256", "--date", "2026-03-20T12:07Z", "--place"];
    let run = dir.run(&[&args[..], &["50,0"]].concat());
    assert!(run.code == Some(0) && run.err.contains("the sun is at -89.9"), "{}", run.err);
    let light = only(dir.json(&["light", "noon.exr"]));
    let found = [number(&light["sun"], "azimuth"), number(&light["sun"], "elevation")];
    // due south is at the right quarter, as on a map whose middle column is east
    assert!(apart(found, [-90.0, 40.0]) < 2.0, "{light}");
    let night =
        ["bake", "--seed", "7", "-o", "night.exr", "--size", "64", "--date", "2026-03-20T00:07Z", "--place"];
    let run = dir.run(&[&night[..], &["50,0"]].concat());
    assert!(run.code == Some(0) && run.err.contains("below the horizon"), "{}", run.err);
}

#[test]
fn a_day_from_east_to_west() {
    let dir = Dir::new();
    let args = ["day", "--seed", "7", "--place", "48.1,11.6", "--date", "2026-06-21", "--frames", "11"];
    let args = [&args[..], &["-o", "day", "--size", "64", "--format", "exr,png"]].concat();
    let frames = dir.json(&args);
    assert_eq!(frames.len(), 11);
    let azimuths: Vec<_> = frames.iter().map(|frame| number(&frame["asked"], "azimuth")).collect();
    assert!(azimuths[0].abs() < 60.0 && azimuths[10].abs() > 120.0, "{azimuths:?}");
    for (at, frame) in frames.iter().enumerate() {
        for format in ["exr", "png"] {
            assert!(dir.path(format!("day/{at:02}.{format}")).exists());
        }
        let sun = |part: &str| [number(&frame[part], "azimuth"), number(&frame[part], "elevation")];
        // of a sun on the horizon there is hardly any light to find it by
        assert!(sun("asked")[1] < 5.0 || apart(sun("asked"), sun("measured")) < 2.0, "{frame}");
    }
    dir.refused(&args, &["day/00.exr", "--force"]);
    let polar = ["day", "--place", "80,0", "--date", "2026-12-21", "-o", "polar"];
    dir.refused(&polar, &["does not rise"]);
}

#[test]
fn wishes_that_make_no_sense_are_refused() {
    let dir = Dir::new();
    let refused = |args: &[&str], word: &str| {
        dir.refused(&[&["bake", "-o", "a.exr"], args].concat(), &[word]);
    };
    let misused = |args: &[&str], word: &str| {
        let run = dir.run(&[&["bake", "-o", "a.exr"], args].concat());
        assert!(run.code == Some(2) && run.err.contains(word), "{args:?}: {}", run.err);
    };
    misused(&["--seed", "1", "--sun", "120"], "azimuth and elevation");
    misused(&["--seed", "1", "--sun", "120,0"], "above 0");
    misused(&["--seed", "1", "--sun", "120,x"], "not a number");
    refused(&["--seed", "1", "--overcast", "2"], "between 0.02");
    refused(&["--seed", "1", "--overcast", "1", "--sun", "any"], "exclude each other");
    refused(&["--seed", "1", "--temperature", "300"], "between 2000");
    misused(&["--seed", "1", "--date", "2026-03-20T12:07Z"], "--place");
    misused(&["--seed", "1", "--date", "noon", "--place", "1,1"], "is not a time");
    dir.ok(&["bake", "--seed", "1", "-o", "b.exr", "--size", "64"]);
    refused(&["b.exr", "--sun", "any"], "--seed");
}
