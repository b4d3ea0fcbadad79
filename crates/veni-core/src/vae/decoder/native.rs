//! The decoder by the vectorised kernels of [`field`](veni_light::field) in training, values and gradients, in place of
//! tensor operations.
//!
//! Conditioning stays on the graph: the latent's products, one vector per layer and image. What runs for every
//! direction does not. Its gradients with respect to everything it was given come back as constants G, and ⟨T, G⟩
//! summed over all of these tensors T is a scalar on the graph with the gradient of the loss: its backward pass goes on
//! to the latent, to the encoder and to the parameters.

use std::collections::BTreeMap;

use burn::tensor::{Device, Tensor, TensorData};

use super::{Decoder, Layers, invariants};
use crate::{Error, Result};
use veni_light::field::training::{Bfloat16, Conditioned, Perceptron};

/// A decoder with the latents of a batch, on the processor.
#[derive(Debug)]
pub struct Native {
    perceptron: Perceptron,
    images: Vec<Conditioned>,
    latent: Tensor<3>,
    /// What is added before the first layer and after each, `[B, h]` each.
    added: Vec<Tensor<2>>,
    matrices: BTreeMap<String, Tensor<2>>,
    vectors: BTreeMap<String, Tensor<1>>,
}

impl Decoder {
    /// Prepares the kernels for latents `[B, N, 3]`. They compute in f32, on the processor, whatever the device.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if the network does not fold per latent
    /// ([`check_folds`](veni_light::model::DecoderConfig::check_folds)).
    ///
    /// # Panics
    /// If the latents are of another shape.
    pub fn native(&self, latent: Tensor<3>) -> Result<Native> {
        self.config.check_folds()?;
        let Layers::Attention(layers) = &self.layers else {
            unreachable!("a network that folds has attention layers")
        };
        let [batch, n, three] = latent.dims();
        assert!(
            n == self.latent_vectors && three == 3,
            "the decoder takes latents [B, {}, 3], got {:?}",
            self.latent_vectors,
            latent.dims()
        );
        let features = invariants::vector(&self.config, self.condition.as_ref(), latent.clone());
        let attention = layers.iter().map(|layer| layer.attention(features.clone()));
        let offsets = [self.input.bias.val()].into_iter().chain(layers.iter().map(|l| l.norm2.beta.val()));
        let offsets = offsets.map(|offset| offset.unsqueeze::<2>());
        let last = layers.last().expect("a decoder has at least one layer").norm2.beta.val();
        let last = last.unsqueeze::<2>().expand([batch, self.config.hidden]);
        let added: Vec<_> = attention.zip(offsets).map(|(a, b)| a + b).chain([last]).collect();

        let mut matrices = BTreeMap::from([
            ("input.weight".to_owned(), self.input.weight.val()),
            ("output.weight".to_owned(), self.output.weight.val()),
        ]);
        let mut vectors = BTreeMap::from([("output.bias".to_owned(), self.output.bias.val())]);
        for (l, layer) in layers.iter().enumerate() {
            let name = |part: &str| format!("layers.{l}.{part}");
            matrices.extend([
                (name("ff1.weight"), layer.ff1.weight.val()),
                (name("ff2.weight"), layer.ff2.weight.val()),
            ]);
            vectors.extend([
                (name("norm1.gamma"), layer.norm1.gamma.val()),
                (name("norm1.beta"), layer.norm1.beta.val()),
                (name("ff1.bias"), layer.ff1.bias.val()),
                (name("ff2.bias"), layer.ff2.bias.val()),
                (name("norm2.gamma"), layer.norm2.gamma.val()),
            ]);
        }
        let plain: BTreeMap<&str, Vec<f32>> = (matrices.iter().map(|(name, t)| (name.as_str(), values(t))))
            .chain(vectors.iter().map(|(name, t)| (name.as_str(), values(t))))
            .collect();
        let perceptron = Perceptron::new(self.config.hidden, self.config.layers, |name| &plain[name]);
        let (latents, numbers) = (values(&latent), added.iter().map(values).collect::<Vec<_>>());
        let images = (latents.as_chunks::<3>().0.chunks_exact(n).enumerate()).map(|(b, vectors)| {
            let row = |all: &'_ Vec<f32>| all[b * self.config.hidden..][..self.config.hidden].to_vec();
            let rows: Vec<Vec<f32>> = numbers.iter().map(row).collect();
            perceptron.conditioned(vectors, &rows.iter().map(Vec::as_slice).collect::<Vec<_>>())
        });
        let images = images.collect();
        Ok(Native { perceptron, images, latent, added, matrices, vectors })
    }
}

