//! The losses at some latents, and their gradients: each kind of loss through each kind of decoder.

use veni_light::field::{LocalQuadratic, NormalEquations};
use veni_light::latent::Latent;

use super::decoder::{DecoderPasses, FoldedPasses, LatentDecoder, LatentGradient, PanoramaLoss};
use super::levenberg_marquardt::PROGRESS;
use super::linear_target::LinearTarget;
use super::pixel::PixelLoss;
use crate::shade::RenderedImage;
use crate::{Error, Result};

/// The images' part of the objective.
#[derive(Debug)]
pub(crate) enum ImageLoss<'a> {
    /// One loss per image.
    Pixels(Vec<PixelLoss<'a>>),
    /// All images together.
    Whole(&'a dyn PanoramaLoss),
    /// The light of each latent through the surface of a photograph. The exposure is a property of the photograph, not of
    /// the light.
    Rendered(&'a [RenderedImage]),
    /// The same integrals of every latent's light.
    Linear(&'a LinearTarget),
}

impl ImageLoss<'_> {
    /// Whether there are normal equations of each latent, given a decoder that folds.
    pub(crate) fn has_equations(&self) -> bool {
        matches!(self, Self::Pixels(_) | Self::Linear(_))
    }

    /// A fall of the loss by less than this fraction is not progress. What is left of an integral's loss is the prior's, along a
    /// valley that need not be followed to its end.
    pub(super) fn progress(&self) -> f64 {
        if matches!(self, Self::Linear(_)) { 10.0 * PROGRESS } else { PROGRESS }
    }
}

/// The losses at some latents, and their gradient.
#[derive(Debug, Default)]
pub(crate) struct Evaluation {
    /// Per image; of a loss over all images together its value, as often.
    pub(crate) losses: Vec<f64>,
    /// Of the sum of the images' losses.
    pub(crate) gradient: LatentGradient,
}

/// A decoder with the directions it is asked in.
#[derive(Debug)]
pub(crate) enum Network<'a> {
    Folded(FoldedPasses<'a>),
    Other(Box<dyn DecoderPasses + 'a>),
}

impl<'a> Network<'a> {
    pub(crate) fn new(decoder: &'a dyn LatentDecoder, directions: Vec<[f32; 3]>) -> Self {
        match decoder.folded() {
            Some(decoder) => Self::Folded(FoldedPasses { decoder, directions }),
            None => Self::Other(decoder.in_directions(directions)),
        }
    }

    /// Whether the decoder is folded.
    pub(crate) fn is_folded(&self) -> bool {
        matches!(self, Self::Folded(_))
    }

    fn passes(&self) -> &dyn DecoderPasses {
        match self {
            Self::Folded(passes) => passes,
            Self::Other(passes) => passes.as_ref(),
        }
    }

    /// The losses and their gradient at `latents`.
    pub(crate) fn evaluate(&self, latents: &[Latent], loss: &ImageLoss<'_>) -> Result<Evaluation> {
        let mut losses = Vec::new();
        let gradient = match (self, loss) {
            (Self::Folded(passes), ImageLoss::Pixels(images)) => {
                // fused: each block of directions goes forward and backward at once
                let mut gradient = LatentGradient::default();
                for (field, image) in passes.fields(latents)?.iter().zip(images) {
                    let found = field.gradient(&passes.directions, |i, p| {
                        let value = image.at(i, p.map(f64::from));
                        (value.loss, value.gradient.map(|s| s as f32))
                    });
                    losses.push(found.loss);
                    gradient.push(found);
                }
                gradient
            }
            (_, ImageLoss::Pixels(images)) => self.passes().backward(latents, &mut |prediction| {
                let (each, by_prediction) = pixel_losses(prediction, images);
                losses = each;
                Ok(by_prediction)
            })?,
            (_, ImageLoss::Whole(whole)) => self.passes().backward(latents, &mut |prediction| {
                let (value, by_prediction) = whole.with_gradient(prediction)?;
                losses = vec![value; latents.len()];
                Ok(by_prediction)
            })?,
            (_, ImageLoss::Rendered(images)) => {
                let mut exposures = Vec::new();
                let gradient = self.passes().backward(&without_exposure(latents), &mut |prediction| {
                    let lit = lit(prediction, images, latents);
                    losses = lit.losses;
                    exposures = lit.exposures;
                    Ok(lit.by_light)
                })?;
                LatentGradient { exposures, ..gradient }
            }
            (_, ImageLoss::Linear(target)) => self.passes().backward(latents, &mut |prediction| {
                let each = prediction.chunks_exact(prediction.len() / latents.len());
                let (each, by_prediction): (Vec<_>, Vec<_>) = each.map(|p| target.with_gradient(p)).unzip();
                losses = each;
                Ok(by_prediction.concat())
            })?,
        };
        Ok(Evaluation { losses, gradient })
    }

    /// The normal equations of the loss of image `b` at its latent, for a decoder that [is folded](Network::is_folded) and a
    /// loss that [has them](ImageLoss::has_equations).
    pub(crate) fn equations(
        &self,
        latent: &Latent,
        loss: &ImageLoss<'_>,
        b: usize,
    ) -> Result<NormalEquations> {
        let Self::Folded(FoldedPasses { decoder, directions }) = self else {
            return Err(Error::invalid("normal equations are those of a folded decoder"));
        };
        let field = decoder.condition(latent)?;
        match loss {
            ImageLoss::Pixels(images) => {
                Ok(field.normal_equations(directions, |i, p| local_quadratic(&images[b], i, p)))
            }
            ImageLoss::Linear(target) => {
                let (weights, count) = target.weights();
                Ok(target.equations(&field.moments(directions, weights, count)))
            }
            ImageLoss::Whole(_) | ImageLoss::Rendered(_) => {
                Err(Error::invalid("normal equations are those of pixels or of integrals"))
            }
        }
    }

    /// The loss of each image alone.
    pub(crate) fn losses(&self, latents: &[Latent], loss: &ImageLoss<'_>) -> Result<Vec<f64>> {
        Ok(match loss {
            ImageLoss::Whole(whole) => whole.each(&self.passes().forward(latents)?)?,
            ImageLoss::Pixels(images) => pixel_losses(&self.passes().forward(latents)?, images).0,
            ImageLoss::Rendered(images) => {
                lit(&self.passes().forward(&without_exposure(latents))?, images, latents).losses
            }
            ImageLoss::Linear(target) => {
                let prediction = self.passes().forward(latents)?;
                let each = prediction.chunks_exact(prediction.len() / latents.len());
                each.map(|p| target.with_gradient(p).0).collect()
            }
        })
    }
}

/// A pixel's part of a loss around its log radiance.
pub(super) fn local_quadratic(image: &PixelLoss<'_>, pixel: usize, prediction: [f32; 3]) -> LocalQuadratic {
    let value = image.at(pixel, prediction.map(f64::from));
    let [gradient, weight] = [value.gradient, value.gauss_newton].map(|v| v.map(|v| v as f32));
    LocalQuadratic { loss: value.loss, gradient, weight }
}

fn without_exposure(latents: &[Latent]) -> Vec<Latent> {
    latents.iter().map(|z| Latent { log_exposure: 0.0, ..z.clone() }).collect()
}

/// Each image's loss, and the gradient with respect to all predictions.
fn pixel_losses(prediction: &[f64], images: &[PixelLoss<'_>]) -> (Vec<f64>, Vec<f64>) {
    let mut gradient = Vec::with_capacity(prediction.len());
    let pixels = prediction.as_chunks::<3>().0;
    let losses = images.iter().zip(pixels.chunks_exact(pixels.len() / images.len()));
    let losses = losses.map(|(image, pixels)| {
        pixels
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let value = image.at(i, *p);
                gradient.extend(value.gradient);
                value.loss
            })
            .sum()
    });
    (losses.collect(), gradient)
}

/// The photographs' losses.
#[derive(Default)]
struct Lit {
    losses: Vec<f64>,
    /// Gradient with respect to the log radiance of the lights.
    by_light: Vec<f64>,
    /// Gradient with respect to the exposures.
    exposures: Vec<f64>,
}

fn lit(prediction: &[f64], images: &[RenderedImage], latents: &[Latent]) -> Lit {
    let light: Vec<[f32; 3]> = prediction.as_chunks::<3>().0.iter().map(|p| p.map(|v| v as f32)).collect();
    let each = images.iter().zip(light.chunks_exact(light.len() / images.len())).zip(latents);
    let mut out = Lit::default();
    for ((image, light), latent) in each {
        let (loss, by_light, exposure) = image.evaluate(light, latent.log_exposure);
        out.losses.push(loss);
        out.by_light.extend(by_light.as_flattened().iter().map(|s| f64::from(*s)));
        out.exposures.push(exposure);
    }
    out
}
