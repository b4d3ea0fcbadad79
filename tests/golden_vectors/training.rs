//! Three training steps of a small auto-encoder: forward, losses, backward, clipping, Adam, schedule.

use crate::case::{Case, Data};
use crate::official::Official;
use crate::{Outcome, Outcome::Compared, Outcome::Elsewhere, Outcome::Skipped, double, field};
use burn::tensor::{Device, Tensor};
use serde_json::Value;
use veni::sphere::StripeSampling;
use veni::sphere::reference::line_directions;
use veni::sphere::{Equirect, Stripes};
use veni::train::loss::{Loss, LossConfig, LossTerms};
use veni::train::optimiser::{AdamConfig, Group, Optimiser};
use veni::train::schedule::LearningRate;
use veni::vae::weights;
use veni::vae::{Posterior, Veni};

/// See [`Family`](crate::Family).
pub(crate) fn run(case: &Case, device: &Device) -> Option<Outcome> {
    if case.module() != "VENIModel" || !case.expects("out.step1.loss") {
        return None;
    }
    if !double::active() {
        return Some(Elsewhere(double::elsewhere(case, device)));
    }
    let field = field_case(case);
    if let Some(why) = field::unsupported(&field) {
        return Some(Skipped(why));
    }
    compare(case, &field, device);
    Some(Compared)
}

/// The same tensors under the options of the field, which stand in a group of their own here.
fn field_case(case: &Case) -> Case {
    let mut field = case.clone_without_results();
    field.config = case.config["field"].clone();
    field.config["module"] = Value::from("VENIField");
    field
}

fn compare(case: &Case, field: &Case, device: &Device) {
    let size = |key: &str| case.size(key).unwrap_or_else(|| panic!("the configuration has no size `{key}`"));
    let official = Official::new(case, &case.config["encoder"], "encoder.");
    let sizes = field::Sizes::of(field);
    let mut veni =
        Veni { encoder: official.build(case, device), decoder: field::build(field, "field.", device) };
    let [batch, height, width] = ["B", "H", "W"].map(size);
    let target = case.tensor::<4>("in.image", device);
    let scene = Scene {
        stripes: [size("samples_per_img"), size("patch_size")],
        grid: Equirect::new(width, height),
        images: case
            .data("in.image")
            .values
            .chunks_exact(3 * width * height)
            .map(|i| i.as_chunks().0)
            .collect(),
    };
    let directions = field::map_directions(&[height, width, 3], device);
    let loss = Loss::new(&LossConfig::reference(), height, width, device);
    let (groups, rates): (Vec<_>, Vec<_>) =
        ["decoder", "encoder"].map(|name| group(case, name)).into_iter().unzip();
    let mut optimiser = Optimiser::new(&veni, groups, 0.0).expect("every parameter is in a group");

    let noise = case.data("in.eps");
    let steps = noise.shape[0];
    for step in 1..=steps {
        let part = |name: &str| {
            let data = case.data(name);
            let size = data.values.len() / steps;
            Data::new(data.shape[1..].to_vec(), data.values[(step - 1) * size..step * size].to_vec())
        };
        let (seen, colours) = scene.samples(&part("in.yaw").values, device);
        let posterior = veni.encoder.forward_per_image(official.seen(seen), colours);
        let noise = part("in.eps");
        let latent = posterior.sample(noise.tensor([batch, noise.shape[1], 3], device));
        let rgb = veni.decoder.forward(latent.clone(), directions.clone()).reshape([batch, height, width, 3]);
        let log_variance = posterior.log_variance.clone().expect("the encoder is variational");
        let gaussian = Some((posterior.mean.clone(), log_variance));
        let terms = loss.terms(step as u64 - 1, rgb.clone(), target.clone(), gaussian);
        compare_outputs(case, step, &posterior, &latent, &rgb);
        compare_losses(case, step, &terms);

        let gradients = terms.total().backward();
        if step == 1 {
            let decoder = weights::gradients(&veni.decoder, "", &gradients);
            field::compare_records(case, &sizes, "grad.field.", &decoder);
            official.compare_records(case, "grad.", &weights::gradients(&veni.encoder, "", &gradients));
        }
        let now: Vec<_> = rates.iter().map(|rate: &LearningRate| rate.at(step as u64 - 1)).collect();
        let reports;
        (veni, reports) = optimiser.step(veni, &gradients, &now);
        for (name, report) in ["field", "encoder"].into_iter().zip(reports) {
            case.compare_scalar(&format!("out.step{step}.gradnorm.{name}"), report.gradient_norm);
            case.compare_scalar(&format!("out.step{step}.lr.{name}"), report.learning_rate);
        }
        let record = format!("after{step}.");
        field::compare_records(case, &sizes, &format!("{record}field."), &weights::read(&veni.decoder, ""));
        official.compare_records(case, &record, &weights::read(&veni.encoder, ""));
    }
    assert_frozen(case, &sizes.dead_keys("field."), steps);
}

