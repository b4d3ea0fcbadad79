//! The training loss: a weighted sum of terms, each with its schedule.
//!
//! Images are log radiance `[B, H, W, 3]`, row 0 on top. Every term exists in two forms. The corrected one,
//! the default, does what the paper describes and is what its name says; the reference form reproduces
//! the reference implementation number for number. Where they differ is said at each term.

pub mod cosine;
pub mod irradiance;
pub mod kld;
pub mod mage;
pub mod mse;
pub mod rows;
pub mod scale_invariant;
pub mod stencil;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use burn::tensor::{Device, Tensor, Transaction};
use mage::MageForm;
use mse::LossSpace;
use veni_fit::schedule::WeightSchedule;

pub use veni_fit::loss::{LossConfig, LossForm};

/// One term, times its weight.
#[derive(Clone, Debug)]
pub struct Term {
    /// The name of its weight in [`LossConfig`].
    pub name: &'static str,
    /// The weighted value, `[1]`.
    pub value: Tensor<1>,
}

/// The weighted terms that were computed.
#[derive(Clone, Debug)]
pub struct LossTerms {
    /// Of the image in the order of [`LossConfig`], then of the posterior.
    pub terms: Vec<Term>,
}

impl LossTerms {
    /// Their sum, `[1]`.
    ///
    /// # Panics
    /// If every weight is 0.
    pub fn total(&self) -> Tensor<1> {
        let values = self.terms.iter().map(|t| t.value.clone());
        values.reduce(|a, b| a + b).expect("a loss with at least one weight that is not 0")
    }

    /// Their sum and each of them, in one reading from the device.
    ///
    /// # Panics
    /// If every weight is 0.
    pub fn values(&self) -> (f64, BTreeMap<&'static str, f64>) {
        let all = std::iter::once(self.total()).chain(self.terms.iter().map(|t| t.value.clone()));
        let read = all.fold(Transaction::default(), Transaction::register).execute();
        let mut numbers = read.into_iter().flat_map(|data| data.convert::<f64>().try_into_vec::<f64>());
        let mut next = || numbers.next().expect("as many values as terms")[0];
        (next(), self.terms.iter().map(|t| (t.name, next())).collect())
    }

    /// One weighted term.
    pub fn get(&self, name: &str) -> Option<&Tensor<1>> {
        self.terms.iter().find(|t| t.name == name).map(|t| &t.value)
    }
}

/// The loss for one image size, with its constants ready on the device.
#[derive(Clone, Debug)]
pub struct Loss {
    config: LossConfig,
    rows: Tensor<4>,
    mage: Option<MageForm>,
    /// Of the irradiance term, if it is on.
    surfaces: Option<Tensor<2>>,
    /// Whether images are rays, which count alike.
    rays: bool,
}

impl Loss {
    /// For images of `height` × `width`.
    ///
    /// # Panics
    /// If MAGE is on and the image is smaller than three pixels at its coarsest scale.
    pub fn new(config: &LossConfig, height: usize, width: usize, device: &Device) -> Self {
        let rows = match config.form {
            LossForm::Corrected => rows::solid_angle(height, device),
            LossForm::Reference => rows::reference(height, device),
        };
        let mage = (!config.mage.is_off())
            .then(|| MageForm::new(config.form, config.mage_scales, height, width, device));
        let surfaces = (!config.irradiance.is_off()).then(|| irradiance::surfaces(height, width, device));
        Self { config: *config, rows, mage, surfaces, rays: false }
    }

    /// For `rays` per panorama, as images `[B, rays, 1, 3]`. They are drawn evenly over the sphere and count alike.
    /// The reference form is RENI++'s: the scale-invariant error is taken over all rays of the batch jointly.
    ///
    /// # Panics
    /// If MAGE or irradiance is on: rays have neither neighbours nor areas.
    pub fn rays(config: &LossConfig, rays: usize, device: &Device) -> Self {
        assert!(config.mage.is_off() && config.irradiance.is_off(), "MAGE and irradiance need an image");
        let rows = Tensor::ones([1, rays, 1, 1], device);
        Self { config: *config, rows, mage: None, surfaces: None, rays: true }
    }

    /// All terms whose weight in `step` is not 0, those of the image first. Images `[B, H, W, 3]`; `posterior` is the
    /// encoder's (mean `[B, N, 3]`, log variance `[B, N, 1]`) or, per coordinate, an auto-decoder's (`[B, N, 3]`
    /// both); absent in evaluation.
    pub fn terms(
        &self,
        step: u64,
        prediction: Tensor<4>,
        target: Tensor<4>,
        posterior: Option<(Tensor<3>, Tensor<3>)>,
    ) -> LossTerms {
        let mut terms = self.image_terms(step, prediction, target);
        terms.terms.extend(posterior.and_then(|(mean, log_variance)| self.kld(step, mean, log_variance)));
        terms
    }

    /// The divergence of the posterior from the prior, if its weight in `step` is not 0. Shapes as in
    /// [`Loss::terms`].
    pub fn kld(&self, step: u64, mean: Tensor<3>, log_variance: Tensor<3>) -> Option<Term> {
        let weight = self.config.kld.at(step);
        (weight != 0.0).then(|| {
            let value = match log_variance.dims()[2] {
                3 => kld::per_coordinate(mean, log_variance),
                _ => kld::isotropic(mean, log_variance).mean(),
            };
            Term { name: "kld", value: value * weight }
        })
    }

    /// The terms that compare images.
    pub fn image_terms(&self, step: u64, prediction: Tensor<4>, target: Tensor<4>) -> LossTerms {
        let (config, form) = (&self.config, self.config.form);
        let images = || (prediction.clone(), target.clone(), self.rows.clone());
        let error = |space: LossSpace| {
            let (p, i, rows) = images();
            mse::mse(form, space, p, i, rows, None)
        };
        let mut terms = Vec::new();
        let mut put = |name: &'static str, schedule: &WeightSchedule, value: &dyn Fn() -> Tensor<1>| {
            let weight = schedule.at(step);
            if weight != 0.0 {
                terms.push(Term { name, value: value() * weight });
            }
        };
        if let Some(mage) = &self.mage {
            put("mage", &config.mage, &|| mage.loss(prediction.clone(), target.clone()));
        }
        put("scale_invariant", &config.scale_invariant, &|| {
            let (p, i, rows) = images();
            match form {
                LossForm::Corrected => scale_invariant::scale_invariant(p, i, rows),
                LossForm::Reference if self.rays => scale_invariant::rays(p, i),
                LossForm::Reference => scale_invariant::reference(p, i, rows).mean(),
            }
        });
        put("exposure", &config.exposure, &|| {
            let (p, i, rows) = images();
            let weights = if self.rays { rows } else { rows::solid_angle(p.dims()[1], &p.device()) };
            scale_invariant::exposure(p, i, weights)
        });
        put("cosine", &config.cosine, &|| {
            let (p, i, rows) = images();
            match form {
                LossForm::Corrected => cosine::chromaticity(p, i, rows),
                LossForm::Reference => cosine::reference(p, i, rows),
            }
        });
        put("log_mse", &config.log_mse, &|| error(LossSpace::Log));
        put("hdr_mse", &config.hdr_mse, &|| error(LossSpace::Hdr));
        put("ldr_mse", &config.ldr_mse, &|| error(LossSpace::Ldr));
        if let Some(surfaces) = &self.surfaces {
            put("irradiance", &config.irradiance, &|| {
                irradiance::irradiance(prediction.clone(), target.clone(), surfaces.clone())
            });
        }
        LossTerms { terms }
    }
}
