//! A decoder as a graph of tensors, as a fit takes it.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use veni_fit::{DecoderPasses, LatentDecoder, LatentGradient};
use veni_light::latent::Latent;

use crate::vae::Decoder;
use crate::{Error, Result};

/// The decoder's device, recording gradients.
pub(super) fn autodiff_device(decoder: &Decoder) -> Device {
    decoder.output.bias.val().device().without_autodiff().autodiff()
}

impl LatentDecoder for Decoder {
    fn latent_vectors(&self) -> usize {
        Self::latent_vectors(self)
    }

    fn in_directions(&self, directions: Vec<[f32; 3]>) -> Box<dyn DecoderPasses + '_> {
        let device = autodiff_device(self);
        let shape = [directions.len(), 3];
        let directions = TensorData::new(directions.into_flattened(), shape);
        Box::new(Graph {
            // constants on the graph's device: no gradient is spent on weights
            decoder: self.clone().fork(&device).freeze(),
            directions: Tensor::from_data(directions, &device),
            device,
        })
    }
}

#[derive(Debug)]
struct Graph {
    decoder: Decoder,
    directions: Tensor<2>,
    device: Device,
}

impl Graph {
    fn decode(&self, vectors: Tensor<3>, exposures: Tensor<3>) -> Tensor<3> {
        self.decoder.forward(vectors, self.directions.clone()) + exposures
    }
}

impl DecoderPasses for Graph {
    fn forward(&self, latents: &[Latent]) -> Result<Vec<f64>> {
        Ok(numbers(self.decode(vectors(latents, &self.device), exposures(latents, &self.device))))
    }

    fn backward(
        &self,
        latents: &[Latent],
        gradient: &mut dyn FnMut(&[f64]) -> Result<Vec<f64>>,
    ) -> Result<LatentGradient> {
        let z = vectors(latents, &self.device).require_grad();
        let s = exposures(latents, &self.device).require_grad();
        let prediction = self.decode(z.clone(), s.clone());
        let by_prediction = gradient(&numbers(prediction.clone()))?;
        let by_prediction: Tensor<3> =
            Tensor::from_data(TensorData::new(by_prediction, prediction.dims()), &self.device);
        let gradients = (prediction * by_prediction).sum().backward();
        let unconnected = || Error::invalid("the loss does not depend on the latents");
        Ok(LatentGradient {
            vectors: numbers(z.grad(&gradients).ok_or_else(unconnected)?),
            exposures: numbers(s.grad(&gradients).ok_or_else(unconnected)?),
        })
    }
}

/// [B, N, 3].
fn vectors(latents: &[Latent], device: &Device) -> Tensor<3> {
    let flat: Vec<f32> = latents.iter().flat_map(|z| z.vectors.as_flattened()).copied().collect();
    let shape = [latents.len(), flat.len() / (3 * latents.len()), 3];
    Tensor::from_data(TensorData::new(flat, shape), device)
}

/// [B, 1, 1].
fn exposures(latents: &[Latent], device: &Device) -> Tensor<3> {
    let values: Vec<f32> = latents.iter().map(|z| z.log_exposure).collect();
    Tensor::from_data(TensorData::new(values, [latents.len(), 1, 1]), device)
}

fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f64> {
    tensor.into_data().convert::<f64>().try_into_vec().expect("just converted to f64")
}
