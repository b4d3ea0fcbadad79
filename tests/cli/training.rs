//! `train`: two steps on real panoramas, stopped, killed and resumed, refused and replaced.

use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use crate::util::{Dir, Run, interrupt, model, panoramas, text, train_args};

/// More than are made before a run is interrupted, few enough to wait for.
const STEPS: &str = "60";

fn args<'a>(data: &'a str, out: &'a str) -> Vec<&'a str> {
    [&train_args(data, out, STEPS)[..], &["--set", "report.checkpoint_every=2"]].concat()
}

/// The numbers of a model: its header names steps and command, which may differ.
fn weights(dir: &Dir, run: &str) -> Vec<u8> {
    let bytes = std::fs::read(dir.path(run).join("model.safetensors")).unwrap();
    let header = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    bytes[8 + header..].to_vec()
}

fn steps_done(dir: &Dir, run: &str) -> usize {
    let log = std::fs::read_to_string(dir.path(run).join("metrics.jsonl")).unwrap_or_default();
    log.lines().filter(|line| line.contains("\"loss\"")).count()
}

/// Starts a run and comes back when it has made a few steps.
fn under_way(dir: &Dir, run: &str) -> Child {
    let data = text(panoramas());
    let mut child = dir.command(&args(&data, run));
    let mut child = child.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let started = Instant::now();
    while steps_done(dir, run) < 5 {
        assert!(started.elapsed() < Duration::from_secs(60), "no five steps in a minute");
        assert!(child.try_wait().unwrap().is_none(), "the run ended by itself");
        std::thread::sleep(Duration::from_millis(2));
    }
    child
}

