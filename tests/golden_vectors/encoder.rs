//! The VN-ViT encoder.
//!
//! The reference implementation's `mirror` lives here and not in our encoder: "early" negates the x of the directions, "late"
//! negates the x of what comes out, once in training and (by a bug of theirs) twice, that is not at all, in
//! evaluation.

use crate::case::{Case, Data};
use crate::official::{Official, line_directions};
use crate::{Outcome, Outcome::Compared, Outcome::Skipped};
use burn::tensor::{Device, Gradients, Tensor};
use veni::random::Stream;
use veni::vae::Encoder;
use veni::vae::weights::Weights;

/// See [`Family`](crate::Family).
pub(crate) fn run(case: &Case, device: &Device) -> Option<Outcome> {
    if case.module() != "VENIEncoder" || !case.expects("out.mu") {
        return None;
    }
    if case.config.get("invariant_axes").is_some_and(|axes| *axes != serde_json::json!([2])) {
        return Some(Skipped("invariant_axes other than z".into()));
    }
    let official = Official::new(case, &case.config, "");
    if case.expects("in.clean_directions") {
        import(case, &official, device);
    } else {
        compare(case, &official, device);
    }
    Some(Compared)
}

impl Official {
    /// Our encoder with their weights.
    pub(crate) fn build(&self, case: &Case, device: &Device) -> Encoder {
        let mut rng = Stream::from_seed(0);
        let encoder = Encoder::new(&self.config, self.latent_vectors, &mut rng, device);
        self.bindings.load(case, encoder.unwrap_or_else(|e| panic!("{e}")))
    }

    /// Compares the gradients of the weights that the case records.
    pub(crate) fn compare_gradients(&self, case: &Case, encoder: &Encoder, gradients: &Gradients) {
        self.bindings.compare_gradients(case, encoder, gradients);
    }

    /// Compares our weights (or gradients) by our names with the records under `<record><key>`.
    pub(crate) fn compare_records(&self, case: &Case, record: &str, ours: &Weights) {
        self.bindings.compare_records(case, record, ours);
    }

    /// Directions as their network sees them.
    pub(crate) fn seen(&self, directions: Tensor<4>) -> Tensor<4> {
        if self.mirror == "early" { mirrored(directions) } else { directions }
    }
}

/// x negated.
fn mirrored<const D: usize>(vectors: Tensor<D>) -> Tensor<D> {
    let mut shape = [1; D];
    shape[D - 1] = 3;
    let signs = Tensor::<1>::from_floats([-1.0, 1.0, 1.0], &vectors.device()).reshape(shape);
    vectors * signs
}

/// `[T, P, 3]` or `[B, T, P, 3]` as `[B, T, P, 3]`; without patches `[T, 3]` or `[B, T, 3]` as `[B, T, 1, 3]`.
fn images(data: &Data, patches: bool, device: &Device) -> Tensor<4> {
    match (&data.shape[..], patches) {
        (&[b, t, p, 3], true) => data.tensor([b, t, p, 3], device),
        (&[t, p, 3], true) => data.tensor([1, t, p, 3], device),
        (&[b, t, 3], false) => data.tensor([b, t, 1, 3], device),
        (&[t, 3], false) => data.tensor([1, t, 1, 3], device),
        (shape, _) => panic!("{shape:?} is not a shape of directions or colours"),
    }
}

fn compare(case: &Case, official: &Official, device: &Device) {
    let encoder = official.build(case, device);
    let patches = official.config.samples.is_some();
    let colours = images(case.data("in.colors"), patches, device);
    let [batch, stripes, samples, _] = colours.dims();
    let directions = match case.get("in.directions") {
        Some(directions) => images(directions, patches, device),
        None => images(&line_directions(stripes, samples), true, device).repeat_dim(0, batch),
    };
    let (colours, directions) = (colours.require_grad(), directions.require_grad());
    let posterior = encoder.forward_per_image(official.seen(directions.clone()), colours.clone());
    let once = |v: Tensor<3>| if official.mirror == "late" { mirrored(v) } else { v };

    let mut loss = Vec::new();
    let mut output = |name: &str, value: &Tensor<3>| {
        if case.expects(&format!("out.{name}")) {
            case.compare_tensor(&format!("out.{name}"), value);
        }
        if let Some(probe) = case.get(&format!("probe.{name}")) {
            loss.push((value.clone() * probe.tensor(value.dims(), device)).sum());
        }
    };
    output("mu", &posterior.mean);
    output("eval_latent", &posterior.mean);
    if let Some(log_variance) = &posterior.log_variance {
        output("logvar", log_variance);
    }
    if let Some(noise) = case.get("in.eps") {
        output("train_mu", &once(posterior.mean.clone()));
        output("train_latent", &once(posterior.sample(noise.tensor(posterior.mean.dims(), device))));
    }
    let Some(loss) = loss.into_iter().reduce(|a, b| a + b) else { return };
    let gradients = loss.backward();
    for (name, input) in [("grad.in.colors", &colours), ("grad.in.directions", &directions)] {
        if case.expects(name) {
            case.compare_tensor(name, &input.grad(&gradients).expect("a gradient of the input"));
        }
    }
    official.compare_gradients(case, &encoder, &gradients);
}

/// The reference implementation's weights on their directions; and on clean directions, without a mirror, the weights
/// they rewrote and those we rewrite.
fn import(case: &Case, official: &Official, device: &Device) {
    let colours = images(case.data("in.colors"), true, device);
    let check = |encoder: &Encoder, directions: Tensor<4>| {
        let posterior = encoder.forward_per_image(directions, colours.clone());
        case.compare_tensor("out.mu", &posterior.mean);
        case.compare_tensor("out.logvar", &posterior.log_variance.expect("a log variance"));
    };
    let theirs = official.build(case, device);
    check(&theirs, official.seen(images(case.data("in.official_directions"), true, device)));

    let mut rewritten = case.clone_without_results();
    for (name, data) in case.tensors.iter().filter(|(name, _)| name.starts_with("clean.")) {
        rewritten.tensors.insert(name.replacen("clean.", "param.", 1), data.clone());
    }
    let clean = images(case.data("in.clean_directions"), true, device);
    check(&official.build(&rewritten, device), clean.clone());
    check(&theirs.for_negated_directions().unwrap_or_else(|e| panic!("{e}")), clean);
}
