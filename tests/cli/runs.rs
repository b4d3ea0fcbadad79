//! A run's folder belongs to one process, its settings have bounds, and what is in it leads nowhere else.

use std::io::Read;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::util::{Dir, panoramas, text, train_args};

/// A run that takes long: as many steps as anyone waits for.
fn long<'a>(data: &'a str, out: &'a str) -> Vec<&'a str> {
    let mut args = train_args(data, out, "100000");
    args.extend(["--set", "report.checkpoint_every=2", "--set", "report.validate_every=0"]);
    args
}

fn wait_for(what: &str, is_there: impl Fn() -> bool) {
    let patience = Instant::now();
    while !is_there() {
        assert!(patience.elapsed() < Duration::from_secs(120), "{what} never came");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// The command that the model file names.
fn recorded(dir: &Dir, run: &str) -> String {
    let bytes = std::fs::read(dir.path(run).join("model.safetensors")).unwrap();
    let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let header: serde_json::Value = serde_json::from_slice(&bytes[8..8 + length]).unwrap();
    let veni: serde_json::Value =
        serde_json::from_str(header["__metadata__"]["veni"].as_str().unwrap()).unwrap();
    veni["training"]["command"].as_str().unwrap().to_owned()
}

#[test]
fn one_process_trains_in_a_folder() {
    let dir = Dir::new();
    let data = text(panoramas());
    let mut command = dir.command(&long(&data, "run"));
    let mut first = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    wait_for("a checkpoint", || dir.path("run/checkpoint/state.safetensors").exists());
    let id = first.id().to_string();
    for args in
        [&["train", "--resume", "--out", "run", "-q"][..], &[&long(&data, "run")[..], &["--force"]].concat()]
    {
        let run = dir.run(args);
        assert_eq!(run.code, Some(2), "{args:?}: {}{}", run.out, run.err);
        assert!(run.err.contains("another process") && run.err.contains(&id), "{}", run.err);
    }
    assert!(first.try_wait().unwrap().is_none(), "the first goes on");
    first.kill().unwrap();
    first.wait().unwrap();
    // a killed process holds nothing; of two that resume at once one goes on
    let resume = || {
        let mut command = dir.command(&["train", "--resume", "--out", "run", "-q"]);
        command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    };
    let mut both = [resume(), resume()];
    let patience = Instant::now();
    while both.iter_mut().all(|child| child.try_wait().unwrap().is_none()) {
        assert!(patience.elapsed() < Duration::from_secs(120), "both go on");
        std::thread::sleep(Duration::from_millis(20));
    }
    let ended: Vec<_> = both.iter_mut().map(|child| child.try_wait().unwrap()).collect();
    let codes: Vec<_> = ended.iter().flatten().map(|status| status.code()).collect();
    assert_eq!(codes, [Some(2)], "one was refused, one trains");
    for child in &mut both {
        let _ = child.kill();
        child.wait().unwrap();
    }
}

#[test]
fn a_run_killed_at_once_records_the_command_that_began_it() {
    let dir = Dir::new();
    let data = text(panoramas());
    dir.ok(&train_args(&data, "whole", "3"));
    let mut command = dir.command(&train_args(&data, "run", "3"));
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    wait_for("a run", || dir.path("run/config.toml").exists());
    child.kill().unwrap();
    child.wait().unwrap();
    let _ = std::fs::remove_file(dir.path("run/model.safetensors"));
    dir.ok(&["train", "--resume", "--out", "run", "-q"]);
    let expected = recorded(&dir, "whole");
    assert!(expected.contains("--preset tiny") && expected.contains("--steps 3"), "{expected}");
    assert_eq!(recorded(&dir, "run"), expected.replace("--out whole", "--out run"));
}

#[test]
fn settings_are_refused_at_the_start_by_name_value_and_bounds() {
    let dir = Dir::new();
    let data = text(panoramas());
    for (set, words) in [
        ("batch=1000000000000", ["batch = 1000000000000", "1..=65536"]),
        ("decoder.learning_rate.rate=1e300", ["decoder.learning_rate.rate = 1", "0..=10"]),
        ("encoder.learning_rate.rate=nan", ["encoder.learning_rate.rate = NaN", "0..=10"]),
        ("loss.kld=-1", ["loss.kld = -1", "0..="]),
        ("decoder.adam.epsilon=0", ["decoder.adam.epsilon = 0", "..=1"]),
        ("data.width=10000000", ["data.width = 10000000", "..=8192"]),
        ("data.synthetic=1000000000000", ["data.synthetic = 1000000000000", "0..="]),
    ] {
        dir.refused(&[&train_args(&data, "run", "1")[..], &["--set", set]].concat(), &words);
    }
}

#[cfg(unix)]
#[test]
fn links_in_a_run_lead_nowhere() {
    use std::os::unix::fs::symlink;
    let data = text(panoramas());
    for name in ["metrics.jsonl", "checkpoint", "preview", ".lock"] {
        let dir = Dir::new();
        dir.ok(&train_args(&data, "run", "2"));
        std::fs::create_dir(dir.path("mine")).unwrap();
        for file in [
            "mine/state.safetensors",
            "mine/step-000002.png",
            "mine/metrics.jsonl",
            "mine/.state.safetensors.0123456789abcdef-0.part",
        ] {
            dir.write(file, "precious");
        }
        let inside = dir.path("run").join(name);
        let is_folder = inside.is_dir();
        if is_folder {
            std::fs::remove_dir_all(&inside).unwrap();
        } else {
            std::fs::remove_file(&inside).unwrap();
        }
        let target = if is_folder { dir.path("mine") } else { dir.path("mine/metrics.jsonl") };
        symlink(&target, &inside).unwrap();
        let survives = || {
            for file in [
                "state.safetensors",
                "step-000002.png",
                "metrics.jsonl",
                ".state.safetensors.0123456789abcdef-0.part",
            ] {
                let kept = std::fs::read_to_string(dir.path("mine").join(file)).unwrap();
                assert_eq!(kept, "precious", "{name}: {file}");
            }
        };
        let run = dir.run(&["train", "--resume", "--out", "run", "-q"]);
        assert!(run.code == Some(2) && run.err.contains("symbolic link"), "{name}: {}", run.err);
        survives();
        let run = dir.run(&[&train_args(&data, "run", "2")[..], &["--force"]].concat());
        assert!(run.code == Some(2) && run.err.contains("symbolic link"), "{name}: {}", run.err);
        survives();
    }
    // an evaluation's folder
    let dir = Dir::new();
    std::fs::create_dir_all(dir.path("out")).unwrap();
    std::fs::create_dir_all(dir.path("mine")).unwrap();
    dir.write("out/evaluation.json", "{}");
    for name in ["figures", "results"] {
        symlink(dir.path("mine"), dir.path("out").join(name)).unwrap();
        let args = ["evaluate", "interpolation", "--data", &data, "--out", "out", "--quick", "-q"];
        let run = dir.run(&[&args[..], &["--images", "2", "--size", "32"]].concat());
        assert!(run.code == Some(2) && run.err.contains("symbolic link"), "{name}: {}", run.err);
        assert_eq!(std::fs::read_dir(dir.path("mine")).unwrap().count(), 0);
        std::fs::remove_file(dir.path("out").join(name)).unwrap();
    }
}

/// `--force` removes what a run wrote; a user's own notes in its folders are not that.
#[test]
fn what_a_run_did_not_write_keeps_it_from_being_replaced() {
    let dir = Dir::new();
    let data = text(panoramas());
    dir.ok(&train_args(&data, "run", "1"));
    let again = [&train_args(&data, "run", "1")[..], &["--force"]].concat();
    for own in ["run/preview/notes.txt", "run/checkpoint/best.safetensors", "run/notes.txt"] {
        dir.write(own, "mine");
        dir.refused(&again, &[Path::new(own).file_name().unwrap().to_str().unwrap(), "beside its run"]);
        std::fs::remove_file(dir.path(own)).unwrap();
    }
    dir.ok(&again);
}

#[cfg(unix)]
#[test]
fn a_request_to_terminate_is_answered_while_data_is_read_and_while_it_trains() {
    let dir = Dir::new();
    let data = text(panoramas());
    let terminate = |child: &std::process::Child| {
        let id = child.id().to_string();
        assert!(std::process::Command::new("kill").args(["-TERM", &id]).status().unwrap().success());
        Instant::now()
    };
    // generating a million scenes takes hours
    let mut command =
        dir.command(&[&train_args(&data, "never", "1")[..], &["--synthetic", "1000000"]].concat());
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_secs(2));
    let sent = terminate(&child);
    child.wait().unwrap();
    assert!(sent.elapsed() < Duration::from_secs(3) && !dir.path("never").exists());
    // between updates it writes a checkpoint and can be gone on with
    let mut command = dir.command(&long(&data, "run"));
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    wait_for("a checkpoint", || dir.path("run/checkpoint/state.safetensors").exists());
    let sent = terminate(&child);
    assert_eq!(child.wait().unwrap().code(), Some(1));
    assert!(sent.elapsed() < Duration::from_secs(5), "{:?}", sent.elapsed());
    // a step of minutes is not waited for
    let slow =
        [&train_args(&data, "slow", "1")[..], &["--set", "model.latent_vectors=4096", "--set", "batch=512"]]
            .concat();
    let mut child = dir.command(&slow).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for("a run folder", || dir.path("slow/config.toml").exists());
    std::thread::sleep(Duration::from_secs(2));
    let sent = terminate(&child);
    let status = child.wait().unwrap();
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert!(sent.elapsed() < Duration::from_secs(15), "{:?}", sent.elapsed());
    let signal = std::os::unix::process::ExitStatusExt::signal(&status);
    assert!(signal == Some(15) && said.contains("no step ended within 8 s"), "{status:?}: {said}");
}

/// One bad entry never ends the whole, and is named.
#[cfg(unix)]
#[test]
fn what_cannot_be_trained_on_is_named() {
    let dir = Dir::new();
    std::fs::create_dir(dir.path("in")).unwrap();
    for entry in std::fs::read_dir(panoramas().join("train")).unwrap().take(3) {
        let path = entry.unwrap().path();
        std::fs::copy(&path, dir.path("in").join(path.file_name().unwrap())).unwrap();
    }
    std::os::unix::fs::symlink("/nonexistent/x.exr", dir.path("in/dangling.exr")).unwrap();
    std::os::unix::fs::symlink("..", dir.path("in/loop")).unwrap();
    image::RgbImage::from_pixel(8, 4, image::Rgb([90, 120, 200])).save(dir.path("in/photo.png")).unwrap();
    let args: Vec<_> = train_args("in", "run", "1").into_iter().filter(|arg| *arg != "--quiet").collect();
    let run = dir.run(&args);
    assert_eq!(run.code, Some(0), "{}", run.err);
    for words in [["dangling.exr", "not there"], ["photo.png", "no high dynamic range"]] {
        assert!(words.iter().all(|word| run.err.contains(word)), "{words:?}: {}", run.err);
    }
    // panoramas that are none are all named at once, before any work
    exr::prelude::write_rgb_file(dir.path("in/nan.exr"), 16, 8, |_, _| (f32::NAN, f32::NAN, f32::NAN))
        .unwrap();
    dir.write("in/text.hdr", "no image");
    dir.refused(&train_args("in", "other", "1"), &["nan.exr", "text.hdr", "2 of"]);
    let evaluate = ["evaluate", "consistency", "--data", "in", "--out", "eval", "--quick", "-q"];
    dir.refused(&evaluate, &["nan.exr", "text.hdr"]);
    // a few values are replaced, and that is said
    std::fs::remove_file(dir.path("in/text.hdr")).unwrap();
    exr::prelude::write_rgb_file(dir.path("in/nan.exr"), 32, 16, |x, y| {
        let v = if (x, y) == (3, 4) { f32::NAN } else { 1.0 + x as f32 };
        (v, v, v)
    })
    .unwrap();
    let args: Vec<_> = args.iter().map(|arg| if *arg == "run" { "again" } else { arg }).collect();
    let run = dir.run(&args);
    assert!(run.code == Some(0) && run.err.contains("nan.exr: 3 values"), "{}", run.err);
}
