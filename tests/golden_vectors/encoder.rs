//! The VN-ViT encoder.
//!
//! The authors' `mirror` lives here and not in our encoder: "early" negates the x of the directions, "late"
//! negates the x of what comes out, once in training and (by a bug of theirs) twice, that is not at all, in
//! evaluation.

use crate::case::{Case, Data};
use crate::vectors::{Bindings, Kind, Linear, Transformer};
use crate::{Outcome, Outcome::Compared, Outcome::Skipped};
use burn::tensor::{Device, Gradients, Tensor};
use rand::SeedableRng;
use serde_json::Value;
use veni::model::{EncoderConfig, Pooling, Reduction, VectorLayer, VnReluForm};
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

/// The authors' encoder: our configuration of it, and where its weights are.
pub(crate) struct Official {
    config: EncoderConfig,
    latent_vectors: usize,
    /// "none", "early" or "late".
    mirror: String,
    bindings: Bindings,
}

impl Official {
    /// Reads the options in `options` (the authors' names); `prefix` stands before each key of the weights.
    pub(crate) fn new(case: &Case, options: &Value, prefix: &str) -> Self {
        let option = |key: &str| options.get(key).or_else(|| case.config.get(key)).unwrap_or(&Value::Null);
        let size = |key: &str| {
            option(key).as_u64().unwrap_or_else(|| panic!("the configuration has no size `{key}`")) as usize
        };
        let text = |key: &str, default: &'static str| option(key).as_str().unwrap_or(default).to_owned();
        let flag = |key: &str| option(key).as_bool().unwrap_or(true);
        let layer = |key: &str, default| match text(key, default).as_str() {
            "VN" => VectorLayer::Vn,
            "SOx" => VectorLayer::So2,
            other => panic!("{key} = {other:?} is neither VN nor SOx"),
        };
        let transformer = layer("transformer_type", "VN");
        let config = EncoderConfig {
            samples: option("patch_size").as_u64().map(|p| p as usize),
            channels: size("inner_dim"),
            depth: size("depth"),
            heads: size("heads"),
            head_channels: size("dim_head"),
            feedforward: option("ff_mult").as_u64().map_or(4, |m| m as usize),
            project_in: layer("project_in_type", "SOx"),
            transformer,
            project_out: layer("project_out_type", "SOx"),
            reduction: match text("reduce_feature_to_coord", "late_learned").as_str() {
                "early_learned" => Reduction::EarlyLearned,
                "late_split" => Reduction::LateSplit,
                "late_learned" => Reduction::LateLearned,
                other => panic!("reduce_feature_to_coord = {other:?} is unknown"),
            },
            pooling: match text("pooling", "cls").as_str() {
                "cls" => Pooling::Cls,
                "mean" => Pooling::Mean,
                other => panic!("pooling = {other:?} is unknown"),
            },
            learnable_cls: flag("learnable_cls"),
            variational: flag("variational"),
            // Each of the authors' files has its own guard.
            vn_relu: match transformer {
                VectorLayer::Vn => VnReluForm::Reference,
                VectorLayer::So2 => VnReluForm::ReferenceNormGuard,
            },
            ..EncoderConfig::default()
        };
        let latent_vectors = case.size("latent_dim").unwrap_or_else(|| {
            let field = case.config.get("field").and_then(|f| f.get("latent_dim")).and_then(Value::as_u64);
            field.expect("the configuration has no latent_dim") as usize
        });
        let bindings = bindings(&config, latent_vectors, prefix);
        Self { config, latent_vectors, mirror: text("mirror", "none"), bindings }
    }

    /// Our encoder with their weights.
    pub(crate) fn build(&self, case: &Case, device: &Device) -> Encoder {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(0);
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

fn bindings(config: &EncoderConfig, latent_vectors: usize, prefix: &str) -> Bindings {
    let channels = config.channels;
    let inner = if config.reduction == Reduction::EarlyLearned { 1 } else { 4 };
    let outer = if config.reduction == Reduction::LateSplit { inner } else { 1 };
    let mut all = Bindings::default();
    let into = Linear {
        layer: config.project_in,
        input: config.samples.unwrap_or(1),
        output: channels,
        invariants_in: 4,
        invariants_out: inner,
    };
    let out = Linear {
        layer: config.project_out,
        input: channels,
        output: latent_vectors,
        invariants_in: inner,
        invariants_out: outer,
    };
    all.linear(&format!("{prefix}vn_proj_in.1"), "project_in", into);
    all.linear(&format!("{prefix}project_out"), "project_out", out);
    if config.variational {
        all.linear(&format!("{prefix}project_out_logvar"), "project_log_variance", out);
    }
    if config.pooling == Pooling::Cls && config.learnable_cls {
        let shape = [1, 1, channels, inner];
        all.put(format!("{prefix}cls_inv"), &shape, &[channels, inner], &[1, 0], "cls".into());
    }
    let sizes = Transformer {
        depth: config.depth,
        channels,
        attention: config.heads * config.head_channels,
        feed_forward: channels * config.feedforward,
    };
    let kind = Kind { layer: config.transformer, invariants: inner };
    all.transformer(&format!("{prefix}encoder"), "transformer", sizes, kind);
    all
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

/// The authors' weights on their directions; and on clean directions, without a mirror, the weights they rewrote and
/// those we rewrite.
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

/// The authors' line sampling, `[T, P, 3]`: both ends of azimuth and of height are included.
fn line_directions(stripes: usize, samples: usize) -> Data {
    let heights = ((stripes * samples / 2) as f64).sqrt().round() as usize;
    let azimuths = 2 * heights;
    assert_eq!(heights * azimuths, stripes * samples, "{stripes} stripes of {samples} do not fill a grid");
    let linspace = |i: usize, n: usize| 2.0 * i as f64 / (n - 1) as f64 - 1.0;
    let values = (0..azimuths).flat_map(|a| {
        let (sin, cos) = (std::f64::consts::PI * linspace(a, azimuths)).sin_cos();
        (0..heights).flat_map(move |b| {
            let z = -linspace(b, heights);
            let radius = (1.0 - z * z).max(0.0).sqrt();
            [radius * cos, radius * sin, z].map(|v| v as f32)
        })
    });
    Data::new([stripes, samples, 3], values.collect())
}
