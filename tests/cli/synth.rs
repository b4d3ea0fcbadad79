//! `synth`: generated scenes as files, sheets and training data.

use std::fs;

use crate::util::{Dir, finish, panoramas, text};

const SMALL: [&str; 3] = ["--size", "32x16", "-q"];

fn synth<'a>(rest: &[&'a str]) -> Vec<&'a str> {
    [&["synth"], rest, &SMALL].concat()
}

#[test]
fn files_depend_on_seed_and_index_alone() {
    let dir = Dir::new();
    dir.ok(&synth(&["-o", "three", "-n", "3", "--seed", "9"]));
    let mut one = dir.command(&synth(&["-o", "one", "-n", "2", "--seed", "9"]));
    assert_eq!(finish(one.env("RAYON_NUM_THREADS", "1")).code, Some(0));
    let bytes = |name: &str| fs::read(dir.path(name)).unwrap();
    for k in 0..2 {
        assert_eq!(bytes(&format!("three/synth-00000{k}.exr")), bytes(&format!("one/synth-00000{k}.exr")));
    }
    assert_ne!(bytes("three/synth-000000.exr"), bytes("three/synth-000001.exr"));
    dir.ok(&synth(&["-o", "other", "-n", "1", "--seed", "10"]));
    assert_ne!(bytes("three/synth-000000.exr"), bytes("other/synth-000000.exr"));
    // half precision is scaled by a recorded power of two: read back, both have the same unit
    dir.ok(&synth(&["-o", "float", "-n", "1", "--seed", "9", "--float"]));
    let mean = |name: &str| dir.json(&["inspect", name])[0]["radiance"]["mean"].as_f64();
    let (half, float) = (mean("three/synth-000000.exr").unwrap(), mean("float/synth-000000.exr").unwrap());
    assert!((half - float).abs() < 2e-3 * float, "{half} and {float}");
}

#[test]
fn a_set_is_resumed_and_never_mixed() {
    let dir = Dir::new();
    dir.ok(&synth(&["-o", "set", "-n", "3"]));
    dir.refused(&synth(&["-o", "set", "-n", "3"]), &["synth-000000.exr", "--force", "--resume"]);
    let path = dir.path("set/synth-000001.exr");
    let whole = fs::read(&path).unwrap();
    fs::remove_file(&path).unwrap();
    let resumed = [&synth(&["-o", "set", "-n", "4", "--resume"])[..], &["--json"]].concat();
    let value: serde_json::Value = serde_json::from_str(&dir.ok(&resumed)).unwrap();
    assert_eq!((value["count"].as_u64(), value["kept"].as_u64()), (Some(4), Some(2)));
    assert_eq!(fs::read(&path).unwrap(), whole);
    assert!(dir.path("set/synth-000003.exr").is_file());
    dir.refused(&synth(&["-o", "set", "-n", "3", "--seed", "1", "--resume"]), &["synth-00000", "seed"]);
    dir.refused(
        &["synth", "-o", "set", "-n", "1", "--size", "64", "--resume", "-q"],
        &["synth-000000", "size"],
    );
    dir.ok(&synth(&["-o", "set", "-n", "1", "--seed", "1", "--force"]));
}

#[test]
fn what_is_asked_for_is_in_the_picture() {
    let dir = Dir::new();
    let asked = ["--scene", "clear", "--place", "plain", "--sun-elevation", "50", "--sun-azimuth=-70"];
    dir.ok(&synth(&[&asked[..], &["--cloud-cover", "0", "-o", "noon", "--sheet", "noon.png"]].concat()));
    let [value] = &dir.json(&["inspect", "noon/synth-000000.exr"])[..] else { panic!("one object") };
    let sun = |name: &str| value["sun"][name].as_f64().unwrap_or_else(|| panic!("{name} in {value}"));
    assert!(
        (sun("elevation_degrees") - 50.0).abs() < 6.0 && (sun("azimuth_degrees") + 70.0).abs() < 9.0,
        "{value}"
    );
    let sheet = image::open(dir.path("noon.png")).unwrap();
    assert_eq!((sheet.width(), sheet.height()), (32 + 8, 16 + 8));
    dir.ok(&synth(&["--sheet", "only.png", "-n", "9"]));
    let sheet = image::open(dir.path("only.png")).unwrap();
    assert_eq!((sheet.width(), sheet.height()), (8 * 36 + 4, 2 * 20 + 4));
    for (wrong, words) in [
        (&["-o", "x", "--turbidity", "0.5"][..], &["turbidity 0.5", "1 to 12"][..]),
        (&["-o", "x", "--cloud-cover", "2"], &["cloud cover 2"]),
        (&["-o", "x", "--sun-elevation=-91"], &["sun elevation -91"]),
        (&["-o", "x", "-n", "0"], &["--count 0"]),
        (&["-o", "only.png"], &["only.png", "folder"]),
        (&["--sheet", "sheet.jpg"], &["sheet.jpg", ".png"]),
    ] {
        dir.refused(&synth(wrong), words);
    }
    dir.refused(&["synth", "-o", "x", "--size", "30x20", "-q"], &["twice as wide"]);
}

#[test]
fn a_model_trains_on_generated_scenes_and_goes_on() {
    let dir = Dir::new();
    let val = dir.path("data/val");
    fs::create_dir_all(&val).unwrap();
    let some = fs::read_dir(panoramas().join("val")).unwrap().map(|e| e.unwrap().path());
    let some = some.filter(|p| p.extension().is_some_and(|e| e == "exr" || e == "hdr")).min().unwrap();
    fs::copy(&some, val.join(some.file_name().unwrap())).unwrap();
    let args = ["train", "--synthetic", "5", "--preset", "tiny", "--latent-vectors", "4", "--seed", "2"];
    let run = |out: &str, rest: &[&str]| {
        dir.ok(&[&args[..], &["--steps", "2", "--out", out, "--quiet"], rest].concat());
        fs::read_to_string(dir.path(out).join("metrics.jsonl")).unwrap()
    };
    let losses = |log: &str| -> Vec<serde_json::Value> {
        let parse = |line| serde_json::from_str::<serde_json::Value>(line).unwrap()["loss"].clone();
        log.lines().map(parse).filter(|v| !v.is_null()).collect()
    };
    let with_val = run("run", &["--data", &text(&dir.path("data"))]);
    let alone = run("alone", &[]);
    assert_eq!((losses(&with_val).len(), losses(&with_val)), (2, losses(&alone)));
    assert!(with_val.contains("ldr_psnr") && dir.path("alone/model.safetensors").is_file());
    let config = fs::read_to_string(dir.path("run/config.toml")).unwrap();
    assert!(config.contains("synthetic = 5"), "{config}");
    dir.ok(&["train", "--resume", "--out", "run", "--quiet"]);
    dir.refused(&["train", "--resume", "--synthetic", "6", "--out", "run", "--quiet"], &["run"]);
    let other = [&args[..1], &["--synthetic", "6"], &args[3..]].concat();
    dir.ok(&[&other[..], &["--steps", "2", "--out", "six", "--quiet"]].concat());
    let six = fs::read_to_string(dir.path("six/metrics.jsonl")).unwrap();
    assert_ne!(losses(&six), losses(&alone));
}
