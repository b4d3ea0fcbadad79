//! `inspect`, `completions`, `man`, `--help`, and how output behaves.

use std::io::Read;
use std::process::Stdio;

use crate::util::{Dir, model, panorama};

#[test]
fn a_model_is_described() {
    let dir = Dir::new();
    let text = dir.ok(&["inspect", model()]);
    for word in ["model", "hash", "D = 12", "decoder", "encoder", "prior", "training"] {
        assert!(text.contains(word), "{word} is missing in {text}");
    }
    let [facts] = &dir.json(&["inspect", model()])[..] else { panic!("one object") };
    assert_eq!(facts["kind"], "model");
    assert_eq!(facts["latent_vectors"], 4);
    assert_eq!(facts["hash"].as_str().unwrap().len(), 16);
    assert!(facts["decoder"]["parameters"].as_u64().unwrap() > 1000);
    assert!(facts["encoder"]["parameters"].as_u64().unwrap() > 1000);
    assert_eq!(facts["training"]["steps"], 2);
}

#[test]
fn a_panorama_is_measured() {
    let dir = Dir::new();
    let [facts] = &dir.json(&["inspect", &panorama()])[..] else { panic!("one object") };
    assert_eq!(facts["kind"], "OpenEXR image");
    let value = |name: &str| facts["radiance"][name].as_f64().unwrap();
    assert!(0.0 < value("min") && value("min") < value("median") && value("median") < value("max"));
    assert!(value("mean") < value("max"));
    assert!(facts["sun"]["elevation_degrees"].as_f64().unwrap() > 0.0, "an outdoor sun is above the horizon");
    let stops = facts["dynamic_range"].as_f64().unwrap();
    assert!((stops - (value("max") / value("min")).log2()).abs() < 0.01);
}

#[test]
fn several_files_give_one_line_of_json_each_and_a_bad_one_does_not_hide_the_rest() {
    let dir = Dir::new();
    dir.ok(&["bake", "--seed", "1", "-m", model(), "--size", "32", "-o", "a.exr", "-o", "a.hdr"]);
    let facts = dir.json(&["inspect", "a.exr", model(), "a.hdr"]);
    let kinds: Vec<_> = facts.iter().map(|f| f["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["OpenEXR image", "model", "Radiance HDR image"]);
    assert_eq!(facts[0]["latent"]["source"], "seed 1");
    let run = dir.run(&["inspect", "missing.exr", "a.exr"]);
    assert_eq!(run.code, Some(2));
    assert!(run.out.contains("a.exr: OpenEXR image") && run.err.contains("missing.exr"));
    assert_eq!(run.err.lines().count(), 1);
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    let dir = Dir::new();
    let commands = [
        "bake",
        "sample",
        "day",
        "synth",
        "encode",
        "evaluate",
        "fit",
        "prepare",
        "render-probe",
        "light",
        "ibl",
        "inspect",
        "bench",
        "train",
        "completions",
        "man",
    ];
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = dir.ok(&["completions", shell]);
        assert!(commands.iter().all(|c| script.contains(c)), "{shell}");
    }
    assert!(dir.ok(&["man"]).contains(".TH veni-cli"));
    dir.ok(&["man", "pages"]);
    for command in commands {
        let page = std::fs::read_to_string(dir.path(format!("pages/veni-cli-{command}.1"))).unwrap();
        assert!(page.contains("Examples"), "{command}");
    }
    dir.refused(&["man", "pages"], &["veni-cli.1", "--force"]);
    assert_eq!(
        dir.json(&["man", "pages", "--force"])[0]["files"].as_array().unwrap().len(),
        commands.len() + 1
    );
    assert_eq!(dir.json(&["completions", "bash"])[0]["shell"], "bash");
}

#[test]
fn help_goes_to_stdout_and_shows_examples() {
    let dir = Dir::new();
    for command in
        ["bake", "sample", "encode", "evaluate", "fit", "render-probe", "light", "inspect", "bench", "train"]
    {
        let text = dir.ok(&[command, "--help"]);
        assert!(text.contains("Examples:") && text.contains(&format!("veni-cli {command}")), "{command}");
        assert!(!text.contains('\u{1b}'), "no colours in a pipe");
    }
}

#[test]
fn a_closed_pipe_is_no_error() {
    let dir = Dir::new();
    let many = vec![model(); 3000];
    let mut child = dir.command(&[&["inspect"], &many[..]].concat());
    let mut child = child.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut first = [0u8; 10];
    let mut out = child.stdout.take().unwrap();
    out.read_exact(&mut first).unwrap();
    drop(out);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(output.stderr, b"");
}
