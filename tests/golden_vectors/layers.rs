//! Single layers: SO(2) linear, the Vector-Neuron layers, attention, feed-forward, transformer.

use crate::bindings::{Bindings, Kind, Linear, Transformer};
use crate::case::{Case, Data};
use crate::report::{Verdict, run_case};
use crate::vectors::{feature, official};
use crate::{Outcome, Outcome::Compared, Outcome::Skipped};
use burn::module::Module;
use burn::tensor::{Bool, Device, Tensor, TensorData};
use veni::model::{VectorLayer, VnReluForm};
use veni::nn::{
    So2LinearConfig, So2Relu, VectorAttentionConfig, VectorFeedForwardConfig, VectorTransformerConfig,
    VnInvariantConfig, VnLayerNormConfig, VnLinearConfig, VnReluConfig,
};
use veni::random::Stream;

/// See [`Family`](crate::Family).
pub(crate) fn run(case: &Case, device: &Device) -> Option<Outcome> {
    let layer: fn(&Case, &Device, VectorLayer) = match case.module() {
        "SOxLinear" => so2_linear,
        "VNLinear" => vn_linear,
        "VNReLU" => vn_relu,
        "SOxReLU" => so2_relu,
        "VNLayerNorm" => vn_layer_norm,
        "VNInvariant" => vn_invariant,
        "VNAttention" | "SOxAttention" => attention,
        "VNFeedForward" | "SOxFeedForward" => feed_forward,
        "VNTransformerEncoder" | "SOxTransformerEncoder" => transformer,
        _ => return None,
    };
    let other = [("eps", 1e-6), ("eps_norm", 1e-6), ("eps_ln", 1e-5)]
        .into_iter()
        .find(|&(key, ours)| case.number(key).is_some_and(|value| value != ours));
    if let Some((key, ours)) = other {
        return Some(Skipped(format!("{key} = {:?}: ours is {ours}", case.number(key))));
    }
    let kind = if case.module().starts_with("SOx") { VectorLayer::So2 } else { VectorLayer::Vn };
    layer(case, device, kind);
    Some(Compared)
}

fn rng() -> Stream {
    Stream::from_seed(0)
}

fn size(case: &Case, key: &str) -> usize {
    case.size(key).unwrap_or_else(|| panic!("the configuration has no size `{key}`"))
}

/// A list of axes in the configuration.
fn axes(case: &Case, key: &str) -> Option<Vec<usize>> {
    let list = case.config.get(key)?.as_array()?;
    Some(list.iter().map(|v| v.as_u64().expect("an axis") as usize).collect())
}

/// Equivariant axes, then invariant ones: the order of our coordinates. Without them, the natural order.
fn coordinate_axes(case: &Case, invariant: &str) -> Vec<usize> {
    match (axes(case, "equivariant_axes"), axes(case, invariant)) {
        (Some(equivariant), Some(invariant)) => [equivariant, invariant].concat(),
        _ => (0..coordinates(case)).collect(),
    }
}

fn coordinates(case: &Case) -> usize {
    *case.data("in.x").shape.last().expect("coordinates")
}

