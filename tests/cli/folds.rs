//! Cross-validation: what `train --fold` holds back is what `evaluate --fold` reports on.

use std::collections::BTreeSet;

use crate::util::{Dir, model, panoramas, text, train_args};

/// The panoramas that `evaluate --fold` takes.
fn evaluated(dir: &Dir, fold: &str) -> BTreeSet<String> {
    let data = text(panoramas());
    let args =
        ["evaluate", "reconstruction", "--model", model(), "--data", &data, "--fold", fold, "--out", "eval"];
    dir.ok(&[&args[..], &["--quick", "--size", "32", "--baselines", "none", "--table", "csv"]].concat());
    let table = std::fs::read_to_string(dir.path("eval/reconstruction-images.csv")).unwrap();
    let names: BTreeSet<_> =
        table.lines().skip(1).filter_map(|line| line.split(',').next()).map(str::to_owned).collect();
    assert!(!names.is_empty(), "{table}");
    names
}

#[test]
fn every_panorama_is_held_back_once_and_trained_on_otherwise() {
    let (dir, data) = (Dir::new(), text(panoramas()));
    let mut seen = BTreeSet::new();
    for fold in ["1/3", "2/3", "3/3"] {
        for name in evaluated(&dir, fold) {
            assert!(seen.insert(name.clone()), "{name} is in two parts");
        }
    }
    let train: BTreeSet<_> = std::fs::read_dir(panoramas().join("train"))
        .unwrap()
        .map(|entry| entry.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    assert_eq!(seen, train, "val/ is not used, and nothing of train/ is left out");

    dir.ok(&[&train_args(&data, "run", "1")[..], &["--fold", "2/3"]].concat());
    let trained = &dir.json(&["inspect", "run/model.safetensors"])[0]["training"];
    let count = train.len() - evaluated(&dir, "2/3").len();
    assert!(trained["data"].as_str().unwrap().starts_with(&format!("{count} panoramas")), "{trained}");
    assert!(trained["command"].as_str().unwrap().contains("--fold 2/3"), "{trained}");
    assert!(std::fs::read_to_string(dir.path("run/config.toml")).unwrap().contains("fold = \"2/3\""));
}

#[test]
fn parts_that_are_not_there_are_refused() {
    let (dir, data) = (Dir::new(), text(panoramas()));
    let train = train_args(&data, "run", "1");
    dir.refused(&[&train[..], &["--fold", "99/99"]].concat(), &["99/99", "fewer folds"]);
    dir.refused(&[&train[..], &["--set", "data.fold=second"]].concat(), &["second", "1/4"]);
    let evaluate = ["evaluate", "reconstruction", "--model", model(), "--data", &data, "--out", "eval"];
    dir.refused(&[&evaluate[..], &["--fold", "99/99"]].concat(), &["99/99", "fewer folds"]);
    assert!(!dir.path("run").exists() && !dir.path("eval").exists());
}
