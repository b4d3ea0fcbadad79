//! A run that is killed again and again, at any moment, ends with the weights of one that was left alone.

use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::util::{Dir, model, panoramas, text};

/// How often the run is killed.
const KILLS: usize = 20;

/// Numbers in 0..1 from a seed (a linear congruential generator's high bits).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1_u32 << 31)
    }
}

/// Both stages, weights from a model, and a checkpoint every other step: as much as can go wrong.
fn begin<'a>(data: &'a str, first: &'a str, out: &'a str) -> Vec<&'a str> {
    let mut args = vec!["train", "--data", data, "--pretrain", first, "--init", model(), "--preset", "tiny"];
    args.extend(["--latent-vectors", "4", "--seed", "3", "--pretrain-steps", "60", "--steps", "60"]);
    args.extend(["--set", "report.checkpoint_every=2", "--set", "report.validate_every=15"]);
    args.extend(["--set", "report.preview_every=30", "--set", "report.prior_copies=0", "--out", out, "-q"]);
    args
}

/// Every line of the log without what the clock says.
fn log(dir: &Dir, run: &str) -> Vec<serde_json::Value> {
    let text = std::fs::read_to_string(dir.path(run).join("metrics.jsonl")).unwrap();
    let line = |line: &str| {
        let mut value: serde_json::Value = serde_json::from_str(line).unwrap();
        for clock in ["seconds", "images_per_second"] {
            value.as_object_mut().unwrap().remove(clock);
        }
        value
    };
    text.lines().map(line).collect()
}

fn state(dir: &Dir, run: &str) -> Vec<u8> {
    std::fs::read(dir.path(run).join("checkpoint/state.safetensors")).unwrap()
}

/// The numbers of a model: its header names the command, which differs.
fn weights(dir: &Dir, run: &str) -> Vec<u8> {
    let bytes = std::fs::read(dir.path(run).join("model.safetensors")).unwrap();
    let header = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    bytes[8 + header..].to_vec()
}

#[test]
fn a_run_killed_twenty_times_ends_as_if_left_alone() {
    let dir = Dir::new();
    let (data, first) = (text(panoramas()), text(&panoramas().join("train")));
    let started = Instant::now();
    dir.ok(&begin(&data, &first, "whole"));
    let whole = started.elapsed().as_secs_f64();

    // lives so short that the run needs all of them, from before its first file to well into its steps
    let mut random = Random(7);
    let (mut begun, mut resumed, mut reached) = (0, 0, std::collections::BTreeSet::new());
    for kill in 0..KILLS {
        let is_run = dir.path("parts/config.toml").is_file();
        let args = if is_run {
            vec!["train", "--resume", "--out", "parts", "-q"]
        } else {
            begin(&data, &first, "parts")
        };
        *(if is_run { &mut resumed } else { &mut begun }) += 1;
        let mut command = dir.command(&args);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let life = 0.05 + random.next() * (0.02 * kill as f64).min(0.25) * whole;
        std::thread::sleep(Duration::from_secs_f64(life));
        child.kill().unwrap();
        let ended = child.wait_with_output().unwrap();
        // it was killed, or had come to its end: nothing else ends it
        let complained = String::from_utf8(ended.stderr).unwrap();
        assert!(ended.status.code().is_none_or(|code| code == 0), "{complained}");
        let steps = std::fs::read_to_string(dir.path("parts/metrics.jsonl")).unwrap_or_default();
        reached.insert(steps.lines().count());
    }
    assert!(begun > 0 && resumed > 5, "{begun} beginnings, {resumed} resumptions");
    assert!(reached.len() > 3, "kills at different places: {reached:?}");
    dir.ok(&["train", "--resume", "--out", "parts", "-q"]);

    assert!(weights(&dir, "whole") == weights(&dir, "parts"), "the model differs");
    assert!(state(&dir, "whole") == state(&dir, "parts"), "the checkpoint differs");
    let config = |run: &str| std::fs::read(dir.path(run).join("config.toml")).unwrap();
    assert_eq!(config("whole"), config("parts"));
    assert_eq!(log(&dir, "whole"), log(&dir, "parts"), "a line is lost, repeated or another");
    let stages: Vec<_> =
        log(&dir, "whole").iter().filter_map(|l| Some(l["stage"].as_str()?.to_owned())).collect();
    assert_eq!(stages, [vec!["pretrain"; 60], vec!["finetune"; 60]].concat());
    // a finished run that is resumed changes nothing
    dir.ok(&["train", "--resume", "--out", "parts", "-q"]);
    assert_eq!(log(&dir, "whole"), log(&dir, "parts"));
    assert!(weights(&dir, "whole") == weights(&dir, "parts"), "the model differs");
    let hidden = dir.files().into_iter().filter(|f| f.extension().is_some_and(|e| e == "part"));
    assert_eq!(
        hidden.collect::<Vec<_>>(),
        Vec::<std::path::PathBuf>::new(),
        "half-written files are cleared away"
    );
}