/// One optimiser group, and its learning rate.
fn group(case: &Case, prefix: &str) -> (Group, LearningRate) {
    let optim = &case.config["optim"];
    let number = |options: &Value, key: &str| {
        options[key].as_f64().unwrap_or_else(|| panic!("no number `{key}` in {options}"))
    };
    let adam = &optim["adam"];
    let beta = |i: usize| adam["betas"][i].as_f64().expect("two betas");
    let theirs = if prefix == "decoder" { "lr_field" } else { "lr_encoder" };
    let rate = number(adam, theirs);
    let schedule = if optim["schedule"] == Value::Bool(true) {
        let [warm_up, steps] = ["warm_up_end", "max_steps"].map(|key| number(optim, key) as u64);
        LearningRate::Cosine { rate, warm_up, steps, floor: number(optim, "alpha"), periodic: true }
    } else {
        LearningRate::Constant { rate }
    };
    let adam = AdamConfig {
        beta1: beta(0),
        beta2: beta(1),
        epsilon: number(adam, "eps"),
        weight_decay: 0.0,
        clip: Some(number(optim, "max_norm")),
    };
    (Group { prefix: prefix.into(), adam }, schedule)
}

/// What the encoder looks at.
struct Scene<'a> {
    stripes: [usize; 2],
    grid: Equirect,
    images: Vec<&'a [[f32; 3]]>,
}

impl Scene<'_> {
    /// The reference implementation's line sampling, rotated by each image's yaw: directions and colours [B, T, P, 3].
    fn samples(&self, yaws: &[f32], device: &Device) -> (Tensor<4>, Tensor<4>) {
        let [t, p] = self.stripes;
        let stripes = Stripes::new(t, p, StripeSampling::Reference).unwrap_or_else(|e| panic!("{e}"));
        let lines = line_directions(t, p);
        let (mut directions, mut colours) = (Vec::new(), Vec::new());
        for (image, yaw) in self.images.iter().zip(yaws) {
            let (sin, cos) = yaw.sin_cos();
            directions.extend(lines.iter().flat_map(|[x, y, z]| [cos * x + sin * y, cos * y - sin * x, *z]));
            colours.extend(stripes.gather_rotated(self.grid, f64::from(*yaw)).sample(image).into_flattened());
        }
        let tensor = |values| Data::new([yaws.len(), t, p, 3], values).tensor([yaws.len(), t, p, 3], device);
        (tensor(directions), tensor(colours))
    }
}

fn compare_outputs(case: &Case, step: usize, posterior: &Posterior, latent: &Tensor<3>, rgb: &Tensor<4>) {
    let name = |output: &str| format!("out.step{step}.{output}");
    if case.expects(&name("mu")) {
        case.compare_tensor(&name("mu"), &posterior.mean);
        case.compare_tensor(&name("logvar"), posterior.log_variance.as_ref().expect("a log variance"));
        case.compare_tensor(&name("latent"), latent);
        case.compare_tensor(&name("rgb"), rgb);
    }
}

fn compare_losses(case: &Case, step: usize, terms: &LossTerms) {
    let scalar = |value: &Tensor<1>| f64::from(value.clone().into_scalar::<f32>());
    case.compare_scalar(&format!("out.step{step}.loss"), scalar(&terms.total()));
    let names = [
        ("cosine_similarity_loss", "cosine"),
        ("scale_inv_loss", "scale_invariant"),
        ("multi_scale_derivative_loss", "mage"),
        ("kld_loss", "kld"),
    ];
    for (theirs, ours) in names {
        let value = terms.get(ours).unwrap_or_else(|| panic!("the loss has no term {ours}"));
        case.compare_scalar(&format!("out.step{step}.{theirs}"), scalar(value));
    }
}

/// Queries and keys get gradients of exactly zero; Adam leaves such weights where they were.
fn assert_frozen(case: &Case, keys: &[String], steps: usize) {
    for key in keys {
        for step in 1..=steps {
            if case.expects(&format!("after{step}.{key}")) {
                case.compare(&format!("after{step}.{key}"), case.data(&format!("param.{key}")));
            }
        }
    }
}
