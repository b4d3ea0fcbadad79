//! Seconds of a training step and peak memory, as one line of JSON: our side of `benches/peer/`.
//!
//! `cargo run --release -p veni-research --example train_step -- DATA PRESET LATENT_VECTORS STEPS [--record FILE] [key=value …]`
//!
//! One step is not timed, STEPS are. Batches are prepared beforehand; a run does it on another thread. `--record` also
//! writes weights, batch, losses and gradients of the first step, so that others can compute the same.

#![allow(clippy::print_stdout, reason = "a program for a terminal")]

use std::path::{Path, PathBuf};
use std::time::Instant;

use veni_core::data::Splits;
use veni_core::model::Array;
use veni_core::train::checkpoint::{self, CheckpointInfo};
use veni_core::train::network::{Network, Prepared};
use veni_core::train::optimiser::{Group, Optimiser};
use veni_core::train::presets::Preset;
use veni_core::train::replicas::{Computed, Replicas};
use veni_core::vae::weights::{self, Weights};
use veni_core::{Error, Result};

/// As the training example.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let usage =
        || Error::invalid("usage: train_step DATA PRESET LATENT_VECTORS STEPS [--record FILE] [key=value …]");
    let [data, preset, latent_vectors, steps, rest @ ..] = arguments.as_slice() else {
        return Err(usage());
    };
    let (record_to, overrides) = match rest {
        [flag, file, tail @ ..] if flag == "--record" => (Some(Path::new(file)), tail),
        all => (None, all),
    };
    let preset_name = preset;
    let preset: Preset = preset.parse()?;
    let latent_vectors: usize = latent_vectors.parse().map_err(|_| usage())?;
    let steps: u64 = steps.parse().map_err(|_| usage())?;
    let mut config = preset.config(latent_vectors).with_overrides(overrides)?;
    config.data.folders = vec![PathBuf::from(data)];
    if !overrides.iter().any(|text| text.starts_with("devices=")) {
        // as `veni-cli train` does
        config.share_threads(rayon::current_num_threads());
    }
    config.check()?;

    let splits = Splits::open(&config.data, config.seed)?;
    let opened = config.device.open_all(&config.devices)?;
    let devices: Vec<_> = opened.into_iter().map(|opened| opened.device.autodiff()).collect();
    config.decoder_backend.check()?;
    let start_bytes = status_bytes("VmRSS");
    let network = Network::new(&config, splits.train.len(), &devices[0])?;
    let parameters: usize = weights::read(&network, "").values().map(|w| w.data.len()).sum();
    let groups = config.groups().into_iter();
    let groups = groups.map(|(prefix, g)| Group { prefix: prefix.into(), adam: g.adam });
    let mut optimiser = Optimiser::new(&network, groups.collect(), config.ema_decay)?;
    let source = network.source(&config, &splits.train)?;
    let batches: Vec<Prepared> = (1..=1 + steps).map(|step| source.prepare(step)).collect();
    let mut replicas = Replicas::new(network, &config, &devices)?;

    let (mut seconds, mut losses) = (Vec::new(), Vec::new());
    for batch in batches {
        let (step, recorded) = (batch.step(), record_to.map(|path| (path, batch.clone())));
        let clock = Instant::now();
        let computed = replicas.gradients(batch, config.accumulate);
        losses.push(computed.value);
        if let (Some((path, batch)), 1) = (recorded, step) {
            record(path, replicas.first(), &batch, &computed)?;
        }
        let configured = config.groups();
        let rates: Vec<_> = configured.iter().map(|(_, g)| g.learning_rate.at(step - 1)).collect();
        optimiser.update(&computed.gradients, &rates);
        replicas.write(optimiser.weights())?;
        seconds.push(clock.elapsed().as_secs_f64());
    }
    if let Some(loss) = losses.iter().find(|loss| !loss.is_finite()) {
        return Err(Error::invalid(format!("a loss is {loss}")));
    }
    let [height, width] = [config.data.height, config.data.width].map(|n| n / config.loss_grid.factor());
    let said = serde_json::json!({
        "program": "ours",
        "preset": preset_name,
        "latent_vectors": latent_vectors,
        "panoramas": config.batch,
        "devices": config.devices.count(),
        "directions": height * width,
        "parameters": parameters,
        "threads": rayon::current_num_threads(),
        "version": env!("CARGO_PKG_VERSION"),
        "losses": losses,
        "first_seconds": seconds[0],
        "seconds": &seconds[1..],
        "start_bytes": start_bytes,
        "peak_bytes": status_bytes("VmHWM"),
    });
    println!("{said}");
    Ok(())
}

/// Writes one step as tensors `weight.*`, `batch.*`, `loss.*` and `gradient.*`.
fn record(path: &Path, network: &Network, batch: &Prepared, computed: &Computed) -> Result<()> {
    let Prepared::Panoramas(batch) = batch else {
        return Err(Error::invalid("only steps of auto-encoders are recorded"));
    };
    let under = |prefix: &str, weights: Weights| -> Vec<(String, Array)> {
        weights.into_iter().map(|(name, weight)| (format!("{prefix}.{name}"), weight)).collect()
    };
    let mut all: Weights = under("weight", weights::read(network, "")).into_iter().collect();
    all.extend(under("gradient", computed.gradients.clone()));
    for (name, value) in &computed.parts {
        all.insert(format!("loss.{name}"), Array { shape: vec![1], data: vec![*value as f32] });
    }
    let ([rows, columns], images) = (batch.loss_size, batch.images);
    let Network::Veni(veni) = network else { unreachable!("batches of panoramas are an auto-encoder's") };
    let stripes = veni.stripes()?;
    let looked = vec![images, stripes.stripes(), stripes.samples(), 3];
    for (name, data, shape) in [
        ("directions", &batch.stripe_directions, looked.clone()),
        ("log_radiance", &batch.stripe_samples, looked),
        ("loss_directions", &batch.loss_directions, vec![rows * columns, 3]),
        ("target", &batch.target, vec![images, rows, columns, 3]),
        ("noise", &batch.noise, vec![images, veni.latent_vectors(), 3]),
    ] {
        all.insert(format!("batch.{name}"), Array { shape, data: data.clone() });
    }
    checkpoint::save(path, &all, &CheckpointInfo::new(batch.step, None))
}

/// Bytes of an entry of this process's status in Linux; absent elsewhere.
fn status_bytes(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let value = status.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(':'))?;
    Some(1024 * value.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
}
