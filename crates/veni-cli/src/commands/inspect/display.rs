//! A PNG, JPEG, WebP or AVIF picture.

use std::path::Path;

use anyhow::Result;
use serde_json::json;
use veni_image::{Content, LdrPanorama, ReadOptions, Transfer, luminance};

use super::facts::Facts;
use super::image::{radiance, reservations};
use crate::output::with_remedy;

/// Display values from here on are taken for clipped.
const CLIPPED: f32 = 254.0 / 255.0;

pub(super) fn describe(path: &Path) -> Result<Facts> {
    let options = ReadOptions { any_aspect: true, ..ReadOptions::default() };
    match Content::read(path, &options).map_err(with_remedy)? {
        Content::Display(image) => Ok(display(&image)),
        Content::Radiance(panorama) => {
            let mut facts = Facts::new("picture of high dynamic range");
            radiance(panorama, path, &mut facts)?;
            Ok(facts)
        }
    }
}

fn display(image: &LdrPanorama) -> Facts {
    let mut facts = Facts::new("picture of a display's range");
    let grid = image.grid();
    facts.add("size", format!("{} x {}", grid.width, grid.height), json!([grid.width, grid.height]));
    let coding = image.coding();
    facts.add("values", coding.as_str(), coding.as_str());
    reservations(image.notes(), image.unknown(), &mut facts);
    let count = grid.len() as f64;
    let clipped = image.values().iter().filter(|p| p.iter().any(|v| *v >= CLIPPED)).count() as f64 / count;
    facts.add("clipped", format!("{:.1} % of the pixels", 100.0 * clipped), clipped);
    let mean =
        image.linear(Transfer::Srgb).pixels().iter().map(|p| f64::from(luminance(*p))).sum::<f64>() / count;
    facts.add("mean luminance", format!("{mean:.4} of white"), mean);
    facts
}
