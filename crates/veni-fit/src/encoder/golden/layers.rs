//! Single layers: linear maps, ReLU, layer norm, attention, feed-forward, transformer.

use veni_light::model::{EncoderConfig, VectorLayer, VnReluForm};

use super::bindings::{Bindings, Kind, Linear as Sizes, Transformer as TransformerSizes};
use super::case::{Case, Data};
use super::{Skipped, names, run, tensors};
use crate::encoder::attention::{self, Attention};
use crate::encoder::feed_forward::{self, FeedForward};
use crate::encoder::gate::{Gate, Place};
use crate::encoder::linear::{Feature, Linear, Prepared};
use crate::encoder::matrix::{Product, padded};
use crate::encoder::norm::AddNormalised;
use crate::encoder::transformer::{Buffers, Transformer};
use crate::encoder::weights::{Shape, Shapes, Tensors};

pub(super) fn compute(case: &Case) -> Result<(), Skipped> {
    let kind = if case.module().starts_with("SOx") { VectorLayer::So2 } else { VectorLayer::Vn };
    match case.module() {
        "SOxLinear" | "VNLinear" => linear(case, kind),
        "VNReLU" | "SOxReLU" => relu(case, kind),
        "VNLayerNorm" => norm(case),
        "VNAttention" | "SOxAttention" => attention(case, kind),
        "VNFeedForward" | "SOxFeedForward" => feed_forward(case, kind),
        "VNTransformerEncoder" | "SOxTransformerEncoder" => transformer(case, kind),
        "VNInvariant" => Err("a layer of the decoder"),
        _ => Err("no such layer"),
    }
}

fn size(case: &Case, key: &str) -> usize {
    case.size(key).unwrap_or_else(|| panic!("the configuration has no size `{key}`"))
}

fn coordinates(case: &Case) -> usize {
    *case.data("in.x").shape.last().expect("coordinates")
}

/// Equivariant axes, then invariant ones: the order of our coordinates. Without them, the natural order.
fn axes(case: &Case, invariant: &str) -> Vec<usize> {
    let list = |key: &str| {
        let axes = case.config.get(key)?.as_array()?;
        Some(axes.iter().map(|v| v.as_u64().expect("an axis") as usize).collect::<Vec<_>>())
    };
    match (list("equivariant_axes"), list(invariant)) {
        (Some(equivariant), Some(invariant)) => [equivariant, invariant].concat(),
        _ => (0..coordinates(case)).collect(),
    }
}

/// Which of the reference's packages a ReLU is from.
fn form(case: &Case, layer: VectorLayer) -> VnReluForm {
    let from = |key: &str, word: &str| case.text(key).is_some_and(|v| v.contains(word));
    let norm_guard = from("variant", "sox") || from("variant", "reni") || from("package", "reni");
    if norm_guard || layer == VectorLayer::So2 {
        VnReluForm::ReferenceNormGuard
    } else {
        VnReluForm::Reference
    }
}

