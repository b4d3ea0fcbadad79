//! Losses that look at whole images, as tensor graphs.

use burn::tensor::{Device, Tensor, TensorData};

use crate::train::loss::{Loss, LossConfig, LossForm, cosine, mse, scale_invariant};
use crate::{Error, Result};
use veni_fit::{FitConfig, FitTarget, Objective, PanoramaLoss};

/// The images and the loss, ready on a device.
#[derive(Debug)]
pub(super) struct WholeLoss {
    kind: Kind,
    target: Tensor<4>,
}

#[derive(Debug)]
enum Kind {
    Rays { exposure: bool },
    Terms(Box<Loss>),
}

impl WholeLoss {
    /// Nothing if the objective looks at each pixel alone.
    pub(super) fn new(config: &FitConfig, target: &FitTarget<'_>, device: &Device) -> Result<Option<Self>> {
        let (width, height) = (target.grid().width, target.grid().height);
        let (name, kind) = match config.objective {
            Objective::CosineScaleInvariant => {
                ("cosine-scale-invariant", Kind::Rays { exposure: config.free_exposure })
            }
            Objective::Terms(losses) => {
                if !target.is_panoramic() {
                    return Err(Error::invalid(
                        "the objective terms compares whole panoramas; use log-error for other views",
                    ));
                }
                let coarsest = height.min(width) >> losses.mage_scales.saturating_sub(1).min(31);
                if !losses.mage.is_off() && coarsest < 3 {
                    return Err(Error::invalid(format!(
                        "{width} × {height} pixels are too few for {} scales of MAGE",
                        losses.mage_scales
                    )));
                }
                let LossConfig {
                    mage,
                    scale_invariant,
                    exposure,
                    cosine,
                    log_mse,
                    hdr_mse,
                    ldr_mse,
                    irradiance,
                    ..
                } = losses;
                let weights =
                    [mage, scale_invariant, exposure, cosine, log_mse, hdr_mse, ldr_mse, irradiance];
                if weights.iter().all(|w| w.at(0) == 0.0) {
                    return Err(Error::invalid("the objective terms has no weight above 0 to begin with"));
                }
                ("terms", Kind::Terms(Box::new(Loss::new(&losses, height, width, device))))
            }
            _ => return Ok(None),
        };
        if target.is_partial() {
            return Err(Error::invalid(format!(
                "the objective {name} takes no masks and no clipped values; use log-error, log-absolute or display"
            )));
        }
        let images: Vec<_> = (0..target.count()).map(|b| target.image(b)).collect();
        let shape = [target.count(), height, width, 3];
        let target = Tensor::from_data(TensorData::new(images.concat(), shape), device);
        Ok(Some(Self { kind, target }))
    }

    /// Of the images' shape.
    fn tensor(&self, log_radiance: &[f64]) -> Tensor<4> {
        let data = TensorData::new(log_radiance.to_vec(), self.target.dims());
        Tensor::from_data(data, &self.target.device())
    }

    fn between(&self, p: Tensor<4>, i: Tensor<4>) -> Tensor<1> {
        match &self.kind {
            Kind::Rays { exposure } => {
                let shape = cosine::rays(p.clone(), i.clone()) + scale_invariant::rays(p.clone(), i.clone());
                if !exposure {
                    return shape;
                }
                let rows = Tensor::ones([1, p.dims()[1], 1, 1], &p.device());
                shape + mse::mse(LossForm::Reference, mse::LossSpace::Log, p, i, rows, None)
            }
            // the schedules are those of training; a fit takes their first values
            Kind::Terms(loss) => loss.terms(0, p, i, None).total(),
        }
    }
}

impl PanoramaLoss for WholeLoss {
    fn with_gradient(&self, log_radiance: &[f64]) -> Result<(f64, Vec<f64>)> {
        let prediction = self.tensor(log_radiance).require_grad();
        let value = self.between(prediction.clone(), self.target.clone());
        let gradients = value.clone().backward();
        let gradient = prediction
            .grad(&gradients)
            .ok_or_else(|| Error::invalid("the loss does not depend on the image"))?;
        let gradient = gradient.into_data().convert::<f64>().try_into_vec().expect("just converted to f64");
        Ok((f64::from(value.into_scalar::<f32>()), gradient))
    }

    fn each(&self, log_radiance: &[f64]) -> Result<Vec<f64>> {
        let prediction = self.tensor(log_radiance);
        let one = |b: usize| {
            let target = self.target.clone().narrow(0, b, 1);
            let loss = self.between(prediction.clone().narrow(0, b, 1), target);
            f64::from(loss.into_scalar::<f32>())
        };
        Ok((0..self.target.dims()[0]).map(one).collect())
    }
}
