//! A training run's folder.

use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::path::Path;

use anyhow::{Result, bail};
use serde_json::Value;
use veni_core::Error;

use super::Facts;

/// The files that make a folder a run.
const METRICS: &str = "metrics.jsonl";
const CONFIG: &str = "config.toml";

pub(super) fn describe(folder: &Path) -> Result<Facts> {
    let (config, metrics) = (folder.join(CONFIG), folder.join(METRICS));
    if !config.is_file() {
        bail!("{}: a folder, but no training run: it has no {CONFIG}; name the files in it", folder.display());
    }
    let config_text = fs::read_to_string(&config).map_err(|e| Error::io(&config, "read", e))?;
    let mut facts = Facts::new("training run");
    let lines = if metrics.is_file() { read_lines(&metrics)? } else { Vec::new() };
    let last = lines.iter().rev().find_map(|l| Some((l.get("step")?.as_u64()?, l)));
    match last {
        Some((step, line)) => {
            facts.add("step", step.to_string(), step);
            facts.add("last line", line.to_string(), line.clone());
        }
        None => facts.add("step", "0 (not begun)", 0),
    }
    if let Some((name, best, step)) = best_validation(&lines) {
        facts.add(
            "best validation",
            format!("{name} {best:.4} at step {step}"),
            serde_json::json!({ "metric": name, "value": best, "step": step }),
        );
    }
    for (name, file) in [("model", "model.safetensors"), ("checkpoint", "checkpoint"), ("previews", "preview")] {
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
    let lines: Vec<_> = BufReader::new(file).lines().collect::<Result<_, _>>().map_err(|e| Error::io(path, "read", e))?;
    let mut values = Vec::with_capacity(lines.len());
    for (at, line) in lines.iter().enumerate() {
        match serde_json::from_str(line) {
            Ok(value) => values.push(value),
            Err(_) if at + 1 == lines.len() => {}
            Err(e) => bail!("{}: line {} is no JSON ({e}); the file is damaged", path.display(), at + 1),
        }
    }
    Ok(values)
}

/// The best validation PSNR: name, value, step.
fn best_validation(lines: &[Value]) -> Option<(String, f64, u64)> {
    let mut best: Option<(String, f64, u64)> = None;
    for line in lines {
        let Some((step, object)) = line.get("step").and_then(Value::as_u64).zip(line.as_object()) else { continue };
        for (name, value) in object.iter().filter(|(name, _)| name.starts_with("val") && name.contains("psnr")) {
            if let Some(value) = value.as_f64()
                && best.as_ref().is_none_or(|(_, b, _)| value > *b)
            {
                best = Some((name.clone(), value, step));
            }
        }
    }
    best
}
