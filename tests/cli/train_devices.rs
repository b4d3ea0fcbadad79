//! `train --device`: what is chosen, what it says, and what happens where it is missing. That devices compute the same
//! numbers is tested in veni-core (`train::device_tests`).

use crate::util::{Dir, finish, panoramas, text, train_args};

fn args<'a>(data: &'a str, out: &'a str, device: &'a str) -> Vec<&'a str> {
    [&train_args(data, out, "2")[..], &["--device", device]].concat()
}

/// A line of a run's `config.toml`.
fn configured(dir: &Dir, run: &str, key: &str) -> String {
    let config = std::fs::read_to_string(dir.path(run).join("config.toml")).unwrap();
    let line = config.lines().find_map(|line| line.strip_prefix(key)?.trim().strip_prefix("= "));
    line.unwrap_or_else(|| panic!("{key} is not in {config}")).trim_matches('"').to_owned()
}

/// The loss of every update of a run.
fn losses(dir: &Dir, run: &str) -> Vec<f64> {
    let log = std::fs::read_to_string(dir.path(run).join("metrics.jsonl")).unwrap();
    let lines = log.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
    lines.filter_map(|line| line["loss"].as_f64()).collect()
}

#[test]
fn a_device_that_is_missing_names_the_remedy() {
    let dir = Dir::new();
    let data = text(panoramas());
    if cfg!(not(feature = "cuda")) {
        dir.refused(&args(&data, "run", "cuda"), &["device cuda", "not compiled in", "the feature cuda"]);
    }
    if cfg!(not(feature = "wgpu")) {
        dir.refused(&args(&data, "run", "wgpu"), &["device wgpu", "not compiled in", "the feature wgpu"]);
    }
}

/// Mixed precision trains and resumes where the processor has it, and is refused in one line, with nothing left behind,
/// where it does not.
#[test]
fn mixed_precision_trains_where_the_processor_has_it() {
    let dir = Dir::new();
    let data = text(panoramas());
    let mixed = |out| [args(&data, out, "flex"), vec!["--mixed-precision"]].concat();
    let run = dir.run(&mixed("run"));
    if std::fs::read_to_string("/proc/cpuinfo").is_ok_and(|cpu| cpu.contains("avx512_bf16")) {
        assert_eq!((run.code, run.err.as_str()), (Some(0), ""), "{run:?}");
        assert_eq!(configured(&dir, "run", "decoder_backend"), "kernels-bfloat16");
        let again = dir.run(&[mixed("run"), vec!["--resume"]].concat());
        assert_eq!(again.code, Some(0), "{again:?}");
        // the stored command begins the same run
        let said = dir.ok(&["inspect", "run/model.safetensors", "--json"]);
        assert!(said.contains("--mixed-precision"), "{said}");
    } else {
        assert_eq!((run.code, run.out.as_str(), run.err.lines().count()), (Some(2), "", 1), "{run:?}");
        assert!(
            run.err.contains("kernels-bfloat16") && run.err.contains("decoder_backend = kernels"),
            "{run:?}"
        );
        assert!(dir.files().is_empty(), "{:?}", dir.files());
    }
    let run = dir.run(&[args(&data, "other", "wgpu"), vec!["--mixed-precision"]].concat());
    assert!(run.code == Some(2) && run.err.contains("--mixed-precision"), "{run:?}");
    let run = dir.run(&[mixed("other"), vec!["--set", "decoder_backend=tensors"]].concat());
    assert!(run.code == Some(2) && run.err.contains("a --set takes it back"), "{run:?}");
    let tokens = ["--set", "model.decoder.conditioning=tokens"];
    let run = dir.run(&[mixed("other"), tokens.to_vec()].concat());
    assert!(run.code == Some(2) && run.err.contains("decoder_backend = tensors"), "{run:?}");
    assert!(!dir.path("other").exists());
}

