//! A PNG, JPEG, WebP or AVIF picture.

use std::path::Path;

use anyhow::Result;
use serde_json::json;
use veni_image::{Content, LdrPanorama, ReadOptions, TransferFunction, luminance};

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
    // what is unknown is neither clipped nor dark
    let known = |at: usize| image.known().map_or(1.0, |known| f64::from(known[at]));
    let count: f64 = (0..grid.len()).map(known).sum::<f64>().max(f64::MIN_POSITIVE);
    let over =
        |value: &dyn Fn(usize) -> f64| (0..grid.len()).map(|at| known(at) * value(at)).sum::<f64>() / count;
    let is_clipped = |at: usize| image.values()[at].iter().any(|v| *v >= CLIPPED);
    let clipped = over(&|at| f64::from(u8::from(is_clipped(at))));
    facts.add("clipped", format!("{:.1} % of the pixels", 100.0 * clipped), clipped);
    let linear = image.linear(TransferFunction::Srgb);
    let mean = over(&|at| f64::from(luminance(linear.pixels()[at])));
    facts.add("mean luminance", format!("{mean:.4} of white"), mean);
    facts
}
