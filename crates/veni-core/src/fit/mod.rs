//! Latent optimisation: the code of a panorama under a fixed decoder, by Adam on the latent.
//!
//! All images are optimised together, each with its own latent Z [N, 3] and log exposure s: the decoded log
//! radiance plus s is compared with the image. s stays as it is unless it is asked to be free. The decoder's
//! weights are constants here.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use serde::{Deserialize, Serialize};

use crate::latent::Latent;
use crate::sphere::Equirect;
use crate::train::loss::{LossForm, cosine, mse, rows, scale_invariant};
use crate::train::schedule::{LearningRate, Ramp};
use crate::vae::Decoder;
use crate::{Error, Result};

/// What is minimised, and how.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitConfig {
    /// Adam updates.
    pub steps: u64,
    /// Learning rate over the updates, from step 0.
    pub learning_rate: LearningRate,
    /// Adam's ε. The authors' 1e-15 makes every coordinate move by the full rate at first.
    pub epsilon: f64,
    /// What is compared.
    pub objective: Objective,
    /// Weight of ½ mean |z|² over the latent vectors, which pulls towards the standard normal prior; 0: off.
    pub prior: f64,
    /// Whether each latent's log exposure is optimised too.
    pub free_exposure: bool,
}

/// The part of the loss that looks at the image. All are in log radiance; images [B, H, W, 3], mask [B, H, W].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Objective {
    /// Σ ω m (P − I)²/Σ ω m with solid angles ω.
    LogError,
    /// mean((m P − m I)²) over all pixels alike: the authors' helper.
    ReferenceLogError,
    /// 1 − mean cos(P, I) + mean(R²) − mean(R)², R = P − I, over all pixels of all images alike (RENI++);
    /// with a free exposure, + mean(R²). It takes no mask.
    CosineScaleInvariant,
}

impl FitConfig {
    /// From any start to convergence with solid-angle weights: for evaluation and for use.
    pub fn thorough() -> Self {
        Self {
            steps: 400,
            learning_rate: exponential(5e-2, 2e-3, 400),
            epsilon: 1e-8,
            objective: Objective::LogError,
            prior: 1e-3,
            free_exposure: false,
        }
    }

    /// The authors' helper (figures, uniqueness): 2000 steps from `rate` to `last`.
    pub fn reference_helper(rate: f64, last: f64, steps: u64) -> Self {
        Self {
            steps,
            learning_rate: exponential(rate, last, steps),
            epsilon: 1e-15,
            objective: Objective::ReferenceLogError,
            prior: 0.0,
            free_exposure: false,
        }
    }

    /// RENI++'s evaluation: 2500 steps from latent 0, without random rays.
    pub fn reni_evaluation() -> Self {
        Self {
            steps: 2500,
            learning_rate: exponential(1e-1, 1e-7, 2500),
            epsilon: 1e-15,
            objective: Objective::CosineScaleInvariant,
            prior: 0.0,
            free_exposure: false,
        }
    }
}

fn exponential(rate: f64, last: f64, steps: u64) -> LearningRate {
    LearningRate::Exponential { rate, last, steps, warm_up: 0, before: 0.0, ramp: Ramp::Cosine }
}

/// Images to be fitted, on one grid.
#[derive(Clone, Debug)]
pub struct FitTarget<'a> {
    /// Their pixels.
    pub grid: Equirect,
    /// Unit directions of the pixels, row-major, if they are not exactly those of the grid.
    pub directions: Option<&'a [[f32; 3]]>,
    /// Log radiance, 3·W·H values each.
    pub images: &'a [&'a [f32]],
    /// How much each pixel counts, W·H values per image, 0 where unknown; absent: all count.
    pub masks: Option<&'a [&'a [f32]]>,
}

/// What came out.
#[derive(Clone, Debug, PartialEq)]
pub struct FitResult {
    /// One for each image.
    pub latents: Vec<Latent>,
    /// The loss before each update, averaged over the images.
    pub losses: Vec<f64>,
}

/// Optimises one latent per image from `start`, on the decoder's device.
///
/// # Errors
/// [`Error::Invalid`] if the numbers of images, masks and starts or their sizes disagree, if there are none,
/// or if the loss is no longer finite.
pub fn fit(
    decoder: &Decoder,
    target: &FitTarget<'_>,
    start: &[Latent],
    config: &FitConfig,
) -> Result<FitResult> {
    check(decoder, target, start)?;
    let device = decoder.output.bias.val().device().without_autodiff().autodiff();
    // constants on the graph's device: no gradient is spent on weights
    let decoder = decoder.clone().fork(&device).freeze();
    let (batch, n) = (start.len(), decoder.latent_vectors());
    let problem = Problem::new(target, config, &device);
    let vectors = start.iter().flat_map(|z| z.vectors.as_flattened()).copied().collect();
    let mut latent = Variable::new(vectors, config.epsilon);
    let mut exposure = Variable::new(start.iter().map(|z| z.log_exposure).collect(), config.epsilon);
    let mut losses = Vec::with_capacity(config.steps as usize);
    for step in 0..config.steps {
        let z = latent.tensor([batch, n, 3], &device);
        let s = exposure.tensor([batch, 1, 1, 1], &device);
        let loss = problem.loss(&decoder, z.clone(), s.clone());
        let value = f64::from(loss.clone().into_scalar::<f32>());
        if !value.is_finite() {
            return Err(Error::invalid(format!(
                "the fit's loss is {value} at step {step}; lower its learning rate"
            )));
        }
        losses.push(value);
        let gradients = loss.backward();
        let rate = config.learning_rate.at(step);
        latent.update(z.grad(&gradients), rate, step + 1);
        if config.free_exposure {
            exposure.update(s.grad(&gradients), rate, step + 1);
        }
    }
    let vectors = latent.values.as_chunks().0.chunks_exact(n).map(<[[f32; 3]]>::to_vec);
    let latents =
        vectors.zip(exposure.values).map(|(v, log_exposure)| Latent { log_exposure, ..Latent::new(v) });
    Ok(FitResult { latents: latents.collect(), losses })
}

