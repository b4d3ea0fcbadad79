//! What training reads: settings, checkpoints, weights of other programs.

use std::path::Path;

use veni_core::import::Checkpoint;
use veni_core::train::checkpoint;
use veni_core::train::config::TrainConfig;
use veni_core::train::presets::Preset;

use super::{Target, untouched};

pub(super) const TARGETS: &[Target] = &[
    Target { name: "settings", run: settings, seeds: lines, repair: untouched },
    Target { name: "config", run: config, seeds: configs, repair: untouched },
    Target { name: "run", run, seeds: checkpoints, repair: untouched },
    Target { name: "weights", run: weights, seeds: pickles, repair: untouched },
];

fn text(path: &Path) -> Option<String> {
    String::from_utf8(std::fs::read(path).ok()?).ok()
}

/// Each line is a `--set`.
fn settings(path: &Path) -> bool {
    let Some(text) = text(path) else { return false };
    let lines: Vec<&str> = text.lines().take(8).collect();
    Preset::Tiny.config(4).with_overrides(&lines).and_then(|config| config.check()).is_ok()
}

fn config(path: &Path) -> bool {
    text(path).is_some_and(|text| TrainConfig::from_toml(&text).and_then(|config| config.check()).is_ok())
}

fn run(path: &Path) -> bool {
    checkpoint::load(path).is_ok()
}

fn weights(path: &Path) -> bool {
    Checkpoint::open(path).is_ok()
}

fn lines() -> Vec<Vec<u8>> {
    vec![b"steps=500\nloss.kld=1\nmodel.encoder.depth=2\n".to_vec(), b"seed=7".to_vec()]
}

fn configs() -> Vec<Vec<u8>> {
    Preset::Tiny.config(4).to_toml().map(String::into_bytes).into_iter().collect()
}

fn checkpoints() -> Vec<Vec<u8>> {
    let head = br#"{"__metadata__":{"veni-checkpoint":"{\"format\":1,\"step\":3,\"best\":null}"},"first.a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}}"#;
    vec![[&(head.len() as u64).to_le_bytes()[..], head, &[0, 0, 128, 63]].concat()]
}

fn pickles() -> Vec<Vec<u8>> {
    // {"a": 1} in the second protocol, in a zip archive's place only by name
    let pickle = b"\x80\x02}q\x00X\x01\x00\x00\x00aq\x01K\x01s.".to_vec();
    let name = b"archive/data.pkl";
    let local = [
        &b"PK\x03\x04\x14\0\0\0\0\0\0\0\0\0"[..],
        &[0; 4],
        &(pickle.len() as u32).to_le_bytes(),
        &(pickle.len() as u32).to_le_bytes(),
        &(name.len() as u16).to_le_bytes(),
        &[0; 2],
        name,
        &pickle,
    ]
    .concat();
    let central = [
        &b"PK\x01\x02\x14\0\x14\0\0\0\0\0\0\0\0\0"[..],
        &[0; 4],
        &(pickle.len() as u32).to_le_bytes(),
        &(pickle.len() as u32).to_le_bytes(),
        &(name.len() as u16).to_le_bytes(),
        &[0; 16],
        name,
    ]
    .concat();
    let end = [
        &b"PK\x05\x06\0\0\0\0\x01\0\x01\0"[..],
        &(central.len() as u32).to_le_bytes(),
        &(local.len() as u32).to_le_bytes(),
        &[0; 2],
    ]
    .concat();
    vec![[local, central, end].concat()]
}
