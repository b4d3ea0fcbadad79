//! A model file.

use std::path::Path;

use anyhow::Result;
use serde_json::{Value, json};
use veni_light::Error;
use veni_light::model::{DecoderConfig, Model};

use super::facts::Facts;

pub(super) fn describe(path: &Path) -> Result<Facts> {
    let size = path.metadata().map_err(|e| Error::io(path, "read", e))?.len();
    let model = Model::load(path)?;
    let config = model.config();
    let mut facts = Facts::new("model");
    let kind = json!(config.kind);
    facts.add("system", kind.as_str().unwrap_or_default(), kind.clone());
    facts.add("hash", model.hash(), model.hash());
    let n = model.latent_vectors();
    facts.add("latent vectors", format!("{n} (D = {})", 3 * n), n);
    if config.lights > 0 {
        let lights = config.lights;
        facts.add("lights", format!("trained on panoramas without up to {lights}"), lights);
    }
    let d = &config.decoder;
    facts.add(
        "decoder",
        format!(
            "{} parameters; {} layers of {}, {} heads{}",
            parameters(&model, "decoder."),
            d.layers,
            d.hidden,
            d.heads,
            options(d)
        ),
        json!({ "parameters": parameters(&model, "decoder."), "config": d }),
    );
    match &config.encoder {
        Some(e) if model.has_encoder() => facts.add(
            "encoder",
            format!(
                "{} parameters; {} blocks of {} channels, {} heads of {}; {} stripes",
                parameters(&model, "encoder."),
                e.depth,
                e.channels,
                e.heads,
                e.head_channels,
                e.stripes
            ),
            json!({ "parameters": parameters(&model, "encoder."), "config": e }),
        ),
        _ => facts.add("encoder", "none: this model decodes only", Value::Null),
    }
    let info = model.info();
    let [mean, deviation] = model.prior().log_exposure();
    let prior = if model.has_prior() {
        let made = info.prior.as_deref().unwrap_or("fitted");
        format!("{made}; log exposure {mean:.2} ± {deviation:.2}")
    } else {
        "none stored: random latents are standard normal".into()
    };
    facts.add("prior", prior, json!({ "fitted": model.has_prior(), "description": info.prior }));
    match &info.training {
        Some(t) => facts.add(
            "training",
            format!(
                "{}; {} steps, seed {}{}\n{:17}{}",
                t.data,
                t.steps,
                t.seed,
                t.init.as_ref().map(|init| format!(", begun with {init}")).unwrap_or_default(),
                "",
                t.command
            ),
            json!(t),
        ),
        None => facts.add("training", "unknown", Value::Null),
    }
    facts.add("licence", info.licence.clone().unwrap_or_else(|| "not stated".into()), json!(info.licence));
    facts.add("file size", format!("{:.2} MB", size as f64 / 1e6), size);
    Ok(facts)
}

/// The options that differ from the paper's network, as they are written in a model file.
fn options(decoder: &DecoderConfig) -> String {
    let sizes = ["hidden", "layers", "heads", "vn_relu"];
    let written = json!(decoder);
    let differing =
        written.as_object().into_iter().flatten().filter(|(name, _)| !sizes.contains(&name.as_str()));
    differing.map(|(name, value)| format!("; {name} {}", value.to_string().trim_matches('"'))).collect()
}

fn parameters(model: &Model, prefix: &str) -> usize {
    model.tensors().iter().filter(|(name, _)| name.starts_with(prefix)).map(|(_, t)| t.data.len()).sum()
}
