//! A latent, in a file of its own or inside a baked image.

use std::path::Path;

use anyhow::Result;
use serde_json::{Value, json};
use veni_light::latent::Latent;
use veni_light::light::CompactLight;
use veni_light::vector::length;

use super::facts::Facts;
use crate::latent_files::in_words;

pub(super) fn describe(path: &Path) -> Result<Facts> {
    let latent = Latent::load(path)?;
    let mut facts = Facts::new("latent");
    let n = latent.vectors.len();
    facts.add("vectors", format!("{n} (D = {})", latent.dimension()), n);
    let lengths: Vec<f32> = latent.vectors.iter().map(|v| length(*v)).collect();
    let shown: Vec<_> = lengths.iter().take(12).map(|l| format!("{l:.2}")).collect();
    let more = if n > 12 { format!(" … ({} more)", n - 12) } else { String::new() };
    facts.add("lengths", shown.join(" ") + &more, json!(lengths));
    let (sun, s) = (latent.lights.sun(), latent.log_exposure);
    if let Some(sun) = sun {
        facts.add("sun", text(sun, s), described(sun, s));
    }
    let others = latent.lights.others();
    if !others.is_empty() {
        let texts: Vec<_> = others.iter().map(|light| text(light, s)).collect();
        let all: Vec<_> = others.iter().map(|light| described(light, s)).collect();
        facts.add("lights", texts.join("; "), all);
    }
    if !latent.lobes.is_empty() {
        facts.add("lobes", latent.lobes.len().to_string(), latent.lobes.len());
    }
    let stops = latent.log_exposure / std::f32::consts::LN_2;
    facts.add(
        "exposure",
        format!("x {:.4} ({stops:+.2} stops)", latent.log_exposure.exp()),
        json!({ "log": latent.log_exposure, "stops": stops }),
    );
    facts.add("model", latent.model.clone().unwrap_or_else(|| "unknown".into()), json!(latent.model));
    facts.add("source", latent.source.clone().unwrap_or_else(|| "unknown".into()), json!(latent.source));
    Ok(facts)
}

/// A light in units of radiance: exposure included.
fn text(light: &CompactLight, log_exposure: f32) -> String {
    let [r, g, b] = light.irradiance.map(|e| e * log_exposure.exp());
    format!(
        "elevation {:.2}°, azimuth {:.2}°, radius {:.2}° ({}), E⊥ {r:.4} {g:.4} {b:.4}{}",
        light.elevation().to_degrees(),
        light.azimuth().to_degrees(),
        light.radius.to_degrees(),
        light.radius_source,
        if light.clipped { " or more" } else { "" }
    )
}

fn described(light: &CompactLight, log_exposure: f32) -> Value {
    json!({
        "direction": light.direction,
        "azimuth": light.azimuth().to_degrees(),
        "elevation": light.elevation().to_degrees(),
        "irradiance": light.irradiance.map(|e| e * log_exposure.exp()),
        "radius": light.radius.to_degrees(),
        "radius_source": light.radius_source.to_string(),
        "clipped": light.clipped,
    })
}

/// One line for a latent that is part of something else.
pub(super) fn summary(latent: &Latent) -> String {
    let of = latent.model.as_ref().map(|m| format!(" of model {m}")).unwrap_or_default();
    let from = latent.source.as_ref().map(|s| format!(", from {s}")).unwrap_or_default();
    format!("{}{of}{from}", in_words(latent))
}
