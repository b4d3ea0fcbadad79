//! `train`: two steps on real panoramas, stopped and resumed, refused and replaced.

use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use crate::util::{Dir, finish, panoramas, text, train_args};

fn train(dir: &Dir, out: &str, steps: &str, more: &[&str]) -> String {
    let data = text(panoramas());
    dir.ok(&[&train_args(&data, out, steps)[..], more].concat())
}

fn weights(dir: &Dir, run: &str) -> Vec<u8> {
    // the header names the command line; the numbers behind it must agree to the bit
    let bytes = std::fs::read(dir.path(run).join("model.safetensors")).unwrap();
    let header = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    bytes[8 + header..].to_vec()
}

#[test]
fn a_run_leaves_all_that_is_promised() {
    let dir = Dir::new();
    let out = train(&dir, "run", "2", &[]);
    assert!(out.contains("run") && out.contains("2 steps"), "{out}");
    for file in ["config.toml", "metrics.jsonl", "model.safetensors"] {
        assert!(dir.path("run").join(file).is_file(), "{file}");
    }
    assert!(dir.path("run/checkpoint").exists());
    let previews = std::fs::read_dir(dir.path("run/preview")).unwrap().count();
    assert!(previews > 0, "no preview was written");
    let lines = std::fs::read_to_string(dir.path("run/metrics.jsonl")).unwrap();
    assert!(lines.lines().all(|l| serde_json::from_str::<serde_json::Value>(l).unwrap().is_object()));
    let facts = &dir.json(&["inspect", "run"])[0];
    assert_eq!((facts["kind"].as_str(), facts["step"].as_u64()), (Some("training run"), Some(2)));
    assert!(facts["best_validation"]["value"].as_f64().unwrap().is_finite());
    dir.ok(&["bake", "--seed", "1", "--model", "run", "--size", "16", "-o", "sky.exr"]);
}

#[test]
fn resuming_gives_what_an_uninterrupted_run_gives() {
    let dir = Dir::new();
    train(&dir, "whole", "4", &[]);
    train(&dir, "parts", "4", &["--set", "report.checkpoint_every=1", "--stop-after", "2"]);
    train(&dir, "parts", "4", &["--resume"]);
    assert_eq!(weights(&dir, "whole"), weights(&dir, "parts"));
    let other = dir.ok(&[&train_args(&text(panoramas()), "other", "4")[..], &["--seed", "4"]].concat());
    assert!(!other.is_empty());
    assert_ne!(weights(&dir, "whole"), weights(&dir, "other"), "the comparison can fail");
}
