//! The two ways to run a decoder forward and backward.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};

use super::pixel::PixelLoss;
use super::whole::WholeLoss;
use crate::field::{self, Curved, NormalEquations};
use crate::latent::Latent;
use crate::shade::ShadedImage;
use crate::vae;
use crate::{Error, Result};

/// A decoder under which latents are optimised; its weights are constants.
#[derive(Clone, Copy, Debug)]
pub enum FitDecoder<'a> {
    /// The decoder folded per latent, with its gradient in closed form: the fast way.
    Folded(&'a field::Decoder),
    /// The decoder as a graph of tensors on its device: every kind of decoder, every floating-point type.
    Graph(&'a vae::Decoder),
}

impl<'a> From<&'a field::Decoder> for FitDecoder<'a> {
    fn from(decoder: &'a field::Decoder) -> Self {
        Self::Folded(decoder)
    }
}

impl<'a> From<&'a vae::Decoder> for FitDecoder<'a> {
    fn from(decoder: &'a vae::Decoder) -> Self {
        Self::Graph(decoder)
    }
}

impl FitDecoder<'_> {
    /// N, the number of latent vectors.
    pub fn latent_vectors(self) -> usize {
        match self {
            Self::Folded(decoder) => decoder.latent_vectors(),
            Self::Graph(decoder) => decoder.latent_vectors(),
        }
    }

    /// Where losses over whole images are computed.
    pub(super) fn device(self) -> Device {
        match self {
            Self::Folded(_) => Device::flex().autodiff(),
            Self::Graph(decoder) => decoder.output.bias.val().device().without_autodiff().autodiff(),
        }
    }
}

