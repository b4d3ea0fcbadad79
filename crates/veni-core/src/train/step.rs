//! One update: forward, losses, backward, clip, Adam.

use burn::tensor::{Device, Tensor, TensorData};

use crate::train::batch::Batch;
use crate::train::loss::{Loss, LossTerms};
use crate::vae::{Posterior, Veni};

/// The losses of one batch, on the graph.
#[derive(Debug)]
pub struct BatchLoss {
    /// The weighted terms.
    pub terms: LossTerms,
    /// What the encoder said.
    pub posterior: Posterior,
    /// Decoded log radiance [B, rows, columns, 3].
    pub prediction: Tensor<4>,
}

/// Encodes, samples and decodes a batch and computes its losses.
///
/// # Panics
/// If the batch or `loss` was made for another configuration.
pub fn batch_loss(veni: &Veni, batch: &Batch, loss: &Loss, device: &Device) -> BatchLoss {
    let posterior = encode(veni, batch, device);
    let n = veni.latent_vectors();
    let noise = tensor(&batch.noise, [batch.images, n, 3], device);
    let latent = posterior.sample(noise);
    let [rows, columns] = batch.loss_size;
    let directions = tensor(&batch.loss_directions, [rows * columns, 3], device);
    let shape = [batch.images, rows, columns, 3];
    let prediction = veni.decoder.forward(latent, directions).reshape(shape);
    let target = tensor(&batch.target, shape, device);
    let gaussian = posterior.log_variance.clone().map(|l| (posterior.mean.clone(), l));
    // schedules count from 0
    let terms = loss.terms(batch.step - 1, prediction.clone(), target, gaussian);
    BatchLoss { terms, posterior, prediction }
}

/// The posterior of each panorama of a batch.
///
/// # Panics
/// If the batch was made for another configuration.
pub fn encode(veni: &Veni, batch: &Batch, device: &Device) -> Posterior {
    let config = &veni.encoder.config;
    let samples = batch.stripe_samples.len() / (3 * config.stripes * batch.images);
    let shape = [batch.images, config.stripes, samples, 3];
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
