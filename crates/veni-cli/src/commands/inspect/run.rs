//! A training run's folder.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use anyhow::{Result, bail};
use serde_json::Value;
use veni_light::Error;
use veni_light::limits::{MAX_SETTINGS_BYTES, read_text};

use super::facts::Facts;

/// The files that make a folder a run.
const METRICS: &str = "metrics.jsonl";
const CONFIG: &str = "config.toml";

pub(super) fn describe(folder: &Path) -> Result<Facts> {
    let (config, metrics) = (folder.join(CONFIG), folder.join(METRICS));
    if !config.is_file() {
        bail!(
            "{}: a folder, but no training run: it has no {CONFIG}; name the files in it",
            folder.display()
        );
    }
    let config_text = read_text(&config, "a configuration", MAX_SETTINGS_BYTES)?;
    let mut facts = Facts::new("training run");
    let lines = if metrics.is_file() { read_lines(&metrics)? } else { Vec::new() };
    let steps = steps_of(&config_text);
    match lines.iter().rev().find(|line| line.get("loss").is_some()) {
        Some(line) => {
            let step = line["step"].as_u64().unwrap_or(0);
            let of = steps.map(|n| format!(" of {n}")).unwrap_or_default();
            facts.add("step", format!("{step}{of}"), step);
            facts.add(
                "loss",
                format!("{:.4}", line["loss"].as_f64().unwrap_or(f64::NAN)),
                line["loss"].clone(),
            );
        }
        None => facts.add("step", "0 (not begun)", 0),
    }
    if let Some(Best { step, ldr_psnr }) = best_of(&lines) {
        facts.add(
            "best validation",
            format!("LDR PSNR {ldr_psnr:.2} dB at step {step}"),
            serde_json::json!({ "ldr_psnr": ldr_psnr, "step": step }),
        );
    }
    for (name, file) in
        [("model", "model.safetensors"), ("checkpoint", "checkpoint"), ("previews", "preview")]
    {
        let path = folder.join(file);
        let there = path.exists();
        facts.add(name, if there { path.display().to_string() } else { "none yet".into() }, there);
    }
    facts.add("config", format!("\n    {}", config_text.trim_end().replace('\n', "\n    ")), config_text);
    Ok(facts)
}

/// The lines so far; a half-written last line (the run may be alive, or was killed) is left out.
fn read_lines(path: &Path) -> Result<Vec<Value>> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let lines: Vec<_> =
        BufReader::new(file).lines().collect::<Result<_, _>>().map_err(|e| Error::io(path, "read", e))?;
    let mut values = Vec::with_capacity(lines.len());
    for (at, line) in lines.iter().enumerate() {
        match serde_json::from_str(line) {
            Ok(value) => values.push(value),
            Err(_) if at + 1 == lines.len() => {}
            Err(e) => bail!("{}: line {} is not JSON ({e}); the file is damaged", path.display(), at + 1),
        }
    }
    Ok(values)
}

/// The best validation of a run.
pub(crate) struct Best {
    pub(crate) step: u64,
    pub(crate) ldr_psnr: f64,
}

/// The best validation that a run's folder records.
#[cfg(feature = "learn")]
pub(crate) fn best(folder: &Path) -> Result<Option<Best>> {
    read_lines(&folder.join(METRICS)).map(|lines| best_of(&lines))
}

fn best_of(lines: &[Value]) -> Option<Best> {
    let validations = lines.iter().filter_map(|line| {
        let ldr_psnr = line.pointer("/validation/val/ldr_psnr")?.as_f64()?;
        Some(Best { step: line.get("step")?.as_u64()?, ldr_psnr })
    });
    validations.max_by(|a, b| a.ldr_psnr.total_cmp(&b.ldr_psnr))
}

/// The top-level `steps` of a configuration: nothing else of TOML is needed here.
fn steps_of(config: &str) -> Option<u64> {
    let top = config.lines().take_while(|line| !line.trim_start().starts_with('['));
    let mut values = top.filter_map(|line| line.split_once('=').filter(|(key, _)| key.trim() == "steps"));
    values.next()?.1.trim().parse().ok()
}
