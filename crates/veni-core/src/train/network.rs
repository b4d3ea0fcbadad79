//! What a run trains: one of the two systems, and the batches that it takes.

use burn::module::Module;
use burn::tensor::{Device, Gradients, Tensor};

use crate::train::batch::{Batch, Batches};
use crate::train::config::{DecoderBackend, TrainConfig};
use crate::train::loss::{Loss, LossTerms};
use crate::train::native;
use crate::train::rays::{RayBatch, RayBatches};
use crate::train::step::{batch_loss, tensor};
use crate::vae::{Decoder, Reni, Veni};
use crate::{Error, Result};
use veni_data::Dataset;
use veni_light::model::ModelKind;
use veni_light::random::{Purpose, stream};

/// The network. Parameter paths are those of the system: `decoder.*` and `encoder.*`, or `decoder.*` and `latents.*`.
#[derive(Module, Debug)]
#[allow(clippy::large_enum_variant, reason = "there is one of them")]
pub enum Network {
    /// The auto-encoder.
    Veni(Veni),
    /// The auto-decoder.
    Reni(Reni),
}

/// Prepares a run's batches.
#[derive(Debug)]
pub enum Source<'a> {
    /// Of whole panoramas.
    Panoramas(Batches<'a>),
    /// Of rays.
    Rays(RayBatches<'a>),
}

/// A batch of either kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Prepared {
    /// Whole panoramas.
    Panoramas(Batch),
    /// Rays of some panoramas.
    Rays(RayBatch),
}

impl Network {
    /// The system that `config` names with weights from its seed; the table of an auto-decoder is for as many
    /// `panoramas`.
    ///
    /// # Errors
    /// As [`TrainConfig::check`].
    pub fn new(config: &TrainConfig, panoramas: usize, device: &Device) -> Result<Self> {
        let rng = &mut stream(config.seed, Purpose::Weights, 0, 0);
        match config.model.kind {
            ModelKind::Veni => Veni::new(&config.model, rng, device).map(Self::Veni),
            ModelKind::Reni => {
                let free = config.latents.as_ref().is_some_and(|latents| latents.free_exposure);
                Reni::new(&config.model, panoramas, free, rng, device).map(Self::Reni)
            }
        }
    }

    /// Its decoder.
    pub fn decoder(&self) -> &Decoder {
        match self {
            Self::Veni(veni) => &veni.decoder,
            Self::Reni(reni) => &reni.decoder,
        }
    }

    /// The batches of its training.
    ///
    /// # Errors
    /// [`Error::Invalid`] if an encoder's stripes cannot be laid out.
    pub fn source<'a>(&self, config: &TrainConfig, train: &'a Dataset) -> Result<Source<'a>> {
        Ok(match self {
            Self::Veni(veni) => Source::Panoramas(Batches::new(config, veni.stripes()?, train)),
            Self::Reni(_) => {
                let latents = config.latents.as_ref();
                let latents = latents.ok_or_else(|| Error::invalid("latents is missing"))?;
                Source::Rays(RayBatches::new(config, latents.rays, train))
            }
        })
    }

    /// The loss for batches of `config`.
    pub fn loss(config: &TrainConfig, device: &Device) -> Loss {
        match &config.latents {
            Some(latents) => Loss::rays(&config.loss, latents.rays / config.batch, device),
            None => {
                let [height, width] =
                    [config.data.height, config.data.width].map(|n| n / config.loss_grid.factor());
                Loss::new(&config.loss, height, width, device)
            }
        }
    }

    /// The weighted losses of a batch and the gradients of their sum.
    ///
    /// # Panics
    /// As [`Network::terms`], and where [`DecoderBackend::check`] refuses `by`.
    pub fn gradients(
        &self,
        batch: &Prepared,
        loss: &Loss,
        by: DecoderBackend,
        device: &Device,
    ) -> (LossTerms, Gradients) {
        if by.is_kernels() && self.decoder().config().check_folds().is_ok() {
            return native::gradients(self, batch, loss, by, device);
        }
        let terms = self.terms(batch, loss, device);
        let gradients = terms.total().backward();
        (terms, gradients)
    }

    /// The weighted losses of a batch, on the graph.
    ///
    /// # Panics
    /// If the batch or `loss` was made for another configuration, or for the other system.
    pub fn terms(&self, batch: &Prepared, loss: &Loss, device: &Device) -> LossTerms {
        match (self, batch) {
            (Self::Veni(veni), Prepared::Panoramas(batch)) => batch_loss(veni, batch, loss, device).terms,
            (Self::Reni(reni), Prepared::Rays(batch)) => ray_loss(reni, batch, loss, device),
            _ => panic!("a batch of the other system"),
        }
    }
}

impl Source<'_> {
    /// The batch of update `step` (from 1).
    pub fn prepare(&self, step: u64) -> Prepared {
        match self {
            Self::Panoramas(batches) => Prepared::Panoramas(batches.prepare(step)),
            Self::Rays(batches) => Prepared::Rays(batches.prepare(step)),
        }
    }
}

impl Prepared {
    /// Number of the update, from 1.
    pub fn step(&self) -> u64 {
        match self {
            Self::Panoramas(batch) => batch.step,
            Self::Rays(batch) => batch.step,
        }
    }

    /// The same in `parts` batches, whose sizes differ by one at most.
    ///
    /// # Panics
    /// If there are fewer panoramas than parts, or the batch is of rays, whose losses belong together.
    pub fn split(&self, parts: usize) -> Vec<Self> {
        match self {
            Self::Panoramas(batch) => batch.split(parts).into_iter().map(Self::Panoramas).collect(),
            Self::Rays(_) => panic!("the losses of a batch of rays belong together"),
        }
    }

    /// Panoramas in it.
    pub fn images(&self) -> usize {
        match self {
            Self::Panoramas(batch) => batch.images,
            Self::Rays(batch) => batch.panoramas.len(),
        }
    }
}

/// Samples the latents of a batch, decodes them on its rays and computes the losses.
fn ray_loss(reni: &Reni, batch: &RayBatch, loss: &Loss, device: &Device) -> LossTerms {
    let (images, rays, n) = (batch.panoramas.len(), batch.rays, reni.decoder.latent_vectors());
    let rows = reni.latents.rows(&batch.panoramas);
    let latent = rows.sample(tensor(&batch.noise, [images, n, 3], device));
    let directions: Tensor<3> = tensor(&batch.directions, [images, rays, 3], device);
    let decoded = reni.decoder.forward_per_image(latent, directions);
    let decoded = match rows.scale {
        Some(scale) => decoded + scale,
        None => decoded,
    };
    let shape = [images, rays, 1, 3];
    let gaussian = Some((rows.mean, rows.log_variance));
    // schedules count from 0
    loss.terms(batch.step - 1, decoded.reshape(shape), tensor(&batch.target, shape, device), gaussian)
}
