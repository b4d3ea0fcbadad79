//! Training on more panoramas than memory may hold.

use crate::util::*;

fn args<'a>(data: &'a str, out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let settings = more.iter().flat_map(|setting| ["--set", *setting]);
    train_args(data, out, "3").into_iter().chain(settings).collect()
}

#[test]
fn a_set_beyond_its_memory_trains_the_same_model_and_leaves_no_file() {
    let dir = Dir::new();
    let data = text(panoramas());
    dir.ok(&args(&data, "memory", &[]));
    std::fs::create_dir(dir.path("scratch")).unwrap();
    let mut large = args(&data, "file", &["data.memory_mib=0", "data.scratch=\"scratch\""]);
    large.retain(|arg| *arg != "--quiet");
    let run = dir.run(&large);
    assert_eq!(run.code, Some(0), "{}", run.err);
    let note =
        run.err.lines().find(|line| line.contains("in a file")).unwrap_or_else(|| panic!("{}", run.err));
    assert!(note.contains("in scratch") && note.contains("data.memory_mib = 0"), "{note}");
    let weights = |run: &str| std::fs::read(dir.path(run).join("checkpoint/state.safetensors")).unwrap();
    assert!(weights("memory") == weights("file"));
    let model = std::fs::read(dir.path("file/model.safetensors")).unwrap();
    let contains = |word: &[u8]| model.windows(word.len()).any(|window| window == word);
    assert!(contains(b"data.memory_mib=0") && !contains(b"scratch"), "a path of this machine");
    assert!(std::fs::read_dir(dir.path("scratch")).unwrap().next().is_none());
    // it resumes as its settings say
    std::fs::remove_dir(dir.path("scratch")).unwrap();
    let resumed = dir.run(&["train", "--resume", "--out", "file", "--quiet"]);
    assert_eq!(resumed.code, Some(2));
    assert!(resumed.err.contains("scratch"), "{}", resumed.err);
}

#[test]
fn a_run_goes_on_where_its_panoramas_find_room() {
    let dir = Dir::new();
    let data = text(panoramas());
    for folder in ["one", "other"] {
        std::fs::create_dir(dir.path(folder)).unwrap();
    }
    dir.ok(&args(&data, "run", &["data.memory_mib=0", "data.scratch=one"]));
    std::fs::remove_dir(dir.path("one")).unwrap();
    let settings = std::fs::read(dir.path("run/config.toml")).unwrap();
    let resume = ["train", "--resume", "--out", "run"];
    let run = dir.run(&[&resume[..], &["--set", "data.scratch=other"]].concat());
    assert_eq!(run.code, Some(0), "{}", run.err);
    assert!(run.err.contains("in other"), "{}", run.err);
    // said with everything that it was begun with, too
    let whole = args(&data, "run", &["data.memory_mib=1000", "data.scratch=other"]);
    let run = dir.run(&[&whole[..], &["--resume"]].concat());
    assert_eq!(run.code, Some(0), "{}", run.err);
    assert_eq!(std::fs::read(dir.path("run/config.toml")).unwrap(), settings);
    // and one that was begun with neither
    dir.ok(&args(&data, "plain", &[]));
    let moved = args(&data, "plain", &["data.memory_mib=0", "data.scratch=other"]);
    let run = dir.run(&[&moved[..], &["--resume"]].concat());
    assert_eq!(run.code, Some(0), "{}", run.err);
    // anything else is another run
    for other in ["data.width=32", "loss.kld=0.5", "data.scratch"] {
        let run = dir.run(&[&resume[..], &["--set", other]].concat());
        assert_eq!(run.code, Some(2), "{other}: {}", run.err);
    }
}

#[test]
fn a_set_that_no_disk_holds_is_refused_at_once() {
    let dir = Dir::new();
    let mut many = vec!["train", "--synthetic", "100000000", "--preset", "small", "--out", "run"];
    dir.refused(&many, &["space", "100000000 panoramas", "data.scratch", "data.memory_mib"]);
    many.extend(["--set", "data.scratch=\"/nowhere\""]);
    dir.refused(&many, &["/nowhere", "data.scratch"]);
}

/// A file-size limit stands in for a disk that fills while panoramas are read.
#[cfg(unix)]
#[test]
fn a_disk_that_fills_is_one_clear_error() {
    let dir = Dir::new();
    let script = format!(
        "trap '' XFSZ; ulimit -f 8; exec '{}' train --data '{}' --preset tiny --out run --set data.memory_mib=0",
        env!("CARGO_BIN_EXE_veni-cli"),
        panoramas().display()
    );
    let run = finish(std::process::Command::new("sh").args(["-c", &script]).current_dir(dir.path("")));
    assert_eq!(run.code, Some(2), "{}", run.err);
    let last = run.err.lines().last().unwrap_or_default();
    assert!(last.contains("File too large") && last.contains("data.scratch"), "{}", run.err);
    assert!(dir.files().is_empty(), "{:?}", dir.files());
}
