//! The latent table of an auto-decoder: how it is trained, and its file. MODEL (25).

use std::io::Write;
use std::path::Path;

use safetensors::tensor::{Dtype, TensorView};
use serde::{Deserialize, Serialize};

use crate::fit::FitConfig;
use crate::train::config::GroupConfig;
use crate::vae::LatentTable;
use crate::{Error, Result};
use veni_data::Dataset;
use veni_light::output::{Overwrite, write_atomic};

/// An auto-decoder's latents: their optimiser, the rays of a step, and how a panorama without a latent gets one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LatentsConfig {
    /// Optimiser of the table.
    pub optimiser: GroupConfig,
    /// Rays of a step, shared out evenly among its panoramas.
    pub rays: usize,
    /// Whether every panorama has a log scale of its own, added to what is decoded (RENI++'s `train_scale`). It starts
    /// at 0, for panoramas come with exposure 0.
    pub free_exposure: bool,
    /// How validation panoramas, which have no row in the table, get their latents: from zero.
    pub validation: FitConfig,
    /// At most N of them are fitted, the first N.
    pub validation_panoramas: usize,
    /// The fit sees panoramas averaged over this many pixels along each side.
    pub validation_factor: usize,
}

impl LatentsConfig {
    /// Checks what types cannot, for `batch` panoramas per step.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key, its value and what is allowed.
    pub fn check(&self, batch: usize) -> Result<()> {
        if self.rays == 0 || !self.rays.is_multiple_of(batch.max(1)) {
            return Err(Error::invalid(format!(
                "latents.rays = {}: must be a multiple of batch = {batch}, and positive",
                self.rays
            )));
        }
        if self.validation_factor == 0 {
            return Err(Error::invalid("latents.validation_factor = 0: must be positive"));
        }
        Ok(())
    }
}

/// Writes `latents.safetensors`: `mean` and `log_variance` [n, N, 3] (per coordinate) and, where exposures are free,
/// `scale` `[n]`, all f32, one row per training panorama. The header entry `veni-latents` is JSON: `panoramas`, their names
/// in that order, and `model`, the hash of the model whose latents they are.
///
/// # Errors
/// [`Error::Io`] if it cannot be written.
pub fn save(path: &Path, table: &LatentTable, train: &Dataset, model: &str) -> Result<()> {
    let tensors = crate::vae::weights::read(table, "");
    let bytes: Vec<Vec<u8>> =
        tensors.values().map(|t| t.data.iter().flat_map(|v| v.to_le_bytes()).collect()).collect();
    let broken = |e: &dyn std::fmt::Display| Error::invalid(e.to_string()).in_file(path);
    let mut views = Vec::with_capacity(bytes.len());
    for ((name, tensor), bytes) in tensors.iter().zip(&bytes) {
        let view = TensorView::new(Dtype::F32, tensor.shape.clone(), bytes).map_err(|e| broken(&e))?;
        views.push((name.as_str(), view));
    }
    let names: Vec<_> = train.items().iter().map(veni_data::Item::name).collect();
    // one entry: the order of several is left to chance, and runs are compared to the bit
    let about = serde_json::json!({ "panoramas": names, "model": model }).to_string();
    let header = [("veni-latents".to_owned(), about)].into_iter().collect();
    let file = safetensors::serialize(views, Some(header)).map_err(|e| broken(&e))?;
    write_atomic(path, Overwrite::Replace, |out| {
        out.write_all(&file).map_err(|e| Error::io(path, "write", e))
    })
}
