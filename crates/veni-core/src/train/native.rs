//! The gradients of a batch with the decoder by [`Native`](crate::vae::Native) kernels: encoder and losses on the graph,
//! what runs for every direction beside it.
//!
//! Three passes in place of one: the image losses back to log radiance; from there through the decoder by kernels; and
//! what those give, with the divergence of the posterior, back through conditioning and encoder.

use burn::tensor::{Device, Gradients, Tensor};

use crate::train::batch::Batch;
use crate::train::config::DecoderBackend;
use crate::train::loss::{Loss, LossTerms, Term};
use crate::train::network::{Network, Prepared};
use crate::train::rays::RayBatch;
use crate::train::step::{encode, tensor};
use crate::vae::{Decoder, Native, Reni, Veni};

/// The weighted losses and the gradients of their sum.
///
/// # Panics
/// If the batch or `loss` was made for another configuration, or for the other system, or the decoder does not fold, or
/// this machine does not compute as `by` says.
pub(super) fn gradients(
    network: &Network,
    batch: &Prepared,
    loss: &Loss,
    by: DecoderBackend,
    device: &Device,
) -> (LossTerms, Gradients) {
    let prepare = |decoder: &Decoder, latent| {
        let native = decoder.native(latent).expect("a network that folds");
        if by == DecoderBackend::KernelsBfloat16 {
            native.in_bfloat16().expect("checked by the run")
        } else {
            native
        }
    };
    match (network, batch) {
        (Network::Veni(veni), Prepared::Panoramas(batch)) => of_panoramas(veni, batch, loss, prepare, device),
        (Network::Reni(reni), Prepared::Rays(batch)) => of_rays(reni, batch, loss, prepare, device),
        _ => panic!("a batch of the other system"),
    }
}

fn of_panoramas(
    veni: &Veni,
    batch: &Batch,
    loss: &Loss,
    prepare: impl Fn(&Decoder, Tensor<3>) -> Native,
    device: &Device,
) -> (LossTerms, Gradients) {
    let step = batch.step - 1;
    let posterior = encode(veni, batch, device);
    let latent = posterior.sample(tensor(&batch.noise, [batch.images, veni.latent_vectors(), 3], device));
    let kld = posterior.log_variance.and_then(|l| loss.kld(step, posterior.mean, l));
    let decoder = prepare(&veni.decoder, latent);
    let directions = batch.loss_directions.as_chunks().0;
    let decoded = decoder.forward(directions, directions.len());
    let [rows, columns] = batch.loss_size;
    let image = Image { shape: [batch.images, rows, columns, 3], target: &batch.target, step };
    let (terms, by_output) = image.terms(loss, &decoded, device);
    let back = decoder.backward(directions, directions.len(), &by_output);
    finish(terms, kld, back)
}

fn of_rays(
    reni: &Reni,
    batch: &RayBatch,
    loss: &Loss,
    prepare: impl Fn(&Decoder, Tensor<3>) -> Native,
    device: &Device,
) -> (LossTerms, Gradients) {
    let (images, rays, n) = (batch.panoramas.len(), batch.rays, reni.decoder.latent_vectors());
    let step = batch.step - 1;
    let rows = reni.latents.rows(&batch.panoramas);
    let latent = rows.sample(tensor(&batch.noise, [images, n, 3], device));
    let decoder = prepare(&reni.decoder, latent);
    let directions = batch.directions.as_chunks().0;
    let mut decoded = decoder.forward(directions, rays);
    if let Some(scale) = &rows.scale {
        let scale: Vec<f32> = scale.to_data().try_into_vec().expect("f32");
        for (image, scale) in decoded.chunks_exact_mut(3 * rays).zip(scale) {
            image.iter_mut().for_each(|value| *value += scale);
        }
    }
    let image = Image { shape: [images, rays, 1, 3], target: &batch.target, step };
    let (terms, by_output) = image.terms(loss, &decoded, device);
    let mut back = decoder.backward(directions, rays, &by_output);
    if let Some(scale) = rows.scale {
        let sums: Vec<f32> = by_output.chunks_exact(3 * rays).map(|image| image.iter().sum()).collect();
        back = back + (scale * tensor(&sums, [images, 1, 1], device)).sum();
    }
    let kld = loss.kld(step, rows.mean, rows.log_variance);
    finish(terms, kld, back)
}

/// What decoded log radiance is compared with.
struct Image<'a> {
    shape: [usize; 4],
    target: &'a [f32],
    /// From 0, as schedules count.
    step: u64,
}

impl Image<'_> {
    /// The image losses of log radiance, and their sum's derivatives with respect to it.
    fn terms(&self, loss: &Loss, decoded: &[f32], device: &Device) -> (LossTerms, Vec<f32>) {
        let prediction: Tensor<4> = tensor(decoded, self.shape, device).require_grad();
        let terms = loss.image_terms(self.step, prediction.clone(), tensor(self.target, self.shape, device));
        if terms.terms.is_empty() {
            return (terms, vec![0.0; decoded.len()]);
        }
        let by_output = prediction.grad(&terms.total().backward()).expect("a loss of the prediction");
        (terms, by_output.into_data().convert::<f32>().try_into_vec().expect("just converted to f32"))
    }
}

fn finish(mut terms: LossTerms, kld: Option<Term>, back: Tensor<1>) -> (LossTerms, Gradients) {
    let total = match &kld {
        Some(kld) => back + kld.value.clone(),
        None => back,
    };
    terms.terms.extend(kld);
    (terms, total.backward())
}