/// Two shares of the processor's threads compute the run that one device computes, and the run remembers them.
#[test]
fn devices_share_a_batch_and_are_remembered() {
    let dir = Dir::new();
    let data = text(panoramas());
    let with = |out, devices| [args(&data, out, "flex"), vec!["--devices", devices]].concat();
    dir.ok(&with("two", "0,1"));
    assert_eq!(configured(&dir, "two", "devices"), "0,1");
    dir.ok(&with("one", "0"));
    let (two, one) = (losses(&dir, "two")[0], losses(&dir, "one")[0]);
    assert!((two - one).abs() < 2e-5 * one, "{two} {one}");
    assert!(dir.ok(&["inspect", "two/model.safetensors", "--json"]).contains("--devices 0,1"));

    // whatever this machine's threads are, a run goes on with what it began with
    dir.ok(&[args(&data, "two", "flex"), vec!["--resume"]].concat());
    dir.ok(&[with("two", "0,1"), vec!["--resume"]].concat());
    let run = dir.run(&[with("two", "0"), vec!["--resume"]].concat());
    assert!(run.code == Some(2) && run.err.contains("begun with 'devices = \"0,1\"'"), "{run:?}");

    for (devices, said) in [("0,0", "named twice"), ("0,1,2,3,4,5,6,7,8", "cannot be shared"), ("0,x", "x")] {
        let run = dir.run(&with("other", devices));
        assert!(run.code == Some(2) && run.err.contains(said), "{devices}: {run:?}");
    }
    let run = dir.run(&[with("other", "0,1"), vec!["--system", "reni++"]].concat());
    assert!(run.code == Some(2) && run.err.contains("whole batch"), "{run:?}");
    assert!(!dir.path("other").exists());
}

/// By itself a run takes as many shares of the threads as divide its batch.
#[test]
fn threads_are_shared_by_themselves() {
    let dir = Dir::new();
    let data = text(panoramas());
    let run = |out: &str, threads: &str, more: &[&str]| {
        let args = [&args(&data, out, "flex")[..], &["--set", "batch=4"], more].concat();
        let run = finish(dir.command(&args).env("RAYON_NUM_THREADS", threads));
        assert_eq!(run.code, Some(0), "{run:?}");
        let config = std::fs::read_to_string(dir.path(out).join("config.toml")).unwrap();
        config.contains("devices = ").then(|| configured(&dir, out, "devices"))
    };
    assert_eq!(run("one", "1", &[]), None);
    assert_eq!(run("two", "3", &[]).as_deref(), Some("0,1"));
    assert_eq!(run("named", "3", &["--set", "devices=0"]), None);
}

/// A graphics card that is not there is named, with where to look.
#[cfg(all(feature = "wgpu", feature = "gpu"))]
#[test]
fn a_card_that_is_missing_is_named() {
    if crate::gpu::skipped("a_card_that_is_missing_is_named") {
        return;
    }
    let dir = Dir::new();
    let run = dir.run(
        &[args(&text(panoramas()), "run", "wgpu"), vec!["--devices", "0,77", "--set", "batch=2"]].concat(),
    );
    assert_eq!((run.code, run.out.as_str(), run.err.lines().count()), (Some(2), "", 1), "{run:?}");
    assert!(run.err.contains("no graphics card number") && run.err.contains("inspect --devices"), "{run:?}");
    assert!(dir.files().is_empty(), "{:?}", dir.files());
}

/// A Vulkan loader that finds no driver stands in for a machine without a graphics device.
#[cfg(all(feature = "wgpu", feature = "gpu", target_os = "linux"))]
#[test]
fn without_a_graphics_device_auto_takes_the_processor_and_wgpu_is_refused() {
    use crate::gpu::without_drivers;
    let dir = Dir::new();
    let data = text(panoramas());
    let run = finish(&mut without_drivers(&dir, &args(&data, "run", "wgpu")));
    assert_eq!((run.code, run.out.as_str(), run.err.lines().count()), (Some(2), "", 1), "{run:?}");
    for word in ["device wgpu", "no usable graphics adapter", "mesa-vulkan-drivers", "flex"] {
        assert!(run.err.contains(word), "{word} is missing in {run:?}");
    }
    assert!(dir.files().is_empty(), "{:?}", dir.files());
    let run = finish(&mut without_drivers(&dir, &args(&data, "run", "auto")));
    assert_eq!((run.code, run.err.as_str()), (Some(0), ""), "{run:?}");
    assert_eq!(configured(&dir, "run", "device"), "flex");
    assert_eq!(configured(&dir, "run", "decoder_backend"), "kernels");
}

