//! What a fit asks of a decoder, and of a loss over whole images.

use std::fmt::Debug;

use veni_light::field;
use veni_light::latent::Latent;

use crate::Result;

/// A decoder under which latents are optimised; its weights are constants.
///
/// The folded decoder of veni-light is one, with its gradient in closed form. Any other that goes forward and backward can be
/// one too; a network of tensors, for instance.
pub trait LatentDecoder: Debug {
    /// N, the number of latent vectors.
    fn latent_vectors(&self) -> usize;

    /// The decoder folded per latent, where it folds: losses of pixels are then fused with its passes.
    fn folded(&self) -> Option<&field::Decoder> {
        None
    }

    /// Itself in these unit directions.
    fn in_directions(&self, directions: Vec<[f32; 3]>) -> Box<dyn DecoderPasses + '_>;
}

/// The passes of a decoder in fixed directions.
pub trait DecoderPasses: Debug {
    /// Log radiance `[B, R, 3]` of B latents in R directions, at the latents' exposures.
    ///
    /// # Errors
    /// [`Error::Invalid`](crate::Error::Invalid) if a latent does not belong to the decoder.
    fn forward(&self, latents: &[Latent]) -> Result<Vec<f64>>;

    /// The gradient of a loss with respect to the latents: `gradient` is given what [`forward`](Self::forward) gives, and
    /// gives the gradient of the loss with respect to it.
    ///
    /// # Errors
    /// As [`forward`](Self::forward), and those of `gradient`.
    fn backward(
        &self,
        latents: &[Latent],
        gradient: &mut dyn FnMut(&[f64]) -> Result<Vec<f64>>,
    ) -> Result<LatentGradient>;
}

/// A gradient with respect to B latents.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LatentGradient {
    /// With respect to their vectors, `[B, N, 3]`.
    pub vectors: Vec<f64>,
    /// With respect to their log exposures, `[B]`.
    pub exposures: Vec<f64>,
}

/// A loss that looks at whole images: no pixel's gradient is known before all are.
pub trait PanoramaLoss: Debug {
    /// The loss of all images together, and its gradient with respect to their log radiance `[B, H, W, 3]`.
    ///
    /// # Errors
    /// Those of whatever computes it.
    fn with_gradient(&self, log_radiance: &[f64]) -> Result<(f64, Vec<f64>)>;

    /// The loss of each image alone.
    ///
    /// # Errors
    /// Those of whatever computes it.
    fn each(&self, log_radiance: &[f64]) -> Result<Vec<f64>>;
}

impl LatentDecoder for field::Decoder {
    fn latent_vectors(&self) -> usize {
        Self::latent_vectors(self)
    }

    fn folded(&self) -> Option<&field::Decoder> {
        Some(self)
    }

    fn in_directions(&self, directions: Vec<[f32; 3]>) -> Box<dyn DecoderPasses + '_> {
        Box::new(FoldedPasses { decoder: self, directions })
    }
}

/// The folded decoder in fixed directions.
#[derive(Debug)]
pub(crate) struct FoldedPasses<'a> {
    pub(crate) decoder: &'a field::Decoder,
    pub(crate) directions: Vec<[f32; 3]>,
}

impl FoldedPasses<'_> {
    pub(crate) fn fields(&self, latents: &[Latent]) -> Result<Vec<field::Field>> {
        latents.iter().map(|z| self.decoder.condition(z)).collect()
    }

    fn decoded(&self, fields: &[field::Field]) -> Vec<f64> {
        let mut all = vec![[0.0; 3]; fields.len() * self.directions.len()];
        for (field, out) in fields.iter().zip(all.chunks_exact_mut(self.directions.len())) {
            field.log_radiance_batch(&self.directions, out);
        }
        all.as_flattened().iter().map(|v| f64::from(*v)).collect()
    }
}

impl DecoderPasses for FoldedPasses<'_> {
    fn forward(&self, latents: &[Latent]) -> Result<Vec<f64>> {
        Ok(self.decoded(&self.fields(latents)?))
    }

    fn backward(
        &self,
        latents: &[Latent],
        gradient: &mut dyn FnMut(&[f64]) -> Result<Vec<f64>>,
    ) -> Result<LatentGradient> {
        let fields = self.fields(latents)?;
        let by_radiance = gradient(&self.decoded(&fields))?;
        let mut out = LatentGradient::default();
        for (field, by) in
            fields.iter().zip(by_radiance.as_chunks::<3>().0.chunks_exact(self.directions.len()))
        {
            out.push(field.gradient(&self.directions, |i, _| (0.0, by[i].map(|v| v as f32))));
        }
        Ok(out)
    }
}

impl LatentGradient {
    /// Appends the gradient with respect to one more latent.
    pub(crate) fn push(&mut self, gradient: field::Gradient) {
        self.vectors.extend(gradient.vectors.as_flattened().iter().map(|v| f64::from(*v)));
        self.exposures.push(f64::from(gradient.log_exposure));
    }
}