fn end(child: Child) -> Run {
    let output = child.wait_with_output().unwrap();
    Run {
        code: output.status.code(),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

#[test]
fn a_run_leaves_all_that_is_promised() {
    let dir = Dir::new();
    let data = text(panoramas());
    let [value] = &dir.json(&train_args(&data, "run", "2")[..13])[..] else { panic!("one object") };
    assert_eq!((value["finished"].as_bool(), value["steps_done"].as_u64()), (Some(true), Some(2)));
    assert!(value["best"]["ldr_psnr"].as_f64().unwrap().is_finite());
    for file in ["config.toml", "metrics.jsonl", "model.safetensors"] {
        assert!(dir.path("run").join(file).is_file(), "{file}");
    }
    assert!(std::fs::read_dir(dir.path("run/checkpoint")).unwrap().count() > 0);
    let previews: Vec<_> =
        std::fs::read_dir(dir.path("run/preview")).unwrap().map(|e| e.unwrap().path()).collect();
    assert!(!previews.is_empty());
    assert!(previews.iter().all(|p| image::open(p).is_ok()));
    assert_eq!(steps_done(&dir, "run"), 2);
    let facts = &dir.json(&["inspect", "run"])[0];
    assert_eq!((facts["kind"].as_str(), facts["step"].as_u64()), (Some("training run"), Some(2)));
    assert_eq!(facts["best_validation"]["ldr_psnr"], value["best"]["ldr_psnr"]);
    dir.ok(&["bake", "--seed", "1", "--model", "run", "--size", "16", "-o", "sky.exr"]);
    let command = dir.json(&["inspect", "run/model.safetensors"])[0]["training"]["command"].clone();
    assert_eq!(
        command,
        "veni-cli train --data panoramas --preset tiny --latent-vectors 4 --seed 3 --steps 2 --out run",
        "no path of this machine is given away"
    );
}

#[test]
fn an_auto_decoder_is_trained_by_the_same_command() {
    let dir = Dir::new();
    let data = text(panoramas());
    let args = [&train_args(&data, "run", "2")[..13], &["--system", "reni++"]].concat();
    let [value] = &dir.json(&args)[..] else { panic!("one object") };
    assert!(value["best"]["ldr_psnr"].as_f64().unwrap().is_finite());
    assert!(dir.path("run/latents.safetensors").is_file());
    assert_eq!(steps_done(&dir, "run"), 2);
    let facts = dir.json(&["inspect", "run/model.safetensors"]).remove(0);
    assert_eq!(
        facts["training"]["command"],
        "veni-cli train --data panoramas --system reni++ --preset tiny --latent-vectors 4 --seed 3 --steps 2 --out run"
    );
    dir.ok(&["bake", "--seed", "1", "--model", "run", "--size", "16", "-o", "sky.exr"]);
    // encoding needs an encoder, which it has not
    let failed = dir.run(&["encode", "sky.exr", "--model", "run", "-o", "sky.json"]);
    assert!(failed.code == Some(2) && failed.err.contains("encoder"), "{}", failed.err);
    // what starts over leaves nothing of the old run behind
    dir.ok(&[&train_args(&data, "run", "1")[..], &["--force"]].concat());
    assert!(!dir.path("run/latents.safetensors").exists());
}

#[test]
fn an_option_of_the_decoder_is_trained_shown_and_refused_where_it_cannot_serve() {
    let dir = Dir::new();
    let data = text(panoramas());
    let set = ["--set", "model.decoder.conditioning=tokens", "--set", "model.decoder.invariance=gram-matrix"];
    dir.ok(&[&train_args(&data, "run", "2")[..], &set].concat());
    let shown = dir.ok(&["inspect", "run/model.safetensors"]);
    assert!(shown.contains("conditioning tokens; invariance gram-matrix"), "{shown}");
    for command in ["bake --seed 1 -o sky.exr", "sample -o sky.png"] {
        let args: Vec<_> = command.split(' ').chain(["--model", "run"]).collect();
        dir.refused(&args, &["model.safetensors", "decoder.conditioning = tokens"]);
    }
}

#[test]
fn seeds_decide_everything() {
    let dir = Dir::new();
    let data = text(panoramas());
    dir.ok(&train_args(&data, "a", "3"));
    dir.ok(&train_args(&data, "b", "3"));
    assert_eq!(weights(&dir, "a"), weights(&dir, "b"));
    let mut other = train_args(&data, "c", "3");
    *other.iter_mut().find(|a| **a == "3").unwrap() = "4";
    dir.ok(&other);
    assert_ne!(weights(&dir, "a"), weights(&dir, "c"));
}

/// Killed without warning, then asked to stop, then resumed: the weights of a run that was left alone, to the bit.
#[cfg(unix)]
#[test]
fn interrupted_runs_end_as_if_nothing_had_happened() {
    let dir = Dir::new();
    let data = text(panoramas());
    dir.ok(&args(&data, "whole"));

    let mut child = under_way(&dir, "parts");
    child.kill().unwrap();
    let run = end(child);
    assert_eq!((run.code, run.out.as_str()), (None, ""), "killed: {}", run.err);
    let before = steps_done(&dir, "parts");
    assert!(before < 60, "killed too late for the test to say anything");

    let mut again = dir.command(&["train", "--resume", "--out", "parts"]);
    let child = again.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let deadline = Instant::now() + Duration::from_secs(60);
    while steps_done(&dir, "parts") < before + 3 {
        assert!(Instant::now() < deadline, "the resumed run does not move");
        std::thread::sleep(Duration::from_millis(2));
    }
    let signal =
        std::process::Command::new("kill").args([interrupt(), &child.id().to_string()]).status().unwrap();
    assert!(signal.success());
    let run = end(child);
    assert_eq!(run.code, Some(1), "stopped on request: {}{}", run.out, run.err);
    assert!(run.err.contains("veni-cli train --resume --out parts"), "{}", run.err);
    assert!(run.out.contains("of 60 steps"), "{}", run.out);

    // the same command with --resume is accepted too
    dir.ok(&[&args(&data, "parts")[..], &["--resume"]].concat());
    assert_eq!(weights(&dir, "whole"), weights(&dir, "parts"));
    assert_eq!(steps_done(&dir, "parts"), 60, "no step is logged twice");
}

#[test]
fn a_folder_in_use_is_refused_or_replaced() {
    let dir = Dir::new();
    let data = text(panoramas());
    let run = train_args(&data, "run", "2");
    dir.refused(&["train", "--resume", "--out", "run"], &["run", "no run to continue"]);
    dir.ok(&run);
    let first = weights(&dir, "run");
    dir.refused(&run, &["run", "--resume", "--force"]);
    let more = [&train_args(&data, "run", "3")[..], &["--resume"]].concat();
    dir.refused(&more, &["steps = 2", "steps = 3"]);
    dir.write("empty.hdr", "");
    let bad = [&train_args("empty.hdr", "run", "3")[..], &["--force"]].concat();
    dir.refused(&bad, &["empty.hdr"]);
    assert_eq!(weights(&dir, "run"), first, "bad data does not cost the old run");
    dir.ok(&[&train_args(&data, "run", "3")[..], &["--force"]].concat());
    assert_ne!(weights(&dir, "run"), first);
    dir.write("run/notes.txt", "mine");
    dir.refused(&[&run[..], &["--force"]].concat(), &["notes.txt"]);
    std::fs::create_dir(dir.path("other")).unwrap();
    dir.write("other/notes.txt", "mine");
    dir.refused(&train_args(&data, "other", "2"), &["other", "no run either"]);
    // a damaged checkpoint is named
    let state = dir.path("run/checkpoint/state.safetensors");
    let bytes = std::fs::read(&state).unwrap();
    std::fs::write(&state, &bytes[..bytes.len() / 2]).unwrap();
    dir.refused(&["train", "--resume", "--out", "run"], &["state.safetensors", "damaged"]);
}

#[test]
fn settings_come_from_files_and_single_keys() {
    let dir = Dir::new();
    let data = text(panoramas());
    let run = train_args(&data, "a", "2");
    dir.ok(&[&run[..], &["--set", "batch=1", "--set", "loss.kld=0.5"]].concat());
    let config = std::fs::read_to_string(dir.path("a/config.toml")).unwrap();
    assert!(config.contains("batch = 1\n") && config.contains("kld = 0.5\n"), "{config}");
    dir.ok(&["train", "--config", "a/config.toml", "--out", "b", "-q"]);
    assert_eq!(config, std::fs::read_to_string(dir.path("b/config.toml")).unwrap());
    assert_eq!(weights(&dir, "a"), weights(&dir, "b"));
    let run = train_args(&data, "c", "2");
    for (set, word) in
        [("nonsense=1", "nonsense"), ("batch", "="), ("batch=many", "batch"), ("batch=0", "batch")]
    {
        dir.refused(&[&run[..], &["--set", set]].concat(), &[word]);
    }
    dir.write("broken.toml", "seed = ");
    dir.refused(&["train", "--config", "broken.toml", "--data", &data, "--out", "c"], &["broken.toml"]);
}

#[test]
fn data_without_panoramas_is_refused() {
    let dir = Dir::new();
    std::fs::create_dir(dir.path("empty")).unwrap();
    dir.refused(&train_args("empty", "run", "1"), &["empty", "panorama"]);
    dir.refused(&train_args("missing", "run", "1"), &["missing"]);
}

/// Without a terminal there are plain lines, not escape codes, and not one per step.
#[test]
fn a_log_gets_few_plain_lines() {
    let dir = Dir::new();
    let data = text(panoramas());
    let mut loud = train_args(&data, "run", "20");
    loud.retain(|a| *a != "--quiet");
    let run = dir.run(&loud);
    assert_eq!(run.code, Some(0), "{}", run.err);
    assert!(!run.err.contains('\u{1b}') && !run.err.contains('\r'), "{:?}", run.err);
    assert!(run.err.lines().count() < 10, "{}", run.err);
    assert!(run.err.contains("LDR PSNR val"), "{}", run.err);
    assert_eq!(run.out.lines().count(), 1);
}

/// The training entry of a run's model.
fn training(dir: &Dir, run: &str) -> serde_json::Value {
    dir.json(&["inspect", &format!("{run}/model.safetensors")])[0]["training"].clone()
}

#[test]
fn a_run_begins_with_the_weights_of_a_model() {
    let dir = Dir::new();
    let data = text(panoramas());
    // no update at all: the run's model is the one it began with
    let none = [&train_args(&data, "none", "0")[..], &["--init", model()]].concat();
    let full = veni_light::model::Model::load(model()).unwrap();
    dir.ok(&none);
    assert_eq!(weights_of(&dir, "none", "encoder."), tensors(&full, "encoder."));
    assert_eq!(weights_of(&dir, "none", "decoder."), tensors(&full, "decoder."));
    let init = training(&dir, "none")["init"].as_str().unwrap().to_owned();
    assert!(
        init.starts_with("run/model.safetensors ") && init.ends_with(&full.digest().to_string()),
        "{init}"
    );
    let config = std::fs::read_to_string(dir.path("none/config.toml")).unwrap();
    assert!(config.contains("[init]") && config.contains(&full.digest().to_string()), "{config}");

    // a decoder alone, in both systems, and said so
    full.clone()
        .without_encoder()
        .save(dir.path("bare.safetensors"), veni_light::model::StoredType::F32, Default::default())
        .unwrap();
    for (system, word) in [("veni", "no encoder"), ("reni++", "auto-decoder")] {
        let mut args = train_args(&data, system, "0");
        args.retain(|arg| *arg != "--quiet");
        let run = dir.run(&[&args[..], &["--init", "bare.safetensors", "--system", system]].concat());
        assert!(run.code == Some(0) && run.err.contains("only its decoder"), "{}", run.err);
        assert!(run.err.contains(word), "{}", run.err);
        assert_eq!(weights_of(&dir, system, "decoder."), tensors(&full, "decoder."));
    }
    // to go on, the model is not needed any more
    dir.ok(&[&args(&data, "parts")[..], &["--init", "bare.safetensors"]].concat());
    let mut child =
        dir.command(&[&args(&data, "again")[..], &["--init", "bare.safetensors"]].concat()).spawn().unwrap();
    while !dir.path("again/config.toml").exists() {
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    std::fs::remove_file(dir.path("bare.safetensors")).unwrap();
    dir.ok(&["train", "--resume", "--out", "again", "-q"]);
    assert_eq!(weights(&dir, "parts"), weights(&dir, "again"));
    // but it is to repeat the run
    let repeat = ["train", "--config", "again/config.toml", "--out", "third", "-q"];
    dir.refused(&repeat, &["bare.safetensors"]);
}

fn tensors(model: &veni_light::model::Model, prefix: &str) -> Vec<(String, Vec<f32>)> {
    let inside = model.tensors().iter().filter(|(name, _)| name.starts_with(prefix));
    inside.map(|(name, tensor)| (name.clone(), tensor.data.clone())).collect()
}

fn weights_of(dir: &Dir, run: &str, prefix: &str) -> Vec<(String, Vec<f32>)> {
    tensors(&veni_light::model::Model::load(dir.path(run).join("model.safetensors")).unwrap(), prefix)
}

#[test]
fn a_model_that_does_not_fit_is_refused_with_its_remedy() {
    let dir = Dir::new();
    let data = text(panoramas());
    let run = train_args(&data, "run", "1");
    let refused = |more: &[&str], words: &[&str]| {
        dir.refused(
            &[&run[..], &["--init", model()], more].concat(),
            &[&["model.safetensors"], words].concat(),
        );
    };
    refused(&["--set", "model.decoder.hidden=32"], &["tensor decoder.", "--set model.decoder.hidden=16"]);
    refused(&["--set", "model.encoder.channels=32"], &["tensor encoder.", "--set model.encoder.channels=16"]);
    refused(&["--set", "model.latent_vectors=5"], &["tensor decoder.", "--latent-vectors 4"]);
    dir.refused(&[&run[..], &["--init", "nowhere.safetensors"]].concat(), &["nowhere.safetensors"]);
    // a run in that place survives it
    dir.ok(&run);
    let before = weights(&dir, "run");
    refused(&["--force", "--set", "model.decoder.layers=3"], &["tensor decoder."]);
    assert_eq!(weights(&dir, "run"), before);
}

#[test]
fn pretraining_and_finetuning_are_one_command() {
    let dir = Dir::new();
    let (data, first) = (text(panoramas()), text(&panoramas().join("train")));
    let mut args = train_args(&data, "run", "3");
    args.retain(|arg| *arg != "--quiet");
    let more = ["--pretrain", &first, "--pretrain-synthetic", "2", "--pretrain-steps", "2"];
    let sets = ["--set", "accumulate=2", "--set", "stage.finetune.batch=4"];
    let run = dir.run(&[&args[..], &more, &sets].concat());
    assert!(run.code == Some(0) && run.out.contains("5 steps"), "{}{}", run.out, run.err);
    let log = std::fs::read_to_string(dir.path("run/metrics.jsonl")).unwrap();
    let lines: Vec<serde_json::Value> = log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let stages: Vec<_> = lines.iter().filter_map(|line| line["stage"].as_str()).collect();
    assert_eq!(stages, ["pretrain", "pretrain", "finetune", "finetune", "finetune"]);
    let training = training(&dir, "run");
    assert_eq!(training["data"], "8 panoramas of panoramas; pretrain: train and 2 generated scenes");
    assert!(training["command"].as_str().unwrap().contains("--pretrain train"), "{training}");
    let config = std::fs::read_to_string(dir.path("run/config.toml")).unwrap();
    assert!(config.contains("name = \"finetune\"") && config.contains("rate = 0.0003"), "{config}");
    dir.ok(&["train", "--config", "run/config.toml", "--out", "again", "-q"]);
    assert_eq!(weights(&dir, "run"), weights(&dir, "again"));
    let reni = train_args(&data, "reni", "2");
    let reni = [&reni[..], &["--system", "reni++", "--pretrain", &first]].concat();
    dir.refused(&reni, &["--pretrain", "--init"]);
}

#[test]
fn generated_scenes_are_drawn_as_often_as_asked_and_are_no_part_of_the_prior() {
    let dir = Dir::new();
    let data = text(panoramas());
    let scenes = ["--synthetic", "3", "--set", "data.synthetic_share=0.5"];
    dir.ok(&[&train_args(&data, "run", "1")[..], &scenes].concat());
    let model = &dir.json(&["inspect", "run/model.safetensors"])[0];
    let said = "8 panoramas of panoramas and 3 generated scenes (50 % of the draws)";
    assert_eq!(model["training"]["data"], said);
    // each of the eight and one augmented copy
    assert_eq!(model["prior"]["description"], "16 training latents");
    let refused = ["--set", "data.synthetic_share=0.5"];
    dir.refused(
        &[&train_args(&data, "other", "1")[..], &refused].concat(),
        &["synthetic_share", "generated"],
    );
}