/// Two updates on the graphics device from the panoramas to the model.
#[cfg(all(feature = "wgpu", feature = "gpu"))]
#[test]
fn a_run_on_a_graphics_device_is_the_run_on_the_processor() {
    use crate::gpu::{devices, skipped};
    if skipped("a_run_on_a_graphics_device_is_the_run_on_the_processor") {
        return;
    }
    let dir = Dir::new();
    let data = text(panoramas());
    let loud = |out, device| {
        let args = args(&data, out, device);
        args.into_iter().filter(|word| *word != "--quiet").collect::<Vec<_>>()
    };
    let run = dir.run(&loud("gpu", "wgpu"));
    assert_eq!(run.code, Some(0), "{run:?}");
    let first = &devices(&dir)[0];
    let (name, software) = (first["device"].as_str().unwrap(), first["kind"] == "software");
    let said = run.err.lines().find_map(|line| line.strip_prefix("training on "));
    assert!(said.is_some_and(|said| name.starts_with(said)), "{name}: {run:?}");
    assert_eq!(run.err.contains("is a software adapter; --device flex is faster"), software, "{run:?}");
    assert_eq!(configured(&dir, "gpu", "device"), "wgpu");
    assert_eq!(configured(&dir, "gpu", "decoder_backend"), "tensors");

    let run = dir.run(&loud("cpu", "flex"));
    assert!(run.code == Some(0) && !run.err.contains("training on"), "{run:?}");
    let (ours, theirs) = (losses(&dir, "gpu"), losses(&dir, "cpu"));
    assert!(ours.len() == 2 && theirs.len() == 2, "{ours:?} {theirs:?}");
    // after one step of Adam, whose size does not depend on a gradient's, weights with none to speak of differ
    for ((a, b), allowed) in ours.iter().zip(&theirs).zip([2e-5, 1e-2]) {
        assert!((a - b).abs() < allowed * b, "{ours:?} {theirs:?}");
    }
    // 'auto' never takes a software adapter
    dir.ok(&args(&data, "auto", "auto"));
    let chosen = if software { "flex" } else { "wgpu" };
    assert!([chosen, "cuda"].contains(&configured(&dir, "auto", "device").as_str()));
}

/// Two stages on the graphics device, killed in the second: what goes on from the checkpoint is the run that was left alone.
#[cfg(all(unix, feature = "wgpu", feature = "gpu"))]
#[test]
fn stages_on_a_graphics_device_go_on_from_their_checkpoint() {
    use std::process::Stdio;
    use std::time::{Duration, Instant};
    if crate::gpu::skipped("stages_on_a_graphics_device_go_on_from_their_checkpoint") {
        return;
    }
    let dir = Dir::new();
    let data = text(panoramas());
    let more = ["--device", "wgpu", "--pretrain-synthetic", "2", "--pretrain-steps", "2"];
    let often = ["--set", "report.checkpoint_every=1"];
    let args = |out: &'static str| [&train_args(&data, out, "40")[..], &more, &often].concat();
    dir.ok(&args("whole"));
    let mut command = dir.command(&args("parts"));
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let started = Instant::now();
    let log = dir.path("parts/metrics.jsonl");
    let logged = || std::fs::read_to_string(&log).map_or(0, |text| text.matches("\"loss\"").count());
    while logged() < 5 {
        assert!(started.elapsed() < Duration::from_secs(180), "no five steps in three minutes");
        assert!(child.try_wait().unwrap().is_none(), "the run ended by itself");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let before = logged();
    assert!(before < 42, "killed too late for the test to say anything");

    dir.ok(&["train", "--resume", "--out", "parts", "--quiet"]);
    assert_eq!(configured(&dir, "parts", "device"), "wgpu");
    let (left_alone, gone_on) = (losses(&dir, "whole"), losses(&dir, "parts"));
    assert_eq!((left_alone.len(), gone_on.len()), (42, 42), "every step is logged once");
    let log = std::fs::read_to_string(&log).unwrap();
    assert_eq!(log.matches("\"stage\":\"pretrain\"").count(), 2, "{log}");
    assert_eq!(log.matches("\"stage\":\"finetune\"").count(), 40, "{log}");
    // a device may add in another order from run to run, and Adam's steps do not shrink with a gradient
    let apart = |from: usize, to: usize| {
        let pairs = left_alone[from..to].iter().zip(&gone_on[from..to]);
        pairs.map(|(a, b)| (a - b).abs() / a).fold(0.0, f64::max)
    };
    assert!(apart(0, 1) < 2e-5 && apart(1, 10) < 2e-2, "{left_alone:?} {gone_on:?}");
    // the panoramas of a step, and the weights they meet, show in its loss
    let steps = left_alone.windows(2).map(|pair| (pair[0] - pair[1]).abs() / pair[0]);
    assert!(steps.fold(0.0, f64::max) > 0.1, "no step could be mistaken for another: {left_alone:?}");
}