/// The images' part of the objective.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one per fit")]
pub(super) enum ImageLoss<'a> {
    /// One loss per image.
    Pixels(Vec<PixelLoss<'a>>),
    /// All images together.
    Whole(WholeLoss),
    /// The light of each latent through the surface of a photograph; the exposure is the photograph's affair.
    Shaded(&'a [ShadedImage]),
}

/// The losses at some latents, and their slopes.
#[derive(Debug, Default)]
pub(super) struct Evaluation {
    /// Per image; of a loss over all images together its value, as often.
    pub(super) losses: Vec<f64>,
    /// By the coordinates of all latents, of the sum of the images' losses.
    pub(super) vectors: Vec<f64>,
    /// By the log exposures.
    pub(super) exposures: Vec<f64>,
}

/// A decoder with the directions it is asked in.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one per fit")]
pub(super) enum Network<'a> {
    Folded { decoder: &'a field::Decoder, directions: Vec<[f32; 3]>, device: Device },
    Graph { decoder: Box<vae::Decoder>, directions: Tensor<2>, device: Device },
}

impl<'a> Network<'a> {
    pub(super) fn new(decoder: FitDecoder<'a>, directions: Vec<[f32; 3]>) -> Self {
        let device = decoder.device();
        match decoder {
            FitDecoder::Folded(decoder) => Self::Folded { decoder, directions, device },
            FitDecoder::Graph(decoder) => {
                let shape = [directions.len(), 3];
                let directions = TensorData::new(directions.into_flattened(), shape);
                Self::Graph {
                    // constants on the graph's device: no gradient is spent on weights
                    decoder: Box::new(decoder.clone().fork(&device).freeze()),
                    directions: Tensor::from_data(directions, &device),
                    device,
                }
            }
        }
    }

    /// Whether the decoder is folded.
    pub(super) fn is_folded(&self) -> bool {
        matches!(self, Self::Folded { .. })
    }

    /// The losses and their slopes at `latents`.
    pub(super) fn evaluate(&self, latents: &[Latent], loss: &ImageLoss<'_>) -> Result<Evaluation> {
        match self {
            Self::Folded { decoder, directions, device } => {
                let bare = matches!(loss, ImageLoss::Shaded(_));
                let fields = conditioned(decoder, latents, bare)?;
                folded(&fields, directions, device, latents, loss)
            }
            Self::Graph { decoder, directions, device } => {
                graph(&|z| decoder.forward(z, directions.clone()), device, latents, loss)
            }
        }
    }

    /// The normal equations of one image at its latent, for a decoder that [is folded](Network::is_folded).
    pub(super) fn equations(&self, latent: &Latent, image: &PixelLoss<'_>) -> Result<NormalEquations> {
        let Self::Folded { decoder, directions, .. } = self else {
            return Err(Error::invalid("normal equations are those of a folded decoder"));
        };
        let at = |i: usize, p: [f32; 3]| {
            let value = image.at(i, p.map(f64::from));
            let [slope, curvature] = [value.slope, value.curvature].map(|v| v.map(|v| v as f32));
            Curved { loss: value.loss, slope, curvature }
        };
        Ok(decoder.condition(latent)?.normal_equations(directions, at))
    }

    /// The loss of each image alone.
    pub(super) fn losses(&self, latents: &[Latent], loss: &ImageLoss<'_>) -> Result<Vec<f64>> {
        let bare = matches!(loss, ImageLoss::Shaded(_));
        let prediction: Tensor<3> = match self {
            Self::Folded { decoder, directions, device } => {
                let fields = conditioned(decoder, latents, bare)?;
                decoded(&fields, directions, [latents.len(), 1, directions.len(), 3], device).squeeze_dim(1)
            }
            Self::Graph { decoder, directions, device } => {
                let prediction = decoder.forward(vectors(latents, device), directions.clone());
                if bare { prediction } else { prediction + exposures(latents, device) }
            }
        };
        Ok(match loss {
            ImageLoss::Whole(whole) => whole.each(&prediction.reshape(whole.shape())),
            ImageLoss::Pixels(images) => slopes(&numbers(prediction), images).0,
            ImageLoss::Shaded(images) => lit(&numbers(prediction), images, latents).losses,
        })
    }
}

/// By the folded fields' own gradients.
fn folded(
    fields: &[field::Field],
    directions: &[[f32; 3]],
    device: &Device,
    latents: &[Latent],
    loss: &ImageLoss<'_>,
) -> Result<Evaluation> {
    // a loss over the whole image is known before any gradient: its slopes are handed to each field
    let with_slopes = |slopes: &[f64]| -> Vec<field::Gradient> {
        let each = fields.iter().zip(slopes.as_chunks::<3>().0.chunks_exact(directions.len()));
        each.map(|(field, slopes)| field.gradient(directions, |i, _| (0.0, slopes[i].map(|s| s as f32))))
            .collect()
    };
    let shape = [fields.len(), 1, directions.len(), 3];
    let mut found = Evaluation::default();
    let gradients: Vec<_> = match loss {
        ImageLoss::Pixels(images) => {
            let each = fields.iter().zip(images).map(|(field, image)| {
                field.gradient(directions, |i, p| {
                    let value = image.at(i, p.map(f64::from));
                    (value.loss, value.slope.map(|s| s as f32))
                })
            });
            let gradients: Vec<_> = each.collect();
            found.losses = gradients.iter().map(|g| g.loss).collect();
            gradients
        }
        ImageLoss::Whole(whole) => {
            let prediction = decoded(fields, directions, whole.shape(), device).require_grad();
            let value = whole.of(prediction.clone());
            let gradients = value.clone().backward();
            let slopes = numbers(prediction.grad(&gradients).ok_or_else(unconnected)?);
            found.losses = vec![f64::from(value.into_scalar::<f32>()); fields.len()];
            with_slopes(&slopes)
        }
        ImageLoss::Shaded(images) => {
            let lit = lit(&numbers(decoded(fields, directions, shape, device)), images, latents);
            let gradients = with_slopes(&lit.vectors);
            found = Evaluation { vectors: Vec::new(), ..lit };
            gradients
        }
    };
    let flat = |g: &field::Gradient| g.vectors.as_flattened().to_vec();
    found.vectors = gradients.iter().flat_map(flat).map(f64::from).collect();
    if found.exposures.is_empty() {
        found.exposures = gradients.iter().map(|g| f64::from(g.log_exposure)).collect();
    }
    Ok(found)
}

/// By the tensor graph.
fn graph(
    decode: &dyn Fn(Tensor<3>) -> Tensor<3>,
    device: &Device,
    latents: &[Latent],
    loss: &ImageLoss<'_>,
) -> Result<Evaluation> {
    let (z, s) = (vectors(latents, device).require_grad(), exposures(latents, device).require_grad());
    let constant = |slopes: Vec<f64>, like: &Tensor<3>| -> Tensor<3> {
        Tensor::from_data(TensorData::new(slopes, like.dims()), device)
    };
    let (losses, gradients) = match loss {
        ImageLoss::Whole(whole) => {
            let value = whole.of((decode(z.clone()) + s.clone()).reshape(whole.shape()));
            let gradients = value.clone().backward();
            (vec![f64::from(value.into_scalar::<f32>()); latents.len()], gradients)
        }
        ImageLoss::Pixels(images) => {
            let prediction = decode(z.clone()) + s.clone();
            let (losses, slopes) = slopes(&numbers(prediction.clone()), images);
            let slopes = constant(slopes, &prediction);
            (losses, (prediction * slopes).sum().backward())
        }
        ImageLoss::Shaded(images) => {
            let prediction = decode(z.clone());
            let lit = lit(&numbers(prediction.clone()), images, latents);
            let slopes = constant(lit.vectors, &prediction);
            let gradients = (prediction * slopes).sum().backward();
            let vectors = numbers(z.grad(&gradients).ok_or_else(unconnected)?);
            return Ok(Evaluation { losses: lit.losses, vectors, exposures: lit.exposures });
        }
    };
    Ok(Evaluation {
        losses,
        vectors: numbers(z.grad(&gradients).ok_or_else(unconnected)?),
        exposures: numbers(s.grad(&gradients).ok_or_else(unconnected)?),
    })
}

/// Fields at the latents' exposures, or at exposure 0.
fn conditioned(decoder: &field::Decoder, latents: &[Latent], bare: bool) -> Result<Vec<field::Field>> {
    let one = |z: &Latent| match bare {
        true => decoder.condition(&Latent { log_exposure: 0.0, ..z.clone() }),
        false => decoder.condition(z),
    };
    latents.iter().map(one).collect()
}

/// The photographs' losses, with slopes by all log radiance (in `vectors`) and by exposures.
fn lit(prediction: &[f64], images: &[ShadedImage], latents: &[Latent]) -> Evaluation {
    let light: Vec<[f32; 3]> = prediction.as_chunks::<3>().0.iter().map(|p| p.map(|v| v as f32)).collect();
    let each = images.iter().zip(light.chunks_exact(light.len() / images.len())).zip(latents);
    let mut out = Evaluation::default();
    for ((image, light), latent) in each {
        let (loss, slopes, exposure) = image.evaluate(light, latent.log_exposure);
        out.losses.push(loss);
        out.vectors.extend(slopes.as_flattened().iter().map(|s| f64::from(*s)));
        out.exposures.push(exposure);
    }
    out
}

fn unconnected() -> Error {
    Error::invalid("the loss does not depend on the latents")
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

fn decoded(
    fields: &[field::Field],
    directions: &[[f32; 3]],
    shape: [usize; 4],
    device: &Device,
) -> Tensor<4> {
    let mut all = vec![[0.0; 3]; fields.len() * directions.len()];
    for (field, out) in fields.iter().zip(all.chunks_exact_mut(directions.len())) {
        field.log_radiance_batch(directions, out);
    }
    Tensor::from_data(TensorData::new(all.into_flattened(), shape), device)
}

fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f64> {
    tensor.into_data().convert::<f64>().try_into_vec().expect("just converted to f64")
}

/// Each image's loss, and its slopes by all predictions.
fn slopes(prediction: &[f64], images: &[PixelLoss<'_>]) -> (Vec<f64>, Vec<f64>) {
    let mut slopes = Vec::with_capacity(prediction.len());
    let pixels = prediction.as_chunks::<3>().0;
    let losses = images.iter().zip(pixels.chunks_exact(pixels.len() / images.len()));
    let losses = losses.map(|(image, pixels)| {
        pixels
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let value = image.at(i, *p);
                slopes.extend(value.slope);
                value.loss
            })
            .sum()
    });
    (losses.collect(), slopes)
}
