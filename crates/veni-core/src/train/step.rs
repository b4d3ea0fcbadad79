//! One update: forward, losses, backward, clip, Adam.

use burn::tensor::{Device, Tensor, TensorData};

use crate::train::batch::Batch;
use crate::train::standin::{LossConfig, losses};
use crate::vae::{Posterior, Veni};

/// The losses of one batch, on the graph.
#[derive(Debug)]
pub struct BatchLoss {
    /// Weighted sum, [1].
    pub total: Tensor<1>,
    /// Each part, unweighted, by name.
    pub parts: Vec<(&'static str, Tensor<1>)>,
    /// What the encoder said.
    pub posterior: Posterior,
    /// Decoded log radiance [B, rows, columns, 3].
    pub prediction: Tensor<4>,
}

/// Encodes, samples and decodes a batch and computes its losses.
///
/// # Panics
/// If the batch was made for another configuration.
pub fn batch_loss(veni: &Veni, batch: &Batch, config: &LossConfig, device: &Device) -> BatchLoss {
    let posterior = encode(veni, batch, device);
    let n = veni.latent_vectors();
    let noise = tensor(&batch.noise, [batch.images, n, 3], device);
    let latent = posterior.sample(noise);
    let [rows, columns] = batch.loss_size;
    let directions = tensor(&batch.loss_directions, [rows * columns, 3], device);
    let shape = [batch.images, rows, columns, 3];
    let prediction = veni.decoder.forward(latent, directions).reshape(shape);
    let target = tensor(&batch.target, shape, device);
    let (total, parts) = losses(config, prediction.clone(), target, &posterior, device);
    BatchLoss { total, parts, posterior, prediction }
}

fn encode(veni: &Veni, batch: &Batch, device: &Device) -> Posterior {
    let config = &veni.encoder.config;
    let samples = config.samples.unwrap_or(1);
    let stripes = batch.stripe_samples.len() / (3 * samples * batch.images);
    let shape = [batch.images, stripes, samples, 3];
    let directions = tensor(&batch.stripe_directions, shape, device);
    let radiance = tensor(&batch.stripe_samples, shape, device);
    veni.encoder.forward_per_image(directions, radiance)
}

/// A constant on the device.
///
/// # Panics
/// If `values` does not fill `shape`.
pub fn tensor<const D: usize>(values: &[f32], shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values.to_vec(), shape), device)
}
