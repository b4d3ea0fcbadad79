//! A latent, in a file of its own or inside a baked image.

use std::path::Path;

use anyhow::Result;
use serde_json::json;
use veni_light::latent::Latent;

use super::facts::Facts;

pub(super) fn describe(path: &Path) -> Result<Facts> {
    let latent = Latent::load(path)?;
    let mut facts = Facts::new("latent");
    let n = latent.vectors.len();
    facts.add("vectors", format!("{n} (D = {})", 3 * n), n);
    let lengths: Vec<f32> =
        latent.vectors.iter().map(|v| v.iter().map(|c| c * c).sum::<f32>().sqrt()).collect();
    let shown: Vec<_> = lengths.iter().take(12).map(|l| format!("{l:.2}")).collect();
    let more = if n > 12 { format!(" … ({} more)", n - 12) } else { String::new() };
    facts.add("lengths", shown.join(" ") + &more, json!(lengths));
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

/// One line for a latent that is part of something else.
pub(super) fn summary(latent: &Latent) -> String {
    let of = latent.model.as_ref().map(|m| format!(" of model {m}")).unwrap_or_default();
    let from = latent.source.as_ref().map(|s| format!(", from {s}")).unwrap_or_default();
    format!("{} vectors{of}{from}", latent.vectors.len())
}
