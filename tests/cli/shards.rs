//! `--shard`: four processes at once make what one makes, to the byte.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::{Child, Stdio};

use crate::util::{Dir, model, panoramas, text};

/// The repository's panoramas, enough of them that shards are uneven.
fn inputs() -> Vec<String> {
    let mut files: Vec<_> =
        std::fs::read_dir(panoramas().join("train")).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    files.truncate(6);
    files.iter().map(|path| text(path)).collect()
}

/// Every file below a folder, by its name there.
fn files(dir: &Dir, folder: &str) -> BTreeMap<PathBuf, Vec<u8>> {
    let all = dir.files().into_iter().filter(|f| f.is_file());
    let inside = all.filter_map(|f| Some((f.strip_prefix(dir.path(folder)).ok()?.to_owned(), f.clone())));
    inside.map(|(name, file)| (name, std::fs::read(file).unwrap())).collect()
}

/// Starts shards 1/4 to 4/4 of a command at once and waits for all; each must succeed. What they printed.
fn in_four(dir: &Dir, args: &[&str]) -> Vec<String> {
    let start = |shard: usize| -> Child {
        let shard = format!("{shard}/4");
        let mut command = dir.command(&[args, &["--shard", &shard, "-q"]].concat());
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    };
    let children: Vec<_> = (1..=4).map(start).collect();
    let outputs: Vec<_> = children.into_iter().map(|child| child.wait_with_output().unwrap()).collect();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    outputs
        .into_iter()
        .map(|out| {
            assert!(out.status.success(), "{args:?}: {}", text(out.stderr));
            text(out.stdout)
        })
        .collect()
}

/// One process into `whole` and four into `parts`, which must agree in every file.
fn agrees(dir: &Dir, args: &[&str], expected: usize) {
    dir.ok(&[args, &["--out-dir", "whole", "-q"]].concat());
    let printed = in_four(dir, &[args, &["--out-dir", "parts"]].concat());
    let (whole, parts) = (files(dir, "whole"), files(dir, "parts"));
    assert_eq!(whole.len(), expected, "{:?}", whole.keys());
    assert_eq!(whole.keys().collect::<Vec<_>>(), parts.keys().collect::<Vec<_>>());
    assert!(whole == parts, "{args:?}: files differ");
    // not one of them did it all
    assert!(printed.iter().filter(|out| !out.is_empty()).count() > 1, "{printed:?}");
    for folder in ["whole", "parts"] {
        std::fs::remove_dir_all(dir.path(folder)).unwrap();
    }
}

#[test]
fn four_shards_leave_the_files_of_one_process() {
    let dir = Dir::new();
    let inputs = inputs();
    let inputs: Vec<_> = inputs.iter().map(String::as_str).collect();
    agrees(&dir, &[&["encode", "--model", model()], &inputs[..]].concat(), 6);
    agrees(
        &dir,
        &[&["fit", "--model", model(), "--steps", "10", "--resolution", "32"], &inputs[..5]].concat(),
        5,
    );
    let skies = ["bake", "--model", model(), "--seed", "40", "--count", "6", "--format", "exr,png"];
    agrees(&dir, &[&skies[..], &["--size", "32", "--device", "cpu"]].concat(), 12);
    dir.ok(&[&["encode", "--model", model(), "--out-dir", "codes", "-q"], &inputs[..]].concat());
    let codes = files(&dir, "codes");
    let codes: Vec<_> = codes.keys().map(|name| format!("codes/{}", name.display())).collect();
    let codes: Vec<_> = codes.iter().map(String::as_str).collect();
    let bake = ["bake", "--model", model(), "--size", "32", "--device", "cpu"];
    agrees(&dir, &[&bake[..], &codes].concat(), 6);
    let probe = ["render-probe", "--model", model(), "--size", "24", "--lights", "16"];
    agrees(&dir, &[&probe[..], &codes[..3], &inputs[3..]].concat(), 6);
}