/// Hands every image of `in.x`, in our order of axes, to `layer`, and compares its outputs of `channels` channels and
/// coordinates `out`, with `out.y`.
fn compare(case: &Case, out: &[usize], outputs: usize, layer: impl Fn(Feature<'_>) -> Vec<f32>) {
    let Data { shape, values } = case.data("in.x");
    let [.., tokens, channels, coordinates] = shape[..] else { panic!("a feature of shape {shape:?}") };
    let (order, width) = (axes(case, "invariant_axes"), padded(channels));
    let mut ours = Vec::new();
    for image in values.chunks_exact(tokens * channels * coordinates) {
        let mut data = vec![0.0; tokens * coordinates * width];
        let rows = data.chunks_exact_mut(width).enumerate();
        for (row, values) in rows {
            let (token, axis) = (row / coordinates, order[row % coordinates]);
            for (c, value) in values[..channels].iter_mut().enumerate() {
                *value = image[(token * channels + c) * coordinates + axis];
            }
        }
        let y = layer(Feature { data: &data, coordinates, channels, width });
        assert_eq!(y.len(), tokens * out.len() * padded(outputs), "the size of the output");
        for token in y.chunks_exact(out.len() * padded(outputs)) {
            for c in 0..outputs {
                let place = |axis| out.iter().position(|&o| o == axis).expect("axes are a permutation");
                ours.extend((0..out.len()).map(|axis| token[place(axis) * padded(outputs) + c]));
            }
        }
    }
    case.compare("out.y", &Data::new([ours.len()], ours));
}

fn linear(case: &Case, layer: VectorLayer) -> Result<(), Skipped> {
    if case.number("bias_epsilon").is_some_and(|length| length > 0.0) {
        return Err("a Vector-Neuron bias, which the encoder has not");
    }
    let (input, output) = (size(case, "d_in"), size(case, "d_out"));
    let (from, to) = match layer {
        VectorLayer::Vn => (coordinates(case), coordinates(case)),
        VectorLayer::So2 => (size(case, "c_inv_in") + 2, size(case, "c_inv_out") + 2),
    };
    let mut bindings = Bindings::default();
    let (invariants_in, invariants_out) = (from - 2, to - 2);
    bindings.linear("", "", Sizes { layer, input, output, invariants_in, invariants_out });
    let tensors = tensors(case, &bindings, "m");
    let shape = Shape { layer, inputs: input, outputs: output, from, to };
    let linear = Linear::new(Tensors(&tensors), &["m".to_owned()], shape, 1.0);
    compare(case, &axes(case, "invariant_axes_out"), output, |x| apply(&linear, x, to));
    Ok(())
}

fn apply(linear: &Linear, x: Feature<'_>, to: usize) -> Vec<f32> {
    let mut prepared = Prepared::default();
    prepared.prepare(linear.layer(), x);
    let mut y = vec![0.0; x.tokens() * to * linear.width()];
    linear.apply(&prepared, &mut y);
    y
}

/// The ReLU after an expansion that changes nothing; of an SO(2) feature, on x and y.
fn relu(case: &Case, layer: VectorLayer) -> Result<(), Skipped> {
    let channels = size(case, "dim");
    let mut bindings = Bindings::default();
    bindings.relu(if layer == VectorLayer::So2 { "vn_relu" } else { "" }, "", channels);
    let tensors = tensors(case, &bindings, "m");
    let mut identity = vec![0.0; channels * channels];
    identity.iter_mut().step_by(channels + 1).for_each(|v| *v = 1.0);
    let [w, u] = ["m.w", "m.u"].map(|name| &*tensors[name].data);
    let gate = Gate::fold(&identity, w, u, channels, form(case, layer));
    compare(case, &axes(case, "invariant_axes"), channels, |x| {
        let width = x.width;
        let gated = if layer == VectorLayer::So2 { 2 } else { x.coordinates };
        let mut y = vec![0.0; x.data.len()];
        let stride = x.coordinates * width;
        for (x, y) in x.data.chunks_exact(stride).zip(y.chunks_exact_mut(stride)) {
            let (data, rest) = x.split_at(gated * width);
            let mut prepared = Prepared::default();
            prepared.prepare(VectorLayer::Vn, Feature { data, coordinates: gated, channels, width });
            let (x, weight) = (&prepared.first, &gate.weights);
            let mut products = vec![0.0; gated * weight.outputs()];
            let (panels, row) = (0..weight.panels(), weight.outputs());
            Product { x, weight, panels, y: &mut products, stride: row, add: false }.run();
            gate.apply(&products, gated, y, Place { stride, width, at: 0, count: width });
            y[data.len()..].iter_mut().zip(rest).for_each(|(y, x)| *y = x.max(0.0));
        }
        y
    });
    Ok(())
}

fn norm(case: &Case) -> Result<(), Skipped> {
    let channels = size(case, "dim");
    let mut bindings = Bindings::default();
    bindings.norm("", "", channels);
    let mut gamma = tensors(case, &bindings, "m")["m.gamma"].data.clone();
    gamma.resize(padded(channels), 0.0);
    let same = axes(case, "invariant_axes");
    compare(case, &same, channels, |x| normalised(&gamma, x));
    Ok(())
}

fn normalised(gamma: &[f32], y: Feature<'_>) -> Vec<f32> {
    let mut x = vec![0.0; y.data.len()];
    let Feature { data, coordinates, channels, .. } = y;
    AddNormalised { x: &mut x, y: data, gamma, channels, coordinates, lengths: &mut Vec::new() }.run();
    x
}

/// Shapes of the case's transformer, or of its parts.
fn shapes(case: &Case, layer: VectorLayer, inner: usize, expansion: usize) -> Shapes {
    let (channels, from) = (size(case, "dim"), coordinates(case));
    let map = |inputs, outputs| Shape { layer, inputs, outputs, from, to: from };
    Shapes {
        project_in: map(channels, channels),
        into_heads: map(channels, inner),
        out_of_heads: map(inner, channels),
        expand: map(channels, channels * expansion),
        contract: map(channels * expansion, channels),
        project_out: map(channels, channels),
        inner: from,
    }
}

fn kind(case: &Case, layer: VectorLayer) -> Kind {
    Kind { layer, invariants: coordinates(case) - 2 }
}

fn attention(case: &Case, layer: VectorLayer) -> Result<(), Skipped> {
    if case.expects("in.mask") {
        return Err("a mask of tokens, which the encoder has not");
    }
    let [channels, heads, head] = ["dim", "heads", "dim_head"].map(|key| size(case, key));
    let mut bindings = Bindings::default();
    bindings.attention("", "", channels, heads * head, kind(case, layer));
    let tensors = tensors(case, &bindings, "m");
    let shapes = shapes(case, layer, heads * head, 1);
    let maps = [shapes.into_heads, shapes.out_of_heads];
    let attention = Attention::new(Tensors(&tensors), "m", maps, heads);
    compare(case, &axes(case, "invariant_axes"), channels, |x| {
        let query = apply(&attention.query, x, x.coordinates);
        let key_value = apply(&attention.key_value, x, x.coordinates);
        let each = x.tokens() * attention.seen_width();
        let mut seen = vec![0.0; heads * each];
        for (h, seen) in seen.chunks_exact_mut(each).enumerate() {
            attention.look(h, &query, &key_value, seen, &mut attention::Workspace::default());
        }
        let mut y = vec![0.0; x.data.len()];
        attention.gather(&seen, 0, &mut y, &mut Default::default());
        y
    });
    Ok(())
}

fn feed_forward(case: &Case, layer: VectorLayer) -> Result<(), Skipped> {
    let [channels, expansion] = ["dim", "mult"].map(|key| size(case, key));
    let mut bindings = Bindings::default();
    bindings.feed_forward("", "", channels, channels * expansion, kind(case, layer));
    let tensors = tensors(case, &bindings, "m");
    let shapes = shapes(case, layer, channels, expansion);
    let maps = [shapes.expand, shapes.contract];
    let block = FeedForward::new(Tensors(&tensors), "m", maps, form(case, layer));
    compare(case, &axes(case, "invariant_axes"), channels, |x| {
        let mut y = vec![0.0; x.data.len()];
        block.apply(x, &mut y, &mut feed_forward::Workspace::default());
        y
    });
    Ok(())
}

fn transformer(case: &Case, layer: VectorLayer) -> Result<(), Skipped> {
    let [depth, channels, heads, head_channels, feedforward] =
        ["depth", "dim", "heads", "dim_head", "ff_mult"].map(|key| size(case, key));
    let inner = heads * head_channels;
    let mut bindings = Bindings::default();
    let sizes = TransformerSizes { depth, channels, attention: inner, feed_forward: channels * feedforward };
    bindings.transformer("", "", sizes, kind(case, layer));
    let last_norm = case.config.get("final_norm").and_then(serde_json::Value::as_bool) == Some(true);
    if last_norm {
        bindings.norm("norm", "norm", channels);
    }
    let tensors = tensors(case, &bindings, "m");
    let vn_relu = form(case, layer);
    let config =
        EncoderConfig { depth, channels, heads, head_channels, feedforward, vn_relu, ..Default::default() };
    let shapes = shapes(case, layer, inner, feedforward);
    let transformer = Transformer::new(Tensors(&tensors), "m", &config, &shapes);
    compare(case, &axes(case, "invariant_axes"), channels, |x| {
        let mut buffers = Buffers::default();
        for workers in [1, 2] {
            buffers.x = x.data.to_vec();
            transformer.run(&mut buffers, false, workers);
        }
        if !last_norm {
            return buffers.x;
        }
        let mut gamma = tensors["m.norm.gamma"].data.clone();
        gamma.resize(padded(channels), 0.0);
        normalised(&gamma, Feature { data: &buffers.x, ..x })
    });
    Ok(())
}

#[test]
fn layers_of_the_reference() {
    let (passed, skipped) = run(&names(&["c01_", "c02_"]), compute);
    assert_eq!(passed.len(), 22, "{passed:#?} skipped: {skipped:#?}");
    assert_eq!(skipped.len(), 6, "{skipped:#?}");
}

/// Every weight counts: with any one of them off by a thousandth of the largest, the case fails.
#[test]
fn a_perturbed_weight_is_noticed() {
    for name in ["c02_vn_transformer_encoder", "c02_sox_feedforward"] {
        let case = super::load(name);
        let weights: Vec<_> = case.tensors.keys().filter(|key| key.starts_with("param.")).cloned().collect();
        assert!(weights.len() > 7, "{name}: {weights:?}");
        for key in weights.iter().filter(|key| !key.ends_with("beta")) {
            let mut case = case.clone_without_results();
            let values = &mut case.tensors.get_mut(key).expect("just listed").values;
            let largest = values.iter().fold(1f32, |m, v| m.max(v.abs()));
            let middle = values.len() / 2;
            values[middle] += 1e-3 * largest;
            compute(&case).expect("a layer that is known");
            assert!(!super::failures(&case).is_empty(), "{name}: {key} does not matter");
        }
    }
}