impl Native {
    /// The same in mixed precision: factors of the matrix products but for the output's are rounded to bfloat16, sums and
    /// all else stay in f32.
    ///
    /// # Errors
    /// As [`Native::check_bfloat16`].
    pub fn in_bfloat16(self) -> Result<Self> {
        let token = Bfloat16::detect().ok_or_else(no_bfloat16)?;
        Ok(Self { perceptron: self.perceptron.in_bfloat16(token), ..self })
    }

    /// Whether this processor multiplies in bfloat16.
    ///
    /// # Errors
    /// [`Error::Unsupported`] where it does not.
    pub fn check_bfloat16() -> Result<()> {
        Bfloat16::detect().map(|_| ()).ok_or_else(no_bfloat16)
    }

    /// Log radiance `[B, R, 3]`, flat, in the same R directions for every image or in each image's own.
    ///
    /// # Panics
    /// If there are neither R nor B · R directions.
    pub fn forward(&self, directions: &[[f32; 3]], rays: usize) -> Vec<f32> {
        self.perceptron.forward(&self.images, &self.split(directions, rays)).into_flattened()
    }

    /// A scalar on the graph with the gradient of Σ gradient · log radiance; its value means nothing. Directions as in
    /// [`Native::forward`], gradients `[B, R, 3]`.
    ///
    /// # Panics
    /// If shapes disagree.
    pub fn backward(self, directions: &[[f32; 3]], rays: usize, gradients: &[f32]) -> Tensor<1> {
        let (count, images) = (gradients.len(), self.images.len());
        assert!(count == 3 * images * rays, "{count} gradients for {images} images of {rays} directions");
        let directions = self.split(directions, rays);
        let found = self.perceptron.backward(&self.images, &directions, gradients.as_chunks().0);
        let vectors = found.images.iter().flat_map(|i| &i.vectors).flat_map(|[x, y]| [*x, *y, 0.0]);
        let mut total = pair(self.latent, vectors.collect());
        let hidden = self.added[0].dims()[1];
        for (l, added) in self.added.into_iter().enumerate() {
            let rows = found.images.iter().flat_map(|i| &i.added[l * hidden..][..hidden]);
            total = total + pair(added, rows.copied().collect());
        }
        let (mut matrices, mut vectors) = (self.matrices, self.vectors);
        for (name, gradient) in found.weights {
            total = total
                + match (matrices.remove(&name), vectors.remove(&name)) {
                    (Some(matrix), _) => pair(matrix, gradient),
                    (_, Some(vector)) => pair(vector, gradient),
                    _ => unreachable!("{name} is not a tensor of a decoder"),
                };
        }
        total
    }

    fn split<'a>(&self, directions: &'a [[f32; 3]], rays: usize) -> Vec<&'a [[f32; 3]]> {
        let (images, count) = (self.images.len(), directions.len());
        match count {
            _ if count == rays => vec![directions; images],
            _ if count == images * rays => directions.chunks_exact(rays).collect(),
            _ => panic!("{count} directions are neither {rays} nor {rays} for each of {images} images"),
        }
    }
}

fn no_bfloat16() -> Error {
    Error::unsupported(
        "decoder_backend = kernels-bfloat16: this processor multiplies no bfloat16 (it lacks AVX512-BF16); take \
         decoder_backend = kernels",
    )
}

fn values<const D: usize>(tensor: &Tensor<D>) -> Vec<f32> {
    tensor.to_data().convert::<f32>().try_into_vec().expect("just converted to f32")
}

/// ⟨tensor, gradient⟩.
fn pair<const D: usize>(tensor: Tensor<D>, gradient: Vec<f32>) -> Tensor<1> {
    let device: Device = tensor.device();
    let gradient = Tensor::from_data(TensorData::new(gradient, tensor.dims()), &device);
    (tensor * gradient).sum()
}