fn check(decoder: &Decoder, target: &FitTarget<'_>, start: &[Latent]) -> Result<()> {
    let (images, n) = (target.images.len(), decoder.latent_vectors());
    if images == 0 || start.len() != images {
        return Err(Error::invalid(format!("{images} images and {} latents to start from", start.len())));
    }
    if let Some(wrong) = start.iter().find(|z| z.vectors.len() != n) {
        return Err(Error::invalid(format!(
            "a start has {} vectors, the decoder takes {n}",
            wrong.vectors.len()
        )));
    }
    let pixels = target.grid.len();
    if let Some(wrong) = target.images.iter().find(|image| image.len() != 3 * pixels) {
        return Err(Error::invalid(format!("an image has {} values, its grid {pixels} pixels", wrong.len())));
    }
    if let Some(directions) = target.directions.filter(|d| d.len() != pixels) {
        return Err(Error::invalid(format!("{} directions for {pixels} pixels", directions.len())));
    }
    if let Some(masks) = target.masks {
        if masks.len() != images || masks.iter().any(|m| m.len() != pixels) {
            return Err(Error::invalid(format!(
                "{images} images of {pixels} pixels need as many masks of that size"
            )));
        }
        if masks.iter().any(|m| !(m.iter().sum::<f32>() > 0.0 && m.iter().all(|v| *v >= 0.0))) {
            return Err(Error::invalid("a mask covers nothing, or has negative values"));
        }
    }
    Ok(())
}

/// The constants of a fit on its device.
struct Problem {
    objective: Objective,
    prior: f64,
    free_exposure: bool,
    directions: Tensor<2>,
    target: Tensor<4>,
    mask: Option<Tensor<4>>,
    rows: Tensor<4>,
}

impl Problem {
    fn new(target: &FitTarget<'_>, config: &FitConfig, device: &Device) -> Self {
        let (batch, Equirect { width, height }) = (target.images.len(), target.grid);
        let constant = |values: Vec<f32>, channels| {
            Tensor::<4>::from_data(TensorData::new(values, [batch, height, width, channels]), device)
        };
        let directions = target.directions.map_or_else(|| target.grid.directions(), <[_]>::to_vec);
        let directions = TensorData::new(directions.into_flattened(), [target.grid.len(), 3]);
        Self {
            objective: config.objective,
            prior: config.prior,
            free_exposure: config.free_exposure,
            directions: Tensor::from_data(directions, device),
            target: constant(target.images.concat(), 3),
            mask: target.masks.map(|masks| constant(masks.concat(), 1)),
            rows: match config.objective {
                Objective::LogError => rows::solid_angle(height, device),
                _ => Tensor::ones([1, height, 1, 1], device),
            },
        }
    }

    fn loss(&self, decoder: &Decoder, latent: Tensor<3>, log_exposure: Tensor<4>) -> Tensor<1> {
        let prediction = decoder.forward(latent.clone(), self.directions.clone()).reshape(self.target.dims());
        let (p, i) = (prediction + log_exposure, self.target.clone());
        let log_error =
            |form, p, i| mse::mse(form, mse::Space::Log, p, i, self.rows.clone(), self.mask.clone());
        let image = match self.objective {
            Objective::LogError => log_error(LossForm::Corrected, p, i),
            Objective::ReferenceLogError => log_error(LossForm::Reference, p, i),
            Objective::CosineScaleInvariant => {
                let shape = cosine::rays(p.clone(), i.clone()) + scale_invariant::rays(p.clone(), i.clone());
                if self.free_exposure { shape + log_error(LossForm::Reference, p, i) } else { shape }
            }
        };
        if self.prior == 0.0 {
            return image;
        }
        let [batch, n, _] = latent.dims();
        image + (latent.clone() * latent).sum() * (0.5 * self.prior / (batch * n) as f64)
    }
}

/// Numbers under optimisation, with Adam's moments.
struct Variable {
    values: Vec<f32>,
    first: Vec<f64>,
    second: Vec<f64>,
    epsilon: f64,
}