/// The sizes that all linear maps of the case share.
fn kind(case: &Case, layer: VectorLayer) -> Kind {
    Kind { layer, invariants: coordinates(case) - 2 }
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

/// Runs `module` with the case's weights and compares output and gradients.
fn compare<M: Module>(
    case: &Case,
    device: &Device,
    module: M,
    bindings: &Bindings,
    forward: impl Fn(&M, Tensor<4>) -> Tensor<4>,
) {
    let module = bindings.load(case, module);
    let input = case.data("in.x");
    let x = input.tensor::<4>(leading(&input.shape), device).require_grad();
    let y = forward(&module, feature(x.clone(), &coordinate_axes(case, "invariant_axes")));
    case.compare_tensor("out.y", &y);
    if let Some(probe) = case.get("probe.y") {
        let gradients = (y.clone() * probe.tensor(y.dims(), device)).sum().backward();
        if case.expects("grad.in.x") {
            case.compare_tensor("grad.in.x", &x.grad(&gradients).expect("a gradient of the input"));
        }
        bindings.compare_gradients(case, &module, &gradients);
    }
}

/// `[.., token, channel, coordinate]` with all leading axes made one.
fn leading(shape: &[usize]) -> [usize; 4] {
    let [lead @ .., tokens, channels, coordinates] = shape else {
        panic!("a vector feature of shape {shape:?}");
    };
    [lead.iter().product(), *tokens, *channels, *coordinates]
}

fn so2_linear(case: &Case, device: &Device, layer: VectorLayer) {
    let (input, output) = (size(case, "d_in"), size(case, "d_out"));
    let (invariants_in, invariants_out) = (size(case, "c_inv_in"), size(case, "c_inv_out"));
    let mut bindings = Bindings::default();
    bindings.linear("", "", Linear { layer, input, output, invariants_in, invariants_out });
    let module = So2LinearConfig { input, output, invariants_in, invariants_out }.init(&mut rng(), device);
    let out = coordinate_axes(case, "invariant_axes_out");
    compare(case, device, module, &bindings, |m, x| official(m.forward(x), &out));
}

fn vn_linear(case: &Case, device: &Device, layer: VectorLayer) {
    let (input, output) = (size(case, "d_in"), size(case, "d_out"));
    let bias_length = case.number("bias_epsilon").unwrap_or(0.0);
    let mut bindings = Bindings::default();
    bindings.linear("", "", Linear { layer, input, output, invariants_in: 0, invariants_out: 0 });
    if bias_length > 0.0 {
        bindings.vector("bias".into(), "bias".into(), output);
    }
    let module = VnLinearConfig { input, output, bias_length }.init(&mut rng(), device);
    compare(case, device, module, &bindings, |m, x| same(case, m.forward(x)));
}

/// Our output in the reference's order, with the coordinates of the input.
fn same(case: &Case, y: Tensor<4>) -> Tensor<4> {
    official(y, &coordinate_axes(case, "invariant_axes"))
}

fn vn_relu(case: &Case, device: &Device, layer: VectorLayer) {
    let config = VnReluConfig { channels: size(case, "dim"), form: form(case, layer) };
    let mut bindings = Bindings::default();
    bindings.relu("", "", config.channels);
    compare(case, device, config.init(&mut rng(), device), &bindings, |m, x| same(case, m.forward(x)));
}

fn so2_relu(case: &Case, device: &Device, layer: VectorLayer) {
    let config = VnReluConfig { channels: size(case, "dim"), form: form(case, layer) };
    let mut bindings = Bindings::default();
    bindings.relu("vn_relu", "vn", config.channels);
    let module = So2Relu::init(config, &mut rng(), device);
    compare(case, device, module, &bindings, |m, x| same(case, m.forward(x)));
}

fn vn_layer_norm(case: &Case, device: &Device, _: VectorLayer) {
    let config = VnLayerNormConfig { channels: size(case, "dim") };
    let mut bindings = Bindings::default();
    bindings.norm("", "", config.channels);
    compare(case, device, config.init(device), &bindings, |m, x| same(case, m.forward(x)));
}

fn vn_invariant(case: &Case, device: &Device, layer: VectorLayer) {
    let (channels, coordinates) = (size(case, "dim"), size(case, "dim_coor"));
    let config = VnInvariantConfig { channels, coordinates, form: form(case, layer) };
    let mut bindings = Bindings::default();
    bindings.matrix("mlp.0.weight".into(), "linear.weight".into(), channels, coordinates);
    bindings.relu("mlp.1", "relu", coordinates);
    compare(case, device, config.init(&mut rng(), device), &bindings, |m, x| {
        m.forward(x).unsqueeze_dim::<4>(2)
    });
}

fn attention(case: &Case, device: &Device, layer: VectorLayer) {
    let [channels, heads, head_channels] = ["dim", "heads", "dim_head"].map(|key| size(case, key));
    let config =
        VectorAttentionConfig { layer, channels, heads, head_channels, coordinates: coordinates(case) };
    let mut bindings = Bindings::default();
    bindings.attention("", "", channels, heads * head_channels, kind(case, layer));
    let keep = case.get("in.mask").map(|Data { shape, values }| {
        let keep: Vec<bool> = values.iter().map(|&v| v != 0.0).collect();
        Tensor::<2, Bool>::from_data(TensorData::new(keep, shape.clone()), device)
    });
    compare(case, device, config.init(&mut rng(), device), &bindings, |m, x| {
        same(case, m.forward(x, keep.clone()))
    });
}

fn feed_forward(case: &Case, device: &Device, layer: VectorLayer) {
    let [channels, expansion] = ["dim", "mult"].map(|key| size(case, key));
    let form = form(case, layer);
    let config = VectorFeedForwardConfig { layer, channels, expansion, coordinates: coordinates(case), form };
    let mut bindings = Bindings::default();
    bindings.feed_forward("", "", channels, channels * expansion, kind(case, layer));
    compare(case, device, config.init(&mut rng(), device), &bindings, |m, x| same(case, m.forward(x)));
}

fn transformer(case: &Case, device: &Device, layer: VectorLayer) {
    let [depth, channels, heads, head_channels, expansion] =
        ["depth", "dim", "heads", "dim_head", "ff_mult"].map(|key| size(case, key));
    let final_norm = case.config.get("final_norm").and_then(serde_json::Value::as_bool).unwrap_or(false);
    let config = VectorTransformerConfig {
        layer,
        depth,
        channels,
        heads,
        head_channels,
        expansion,
        coordinates: coordinates(case),
        form: form(case, layer),
        final_norm,
    };
    let sizes =
        Transformer { depth, channels, attention: heads * head_channels, feed_forward: channels * expansion };
    let mut bindings = Bindings::default();
    bindings.transformer("", "", sizes, kind(case, layer));
    if final_norm {
        bindings.norm("norm", "norm", channels);
    }
    compare(case, device, config.init(&mut rng(), device), &bindings, |m, x| same(case, m.forward(x)));
}

/// Every weight counts: with any one of them off by a thousandth of the largest, the case fails.
#[test]
fn a_perturbed_weight_is_noticed() {
    let device = Device::flex().autodiff();
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join("golden");
    for name in ["c02_vn_transformer_encoder", "c02_sox_feedforward"] {
        let case = || Case::load(&folder.join(name).with_extension("safetensors")).expect("a readable case");
        assert!(matches!(run_case(&case(), &device), Verdict::Passed(_)), "{name}");
        let weights: Vec<_> = case().tensors.into_keys().filter(|key| key.starts_with("param.")).collect();
        assert!(weights.len() > 7, "{name}: {weights:?}");
        for key in weights {
            let mut case = case();
            let values = &mut case.tensors.get_mut(&key).expect("just listed").values;
            let largest = values.iter().fold(1f32, |m, v| m.max(v.abs()));
            let middle = values.len() / 2;
            values[middle] += 1e-3 * largest;
            assert!(matches!(run_case(&case, &device), Verdict::Failed(_)), "{name}: {key} does not matter");
        }
    }
}
