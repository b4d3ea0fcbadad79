//! Single settings by their dotted names.

use toml::{Table, Value};

use super::TrainConfig;
use crate::{Error, Result};
use veni_fit::schedule::LearningRate;

impl TrainConfig {
    /// The configuration with dotted keys replaced: each override is `key.path=value`, the value in TOML
    /// (bare words are taken as strings). With `steps`, learning rates that fell until the old last step fall
    /// until the new one; another `device` brings its `decoder_backend` along and is the first of its kind, unless
    /// `decoder_backend` and `devices` are named too ([`Self::set_device`]). `stage.NAME.key.path` changes a stage, and
    /// with its steps those of the run. Keys may have the names that they had in earlier files.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the override that has no `=`, no such key, or a value of the wrong type.
    pub fn with_overrides<S: AsRef<str>>(&self, overrides: &[S]) -> Result<Self> {
        let broken =
            |text: &str, e: &dyn std::fmt::Display| Error::invalid(format!("override `{text}`: {e}"));
        let mut config = self.clone();
        let mut named = Vec::new();
        for text in overrides.iter().map(AsRef::as_ref) {
            let (path, value) = text.split_once('=').ok_or_else(|| broken(text, &"has no `=`"))?;
            let path = &present(path.trim());
            named.push(path.clone());
            let mut table = Table::try_from(&config).map_err(|e| broken(text, &e))?;
            let value = parse_value(value.trim());
            set(&mut table, path, value).map_err(|e| broken(text, &e))?;
            let steps = config.steps;
            config = table.try_into().map_err(|e: toml::de::Error| broken(text, &e.message()))?;
            let wanted = if path.starts_with("stage.") {
                config.stage.iter().map(|stage| stage.steps).sum()
            } else {
                config.steps
            };
            config.steps = steps;
            config.set_steps(wanted);
        }
        if config.device != self.device {
            let mut other = self.clone();
            other.set_device(config.device);
            if !named.iter().any(|path| path == "decoder_backend") {
                config.decoder_backend = other.decoder_backend;
            }
            if !named.iter().any(|path| path == "devices") {
                config.devices = other.devices;
            }
        }
        Ok(config)
    }

    /// Another number of updates; learning rates that fell until the old last one fall until the new one.
    pub fn set_steps(&mut self, steps: u64) {
        let second = self.latents.as_mut().map(|l| &mut l.optimiser).or(self.encoder.as_mut());
        for group in [Some(&mut self.decoder), second].into_iter().flatten() {
            match &mut group.learning_rate {
                LearningRate::Cosine { steps: end, .. } | LearningRate::Exponential { steps: end, .. }
                    if *end == self.steps =>
                {
                    *end = steps;
                }
                _ => {}
            }
        }
        self.steps = steps;
    }
}

/// Keys that had another name in earlier files: serde reads both, but only the present one replaces what is there.
const FORMER: [(&str, &str); 2] = [("decoder_by", "decoder_backend"), ("loss.level", "loss.exposure")];

/// A dotted key, of a stage or not, by its present name.
fn present(path: &str) -> String {
    let renamed = FORMER.iter().find_map(|(former, present)| {
        let before = path.strip_suffix(former).filter(|before| before.is_empty() || before.ends_with('.'));
        before.map(|before| format!("{before}{present}"))
    });
    renamed.unwrap_or_else(|| path.to_owned())
}

/// Gives the keys of a table of changes their present names.
pub(super) fn rename_former(changes: &mut Table) {
    if let Some(Value::Table(loss)) = changes.get_mut("loss")
        && let Some(weight) = loss.remove("level")
    {
        loss.entry("exposure").or_insert(weight);
    }
}

/// `value` as TOML; what TOML cannot read is a bare string.
fn parse_value(value: &str) -> Value {
    let parsed = format!("x = {value}").parse::<Table>().ok().and_then(|mut table| table.remove("x"));
    parsed.unwrap_or_else(|| Value::String(value.to_owned()))
}

/// An integer where a float stands is meant as a float.
pub(super) fn float_where_float(old: Option<&Value>, new: Value) -> Value {
    match (old, new) {
        (Some(Value::Float(_)), Value::Integer(i)) => Value::Float(i as f64),
        (_, new) => new,
    }
}

fn set(table: &mut Table, path: &str, value: Value) -> Result<(), String> {
    let (first, rest) = path.split_once('.').map_or((path, None), |(a, b)| (a, Some(b)));
    match rest {
        None => {
            let value = float_where_float(table.get(first), value);
            table.insert(first.to_owned(), value);
            Ok(())
        }
        Some(rest) => match table.get_mut(first) {
            Some(Value::Table(inner)) => set(inner, rest, value),
            Some(Value::Array(stages)) => set_in_stage(stages, rest, value),
            Some(_) => Err(format!("`{first}` holds no further keys")),
            None => Err(format!("there is no `{first}`")),
        },
    }
}

/// `path` is `NAME.key.path`. A stage holds only what it changes: tables on the way are made.
fn set_in_stage(stages: &mut [Value], path: &str, value: Value) -> Result<(), String> {
    let (name, path) = path.split_once('.').ok_or("give stage.NAME.KEY=VALUE")?;
    let mut stages = stages.iter_mut().filter_map(Value::as_table_mut);
    let stage = stages.find(|stage| stage.get("name").and_then(Value::as_str) == Some(name));
    let mut table = stage.ok_or_else(|| format!("there is no stage `{name}`"))?;
    let mut keys: Vec<_> = path.split('.').collect();
    let last = keys.pop().unwrap_or_default();
    for key in keys {
        let inner = table.entry(key).or_insert_with(|| Value::Table(Table::new()));
        table = inner.as_table_mut().ok_or_else(|| format!("`{key}` holds no further keys"))?;
    }
    let value = float_where_float(table.get(last), value);
    table.insert(last.to_owned(), value);
    Ok(())
}
