//! The reference implementation's encoder: its options and keys against ours. Without burn, as [`case`](super::case).

use super::bindings::{Bindings, Kind, Linear, Transformer};
use super::case::{Case, Data};
use super::model::{EncoderConfig, Pooling, Reduction, VectorLayer, VnReluForm};
use serde_json::Value;

/// The reference implementation's encoder: our configuration of it, and where its weights are.
pub(crate) struct Official {
    pub(crate) config: EncoderConfig,
    pub(crate) latent_vectors: usize,
    /// "none", "early" or "late".
    pub(crate) mirror: String,
    pub(crate) bindings: Bindings,
}

impl Official {
    /// Reads the options in `options` (the reference's names); `prefix` stands before each key of the weights.
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
            // Each of the reference's files has its own guard.
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

/// The reference implementation's line sampling, `[T, P, 3]`: both ends of azimuth and of height are included.
pub(crate) fn line_directions(stripes: usize, samples: usize) -> Data {
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
