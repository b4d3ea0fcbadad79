//! Latent optimisation under a fixed decoder: the authors' helper, and RENI++'s evaluation.

use crate::case::{Case, Data};
use crate::{Outcome, Outcome::Compared, Outcome::Skipped, field};
use burn::tensor::{Device, Tensor};
use veni::fit::{FitConfig, FitTarget, fit};
use veni::latent::Latent;
use veni::sphere::Equirect;

/// See [`Family`](crate::Family).
pub(crate) fn run(case: &Case, device: &Device) -> Option<Outcome> {
    if !case.expects("out.losses") || !["VENIField", "RENIField"].contains(&case.module()) {
        return None;
    }
    if let Some(why) = field::unsupported(case) {
        return Some(Skipped(why));
    }
    if case.expects("in.latent0") { helper(case, device) } else { evaluation(case, device) }
    Some(Compared)
}

fn number(case: &Case, key: &str) -> f64 {
    case.number(key).unwrap_or_else(|| panic!("the configuration has no number `{key}`"))
}

/// Between the authors' decoder frame and ours, both ways: (x, y, z) → (−y, −x, z). Adam works on each
/// coordinate alone and does not notice.
fn across([x, y, z]: [f32; 3]) -> [f32; 3] {
    [-y, -x, z]
}

/// Latents in our frame, for `batch` images.
fn latents(data: &Data, batch: usize) -> Vec<Latent> {
    let vectors = data.values.chunks_exact(data.values.len() / batch);
    vectors.map(|z| Latent::new(z.as_chunks().0.iter().copied().map(across).collect())).collect()
}

/// Compares latents with a tensor in the authors' frame.
fn compare_latents(case: &Case, name: &str, latents: &[Latent]) {
    let values = latents.iter().flat_map(|z| z.vectors.iter().copied().flat_map(across)).collect();
    case.compare(name, &Data::new(case.data(name).shape.clone(), values));
}

fn compare_losses(case: &Case, losses: &[f64]) {
    case.compare("out.losses", &Data::new([losses.len()], losses.iter().map(|v| *v as f32).collect()));
}

/// One image with a mask, from a given latent.
fn helper(case: &Case, device: &Device) {
    let decoder = field::build(case, "", device);
    let (image, mask, start) = (case.data("in.image"), case.data("in.mask"), case.data("in.latent0"));
    let grid = Equirect::new(image.shape[1], image.shape[0]);
    let target = FitTarget { grid, images: &[&image.values], masks: Some(&[&mask.values]) };
    let last = number(case, "max_steps") as u64;
    let reference = FitConfig::reference_helper(number(case, "lr"), number(case, "lr_final"), last);
    let after = |steps| {
        let config = FitConfig { steps, epsilon: number(case, "adam_eps"), ..reference };
        fit(&decoder, &target, &latents(start, 1), &config).unwrap_or_else(|e| panic!("{e}"))
    };
    let steps = number(case, "steps") as u64;
    compare_losses(case, &after(steps).losses);
    let recorded = case.tensors.keys().filter_map(|name| name.strip_prefix("out.latent"));
    for steps in recorded.map(|n| n.parse().expect("out.latent<steps>")) {
        compare_latents(case, &format!("out.latent{steps}"), &after(steps).latents);
    }
    let rates = (0..steps).map(|t| reference.learning_rate.at(t) as f32).collect();
    case.compare("out.lrs", &Data::new([steps as usize], rates));
    if case.expects("out.grad0") {
        let z = start.tensor([1, start.shape[1], 3], device).require_grad();
        let prediction = decoder.forward(z.clone(), field::map_directions(&image.shape, device));
        let mask: Tensor<3> = mask.tensor([1, grid.len(), 1], device);
        let error = (prediction - image.tensor([1, grid.len(), 3], device)) * mask;
        let gradients = (error.clone() * error).mean().backward();
        case.compare_tensor("out.grad0", &z.grad(&gradients).expect("a gradient of the latent"));
    }
}

/// All images jointly, from the latents (and scales) of the checkpoint.
fn evaluation(case: &Case, device: &Device) {
    let decoder = field::build(case, "", device);
    let images = case.data("in.images");
    let [batch, height, width, 3] = images.shape[..] else { panic!("images of shape {:?}", images.shape) };
    let views: Vec<_> = images.values.chunks_exact(3 * width * height).collect();
    let target = FitTarget { grid: Equirect::new(width, height), images: &views, masks: None };
    let mut start = latents(case.data("param.eval_mu"), batch);
    let scales = case.get("param.eval_scale");
    if let Some(scales) = scales {
        start.iter_mut().zip(&scales.values).for_each(|(z, s)| z.log_exposure = *s);
    }
    let config = FitConfig {
        steps: number(case, "steps") as u64,
        epsilon: number(case, "adam_eps"),
        free_exposure: scales.is_some(),
        ..FitConfig::reni_evaluation()
    };
    let result = fit(&decoder, &target, &start, &config).unwrap_or_else(|e| panic!("{e}"));
    compare_latents(case, "out.eval_mu20", &result.latents);
    compare_losses(case, &result.losses);
    if scales.is_some() {
        let values = result.latents.iter().map(|z| z.log_exposure).collect();
        case.compare("out.eval_scale20", &Data::new([batch], values));
    }
}