#[test]
fn shards_of_an_evaluation_leave_the_tables_to_a_last_run() {
    let dir = Dir::new();
    let data = text(panoramas());
    for protocol in ["reconstruction", "uniqueness", "consistency"] {
        let args = |out: &'static str| {
            let args = ["evaluate", protocol, "--model", model(), "--data", &data, "--out", out, "--quick"];
            let rest =
                ["--images", "3", "--size", "32", "--pairs", "120", "--frames", "3", "--baselines", "sh"];
            [args.to_vec(), rest.to_vec()].concat()
        };
        let (whole, parts) = (args("whole"), args("parts"));
        let expected = dir.json(&whole);
        let printed = in_four(&dir, &parts);
        assert!(printed.iter().all(|out| out.contains("without --shard")), "{printed:?}");
        assert!(!dir.path(format!("parts/{protocol}.json")).exists(), "no tables yet");
        let times = |folder: &str| -> BTreeMap<PathBuf, _> {
            let all = dir.files().into_iter().filter(|f| f.is_file() && f.starts_with(dir.path(folder)));
            all.map(|f| (f.clone(), f.metadata().unwrap().modified().unwrap())).collect()
        };
        let before = times("parts/results");
        assert_eq!(dir.json(&parts), expected, "{protocol}");
        assert_eq!(times("parts/results"), before, "{protocol}: nothing was left to compute");
        assert!(files(&dir, "whole") == files(&dir, "parts"), "{protocol}: files differ");
    }
}

#[test]
fn what_cannot_be_shared_out_is_refused() {
    let dir = Dir::new();
    let inputs = inputs();
    let base = ["encode", &inputs[0], &inputs[1], "--model", model(), "--out-dir", "codes", "-q"];
    for (shard, word) in [("0/4", "from 1"), ("5/4", "no shard 5"), ("1/0", "no shards of 0"), ("x", "1/4")] {
        let run = dir.run(&[&base[..], &["--shard", shard]].concat());
        assert!(run.code == Some(2) && run.err.contains(word), "{shard}: {}", run.err);
    }
    dir.refused(&[&base[..], &["--shard", "1/2", "--preview", "p.png"]].concat(), &["--preview", "shard"]);
    let fit = ["fit", &inputs[0], "--model", model(), "--completed", "c.exr", "-q", "--shard", "1/2"];
    dir.refused(&fit, &["--completed", "shard"]);
    let data = text(panoramas());
    let equivariance = ["evaluate", "equivariance", "--data", &data, "--out", "eval", "--shard", "1/2", "-q"];
    dir.refused(&equivariance, &["equivariance", "without --shard"]);
    // two inputs of one name clash whichever shard has which
    std::fs::create_dir(dir.path("other")).unwrap();
    std::fs::copy(&inputs[0], dir.path("other").join(PathBuf::from(&inputs[0]).file_name().unwrap()))
        .unwrap();
    let other = format!("other/{}", PathBuf::from(&inputs[0]).file_name().unwrap().display());
    let clash =
        ["encode", &inputs[0], &other, "--model", model(), "--out-dir", "codes", "-q", "--shard", "1/2"];
    dir.refused(&clash, &["twice"]);
    dir.refused(&["bake", "a.json", "b.json", "--model", model(), "-o", "x.exr"], &["2", "--out-dir"]);
    // more shards than inputs are no error
    let run = dir.run(&["encode", &inputs[0], "--model", model(), "--out-dir", "codes", "--shard", "3/4"]);
    assert!(run.code == Some(0) && run.out.is_empty() && run.err.contains("nothing to do"), "{}", run.err);
}

/// Scenes are inputs too; files that are prepared are examined in shards, and placed by one run that finds them done.
#[test]
fn scenes_and_training_folders_are_shared_out_too() {
    let dir = Dir::new();
    let synth = ["synth", "--count", "6", "--seed", "3", "--size", "32"];
    dir.ok(&[&synth[..], &["-o", "whole", "-q"]].concat());
    in_four(&dir, &[&synth[..], &["-o", "parts"]].concat());
    let (whole, parts) = (files(&dir, "whole"), files(&dir, "parts"));
    assert_eq!(whole.len(), 6);
    assert!(whole == parts, "scenes differ");

    let source = text(panoramas());
    let prepare = ["prepare", &source, "--size", "32", "--resplit"];
    dir.ok(&[&prepare[..], &["-o", "one", "-q"]].concat());
    in_four(&dir, &[&prepare[..], &["-o", "four"]].concat());
    let found = dir.files().into_iter().filter(|f| f.starts_with(dir.path("four/.prepare/images")));
    assert_eq!(found.filter(|f| f.is_file()).count(), 16, "all examined, none placed");
    dir.refused(&[&prepare[..], &["-o", "four", "--shard", "1/4", "--force"]].concat(), &["other shards"]);
    dir.ok(&[&prepare[..], &["-o", "four", "-q"]].concat());
    let placed = |folder| -> BTreeMap<_, _> {
        let images = files(&dir, folder).into_iter();
        images.filter(|(name, _)| name.extension().is_some_and(|e| e == "exr" || e == "png")).collect()
    };
    let (one, four) = (placed("one"), placed("four"));
    assert_eq!(one.len(), 17, "{:?}", one.keys());
    assert!(one == four, "{:?} {:?}", one.keys(), four.keys());
}
