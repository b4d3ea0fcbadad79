//! LPIPS with AlexNet (Zhang et al. 2018, "The unreasonable effectiveness of deep features as a perceptual metric").
//! MODEL (61).
//!
//! d(a, b) = Σ_l 1/(H_l W_l) Σ_hw Σ_c w_lc (â_lhwc − b̂_lhwc)²: â_l are the activations after the l-th rectifier, divided per
//! pixel by their length over channels; w_l are learned weights (the "heads"). Images are display values in [0, 1]; the
//! network sees ((2x − 1) − shift)/scale per channel. Lower is closer; 0 for equal images.
//!
//! No weights come with this library: a user names files that have them, see [`Lpips::load`].

#[cfg(test)]
mod tests;
mod weights;

use std::path::PathBuf;

use burn::tensor::activation::relu;
use burn::tensor::module::{conv2d, max_pool2d};
use burn::tensor::ops::{ConvOptions, MaxPoolOptions};
use burn::tensor::{Device, Tensor, TensorData};
use veni_core::train::config::DeviceKind;
use veni_light::digest::Digest;

use self::weights::{Convolution, LAYERS, LayerWeights};
use crate::{Error, Result};

/// The published normalisation, applied to values in [−1, 1].
const SHIFT: [f32; 3] = [-0.030, -0.088, -0.188];
const SCALE: [f32; 3] = [0.458, 0.448, 0.450];
/// Keeps the division by a pixel's length finite, as published.
const EPSILON: f32 = 1e-10;
/// The smallest side for which every layer has a pixel left.
pub const MIN_SIDE: usize = 31;

/// The network and its heads on a device.
#[derive(Debug)]
pub struct Lpips {
    layers: Vec<Layer>,
    device: Device,
    identity: Digest,
}

#[derive(Debug)]
struct Layer {
    shape: Convolution,
    /// [out, in, k, k]
    weight: Tensor<4>,
    /// [out]
    bias: Tensor<1>,
    /// [1, out, 1, 1]
    head: Tensor<4>,
}

impl Lpips {
    /// The weights in `files`: safetensors files or what `torch.save` writes, in either of its formats. AlexNet's features
    /// (torchvision's `features.N.weight`, or `net.sliceK.N.weight`) and the five heads (`linL.model.1.weight`) may be in
    /// one file (torchmetrics, the reference implementation's checkpoints) or in two.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Invalid`] or [`Error::Unsupported`] naming the file and the tensor that is missing,
    /// ambiguous, of another shape or not finite, or if there is no such `device`.
    pub fn load(files: &[PathBuf], device: DeviceKind) -> Result<Self> {
        Ok(Self::new(weights::load(files)?, &device.device()?))
    }

    fn new(weights: Vec<LayerWeights>, device: &Device) -> Self {
        let mut digest = Digest::build();
        for layer in &weights {
            for part in [&layer.weight, &layer.bias, &layer.head] {
                digest = digest.update(bytemuck::cast_slice::<_, u8>(part));
            }
        }
        let identity = digest.finish();
        let layer = |(shape, w): (&Convolution, LayerWeights)| {
            let Convolution { inputs, outputs, kernel, .. } = *shape;
            let tensor = |values: Vec<f32>, size: [usize; 4]| {
                Tensor::<4>::from_data(TensorData::new(values, size), device)
            };
            Layer {
                shape: *shape,
                weight: tensor(w.weight, [outputs, inputs, kernel, kernel]),
                bias: Tensor::from_data(TensorData::new(w.bias, [outputs]), device),
                head: tensor(w.head, [1, outputs, 1, 1]),
            }
        };
        Self { layers: LAYERS.iter().zip(weights).map(layer).collect(), device: device.clone(), identity }
    }

    /// Identity of the weights: their digest.
    pub fn identity(&self) -> Digest {
        self.identity
    }

    /// d(a, b) of two images of display values in [0, 1], `[height, width, 3]`, sRGB.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a side is shorter than [`MIN_SIDE`].
    ///
    /// # Panics
    /// If an image does not have height · width · 3 values.
    pub fn distance(&self, a: &[f32], b: &[f32], height: usize, width: usize) -> Result<f64> {
        assert!(
            a.len() == 3 * height * width && b.len() == a.len(),
            "{} and {} values, images of {width} × {height}",
            a.len(),
            b.len()
        );
        if height.min(width) < MIN_SIDE {
            return Err(Error::invalid(format!(
                "LPIPS needs images of at least {MIN_SIDE} pixels a side, these are {width} × {height}"
            )));
        }
        let mut x = Tensor::<4>::from_data(
            TensorData::new([planes(a), planes(b)].concat(), [2, 3, height, width]),
            &self.device,
        );
        let mut sum = 0.0;
        for layer in &self.layers {
            x = layer.activations(x);
            let length = x.clone().square().sum_dim(1).sqrt() + EPSILON;
            let unit = x.clone() / length;
            let difference = unit.clone().narrow(0, 0, 1) - unit.narrow(0, 1, 1);
            let weighted = (difference.square() * layer.head.clone()).sum_dim(1);
            sum += f64::from(weighted.mean().into_scalar::<f32>());
        }
        Ok(sum)
    }
}

impl Layer {
    fn activations(&self, mut x: Tensor<4>) -> Tensor<4> {
        let Convolution { stride, padding, pooled, .. } = self.shape;
        if pooled {
            x = max_pool2d(x, MaxPoolOptions::new([3; 2]).with_stride([2; 2]));
        }
        let options = ConvOptions::new([stride; 2], [padding; 2], [1; 2], 1);
        relu(conv2d(x, self.weight.clone(), Some(self.bias.clone()), options))
    }
}

/// Channels last to channels first, normalised as the network expects.
fn planes(image: &[f32]) -> Vec<f32> {
    (0..3)
        .flat_map(|c| image.iter().skip(c).step_by(3).map(move |v| (2.0 * v - 1.0 - SHIFT[c]) / SCALE[c]))
        .collect()
}