impl Variable {
    fn new(values: Vec<f32>, epsilon: f64) -> Self {
        let zeros = vec![0.0; values.len()];
        Self { values, first: zeros.clone(), second: zeros, epsilon }
    }

    fn tensor<const D: usize>(&self, shape: [usize; D], device: &Device) -> Tensor<D> {
        Tensor::from_data(TensorData::new(self.values.clone(), shape), device).require_grad()
    }

    /// Adam with β = (0.9, 0.999), as [`Optimiser`](crate::train::optimiser::Optimiser) without groups, in double
    /// precision: these are few numbers, and a tiny ε amplifies every rounding.
    fn update<const D: usize>(&mut self, gradient: Option<Tensor<D>>, rate: f64, t: u64) {
        let gradient = gradient.expect("the loss depends on every latent");
        let gradient: Vec<f32> =
            gradient.into_data().convert::<f32>().try_into_vec().expect("just converted to f32");
        let (bias1, bias2) = (1.0 - 0.9_f64.powf(t as f64), 1.0 - 0.999_f64.powf(t as f64));
        let moments = self.first.iter_mut().zip(&mut self.second);
        for ((x, (m, v)), g) in self.values.iter_mut().zip(moments).zip(gradient.into_iter().map(f64::from)) {
            *m += 0.1 * (g - *m);
            *v += 0.001 * (g * g - *v);
            let root = (*v / bias2).sqrt();
            *x = (f64::from(*x) - rate / bias1 * *m / (root + self.epsilon)) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::random::{Purpose, normal, stream};
    use crate::model::DecoderConfig;

    fn decoder() -> Decoder {
        let config = DecoderConfig { hidden: 16, layers: 2, heads: 2, ..DecoderConfig::default() };
        Decoder::new(&config, 3, &mut stream(1, Purpose::Weights, 0, 0), &Device::flex())
    }

    fn latent(seed: u64) -> Latent {
        let mut rng = stream(seed, Purpose::Fit, 0, 0);
        Latent::new((0..3).map(|_| [0; 3].map(|_| normal(&mut rng) as f32)).collect())
    }

    fn image(decoder: &Decoder, grid: Equirect, seed: u64) -> Vec<f32> {
        crate::vae::veni::decode(decoder, grid, &[latent(seed).vectors]).remove(0)
    }

    #[test]
    fn images_of_the_decoder_itself_are_found_again() {
        let (decoder, grid) = (decoder(), Equirect::new(16, 8));
        let images = [1, 2].map(|seed| image(&decoder, grid, seed));
        let views: Vec<_> = images.iter().map(Vec::as_slice).collect();
        let target = FitTarget { grid, directions: None, images: &views, masks: None };
        let config = FitConfig { prior: 0.0, ..FitConfig::thorough() };
        let moved =
            |seed| Latent::new(latent(seed).vectors.into_iter().map(|v| v.map(|c| c + 0.03)).collect());
        let start = [1, 2].map(moved);
        let result = fit(&decoder, &target, &start, &config).unwrap();
        let (first, last) = (result.losses[0], *result.losses.last().unwrap());
        assert!(last < 0.02 * first, "{first} to {last}");
    }

    #[test]
    fn a_mask_hides_what_it_covers_and_a_free_scale_finds_the_exposure() {
        let (decoder, grid) = (decoder(), Equirect::new(16, 8));
        let mut image = image(&decoder, grid, 1);
        let mut mask = vec![1.0; grid.len()];
        for p in 0..40 {
            mask[p] = 0.0;
            image[3 * p..3 * p + 3].fill(50.0);
        }
        let run = |image: &[f32], free_exposure| {
            let target = FitTarget { grid, directions: None, images: &[image], masks: Some(&[&mask]) };
            let config = FitConfig { steps: 60, prior: 0.0, free_exposure, ..FitConfig::thorough() };
            fit(&decoder, &target, &[latent(1)], &config).unwrap()
        };
        let exact = run(&image, false);
        assert!(exact.losses[0] < 1e-9, "what is masked does not count: {}", exact.losses[0]);
        let brighter: Vec<f32> = image.iter().map(|v| v + 0.7).collect();
        let scaled = run(&brighter, true);
        assert!(scaled.losses[59] < 0.1 * scaled.losses[0]);
        assert!(scaled.latents[0].log_exposure > 0.2);
    }

    #[test]
    fn what_does_not_fit_together_is_refused() {
        let (decoder, grid) = (decoder(), Equirect::new(4, 2));
        let image = vec![0.0; 24];
        let message = |images: &[&[f32]], masks, start: &[Latent]| {
            let target = FitTarget { grid, directions: None, images, masks };
            fit(&decoder, &target, start, &FitConfig::thorough()).unwrap_err().to_string()
        };
        assert!(message(&[], None, &[]).contains("0 images"));
        assert!(message(&[&image[1..]], None, &[latent(1)]).contains("23 values"));
        assert!(
            message(&[&image], None, &[Latent::new(latent(1).vectors[..2].to_vec())]).contains("2 vectors")
        );
        let empty = [0.0; 8];
        assert!(message(&[&image], Some(&[&empty]), &[latent(1)]).contains("mask"));
    }
}
