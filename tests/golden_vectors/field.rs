//! The RENI++ field network: attention conditioning, Vector-Neuron invariance, SO(2).
//!
//! Options that our decoder does not have are brought about here: another axis is a permutation of the
//! coordinates, an output activation follows the decoder, a missing positional encoding is an input map
//! whose sine rows are zero, and an encoded conditioning goes into wider value maps.

use crate::case::{Case, Data};
use crate::{Outcome, Outcome::Compared, Outcome::Skipped};
use burn::tensor::{Device, Gradients, Tensor, activation};
use rand::SeedableRng;
use std::f32::consts::TAU;
use veni::model::{DecoderConfig, VnReluForm};
use veni::sphere::Equirect;
use veni::sphere::reference::decoder_directions;
use veni::vae::decoder::{Decoder, Linear, rotate};
use veni::vae::weights::{self, Weight, Weights};

/// See [`Family`](crate::Family).
pub(crate) fn run(case: &Case, device: &Device) -> Option<Outcome> {
    let kind = ["VENIField", "RENIField"].contains(&case.module());
    if !kind || !case.expects("out.rgb") {
        return None;
    }
    Some(unsupported(case).map_or_else(|| compare(case, device), Skipped))
}

/// Why our decoder cannot be this field, if it cannot.
pub(crate) fn unsupported(case: &Case) -> Option<String> {
    let only = |key: &str, ours: &[&str]| {
        let value = case.text(key).unwrap_or(ours[0]);
        (!ours.contains(&value)).then(|| format!("{key} = {value}: we build {}", ours.join(", ")))
    };
    only("conditioning", &["Attention"])
        .or_else(|| only("equivariance", &["SO2"]))
        .or_else(|| only("invariant_function", &["VN"]))
        .or_else(|| only("encoded_input", &["Directions", "Conditioning", "Both", "None"]))
        .or_else(|| only("positional_encoding", &["NeRF", "None"]))
        .or_else(|| only("output_activation", &["None", "sigmoid", "relu", "tanh", "exp"]))
        .or_else(|| only("axis_of_invariance", &["z", "x", "y"]))
        .or_else(|| {
            let old = case.config.get("old_implementation").and_then(serde_json::Value::as_bool);
            (old == Some(true)).then(|| "old_implementation: the RENI 2022 input layout".into())
        })
}

/// One of the field's parameters: the authors' key and shape, our name, whether ours is transposed.
struct Binding {
    key: String,
    shape: Vec<usize>,
    ours: String,
    transposed: bool,
}

/// What the authors' network has and ours, folded, has not: it must have no effect.
struct Dead {
    key: String,
}

/// Sizes of a field, from the configuration.
pub(crate) struct Sizes {
    pub(crate) n: usize,
    pub(crate) hidden: usize,
    pub(crate) layers: usize,
    /// Whether the directional input is encoded.
    encoded: bool,
    /// Whether the conditioning is.
    encoded_condition: bool,
}

impl Sizes {
    pub(crate) fn of(case: &Case) -> Self {
        let size =
            |key: &str| case.size(key).unwrap_or_else(|| panic!("the configuration has no size `{key}`"));
        let nerf = case.text("positional_encoding") != Some("None");
        let input = case.text("encoded_input").unwrap_or("Directions");
        Self {
            n: size("latent_dim"),
            hidden: size("hidden_features"),
            layers: size("num_attention_layers"),
            encoded: nerf && ["Directions", "Both"].contains(&input),
            encoded_condition: nerf && ["Conditioning", "Both"].contains(&input),
        }
    }

    fn bindings(&self) -> (Vec<Binding>, Vec<Dead>) {
        let (h, c) = (self.hidden, self.condition());
        let inputs = (self.n + 2) * if self.encoded { 5 } else { 1 };
        let (mut all, mut dead) = (Vec::new(), Vec::new());
        let mut put = |key: String, shape: Vec<usize>, ours: String, transposed: bool| {
            all.push(Binding { key, shape, ours, transposed });
        };
        put("vn_proj_in.1.weight".into(), vec![1, 1], "condition.scale".into(), false);
        put("vn_invar.mlp.0.weight".into(), vec![2, 1], "condition.linear".into(), true);
        put("vn_invar.mlp.1.W".into(), vec![2, 2], "condition.w".into(), true);
        put("vn_invar.mlp.1.U".into(), vec![2, 2], "condition.u".into(), true);
        let mut linear = |key: String, ours: String, from: usize, to: usize| {
            put(format!("{key}.weight"), vec![to, from], format!("{ours}.weight"), true);
            put(format!("{key}.bias"), vec![to], format!("{ours}.bias"), false);
        };
        linear("network.residual_projection".into(), "input".into(), inputs, h);
        linear("network.fc".into(), "output".into(), h, 3);
        for l in 0..self.layers {
            let (theirs, ours) = (format!("network.layers.{l}"), format!("layers.{l}"));
            linear(format!("{theirs}.mha.value"), format!("{ours}.value"), c, h);
            linear(format!("{theirs}.mha.fc_out"), format!("{ours}.out"), h, h);
            linear(format!("{theirs}.fc.0"), format!("{ours}.ff1"), h, h);
            linear(format!("{theirs}.fc.2"), format!("{ours}.ff2"), h, h);
        }
        for l in 0..self.layers {
            for norm in ["norm1", "norm2"] {
                for (theirs, ours) in [("weight", "gamma"), ("bias", "beta")] {
                    let key = format!("network.layers.{l}.{norm}.{theirs}");
                    put(key, vec![h], format!("layers.{l}.{norm}.{ours}"), false);
                }
            }
            for part in ["query.weight", "query.bias", "key.weight", "key.bias"] {
                dead.push(Dead { key: format!("network.layers.{l}.mha.{part}") });
            }
        }
        (all, dead)
    }

    /// Keys of the authors' weights that have no effect, under `prefix`.
    pub(crate) fn dead_keys(&self, prefix: &str) -> Vec<String> {
        self.bindings().1.into_iter().map(|dead| format!("{prefix}{}", dead.key)).collect()
    }

    /// Width of what the value maps read.
    fn condition(&self) -> usize {
        3 * self.n * if self.encoded_condition { 5 } else { 1 }
    }

    /// Rows of our input map that the authors' one has.
    fn used_rows(&self) -> std::ops::Range<usize> {
        let m = self.n + 2;
        if self.encoded { 0..5 * m } else { 4 * m..5 * m }
    }
}

/// The VN-ReLU of the authors' program that the case is from.
pub(crate) fn form(case: &Case) -> VnReluForm {
    if case.module().starts_with("RENI") { VnReluForm::ReferenceNormGuard } else { VnReluForm::Reference }
}

/// The authors' decoder with its weights, from `case` (parameters under `prefix` in front of each key).
pub(crate) fn build(case: &Case, prefix: &str, device: &Device) -> Decoder {
    let sizes = Sizes::of(case);
    let mut config = DecoderConfig { hidden: sizes.hidden, layers: sizes.layers, ..DecoderConfig::default() };
    config.vn_relu = form(case);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(0);
    let mut decoder = Decoder::new(&config, sizes.n, &mut rng, device);
    if sizes.encoded_condition {
        for layer in &mut decoder.layers {
            layer.value = Linear::new(sizes.condition(), sizes.hidden, &mut rng, device);
        }
    }
    let mut ours = weights::read(&decoder, "");
    for binding in sizes.bindings().0 {
        let key = format!("{prefix}{}", binding.key);
        let theirs =
            case.weight(&key, &binding.shape).unwrap_or_else(|| panic!("the case has no weight `{key}`"));
        let theirs = if binding.transposed { theirs.transposed() } else { theirs };
        let slot =
            ours.get_mut(&binding.ours).unwrap_or_else(|| panic!("our decoder has no {}", binding.ours));
        if binding.ours == "input.weight" {
            slot.data.fill(0.0);
            let rows = sizes.used_rows();
            slot.data[rows.start * sizes.hidden..rows.end * sizes.hidden].copy_from_slice(&theirs.values);
        } else {
            slot.data = theirs.values;
        }
    }
    weights::write(decoder, "", &ours).unwrap_or_else(|e| panic!("{e}"))
}

/// Compares the gradients of every parameter that the case records under `grad.param.<prefix><key>`.
pub(crate) fn compare_gradients(case: &Case, prefix: &str, decoder: &Decoder, gradients: &Gradients) {
    let ours = weights::gradients(decoder, "", gradients);
    compare_records(case, &Sizes::of(case), &format!("grad.param.{prefix}"), &ours);
}

/// Compares `ours` (by our names; absent: zeros) with what the case records under `<record><key>`. What ours
/// has not, a query or a key, can only be zero: as a gradient it is compared as such.
pub(crate) fn compare_records(case: &Case, sizes: &Sizes, record: &str, ours: &Weights) {
    let (bindings, dead) = sizes.bindings();
    for binding in bindings {
        let name = format!("{record}{}", binding.key);
        if !case.expects(&name) {
            continue;
        }
        let zero = || Weight { shape: vec![], data: vec![0.0; binding.shape.iter().product()] };
        let mut values = ours.get(&binding.ours).cloned().unwrap_or_else(zero);
        if binding.ours == "input.weight" {
            let rows = sizes.used_rows();
            values.data = values.data[rows.start * sizes.hidden..rows.end * sizes.hidden].to_vec();
        }
        let mut shape = binding.shape.clone();
        if binding.transposed {
            shape.reverse();
        }
        let values = Data::new(shape, values.data);
        case.compare(&name, &if binding.transposed { values.transposed() } else { values });
    }
    for Dead { key } in dead.into_iter().filter(|_| record.starts_with("grad.")) {
        let name = format!("{record}{key}");
        if let Some(golden) = case.get(&name) {
            case.compare(&name, &Data::new(golden.shape.clone(), vec![0.0; golden.values.len()]));
        }
    }
}

/// Log radiance [B, R, 3] for latents and directions in the authors' axes, before the output activation.
fn decode(case: &Case, decoder: &Decoder, latent: Tensor<3>, directions: Tensor<2>) -> Tensor<3> {
    let (latent, directions) = (to_our_axis(case, latent), to_our_axis(case, directions));
    if !Sizes::of(case).encoded_condition {
        return decoder.forward(latent, directions);
    }
    let x = decoder.condition.forward(latent.clone());
    let [batch, width] = x.dims();
    let frequencies = Tensor::<3>::from_floats([[[1.0, 4.0]]], &x.device()) * TAU;
    let turns = (x.clone().unsqueeze_dim::<3>(2) * frequencies).reshape([batch, 2 * width]);
    let condition = Tensor::cat(vec![turns.clone().sin(), turns.cos(), x], 1);
    decoder.forward_conditioned(latent, condition, directions.unsqueeze())
}

/// Coordinates so that the equivariant pair comes first and the axis last: their axis becomes our z.
fn to_our_axis<const D: usize>(case: &Case, vectors: Tensor<D>) -> Tensor<D> {
    let order = match case.text("axis_of_invariance").unwrap_or("z") {
        "x" => [1, 2, 0],
        "y" => [0, 2, 1],
        _ => return vectors,
    };
    Tensor::cat(order.map(|c| vectors.clone().narrow(D - 1, c, 1)).to_vec(), D - 1)
}

fn activate(case: &Case, x: Tensor<3>) -> Tensor<3> {
    match case.text("output_activation") {
        Some("sigmoid") => activation::sigmoid(x),
        Some("relu") => activation::relu(x),
        Some("tanh") => activation::tanh(x),
        Some("exp") => x.exp(),
        _ => x,
    }
}

/// The case that holds the weights, if it is not `case` itself; the error says why there is none.
pub(crate) fn companion(case: &Case) -> Result<Option<Case>, String> {
    if case.get("param.network.fc.bias").is_some() || case.config.get("filler_seed").is_some() {
        return Ok(None);
    }
    let note = case.text("note").unwrap_or_default();
    let named = note.split("params: see ").nth(1).map(|s| s.split([';', ' ', ',']).next().unwrap_or(s));
    let name = named.ok_or("no weights, and no note where they are")?;
    let found = case.sibling(name).map(Some);
    found.ok_or_else(|| format!("its weights are in {name}, which is not in this folder"))
}

fn compare(case: &Case, device: &Device) -> Outcome {
    let companion = match companion(case) {
        Ok(companion) => companion,
        Err(reason) => return Skipped(reason),
    };
    let source = companion.as_ref().unwrap_or(case);
    let decoder = build(source, "", device);

    let latent = case.tensor::<3>("in.latent", device).require_grad();
    let used = match case.get("in.rotation") {
        Some(rotation) => rotate(latent.clone(), rotation.tensor([3, 3], device)),
        None => latent.clone(),
    };
    let [batch, _, _] = used.dims();
    let directions = match case.get("in.directions") {
        Some(d) => d.tensor([d.values.len() / 3, 3], device),
        None => map_directions(&case.data("out.rgb").shape, device),
    };
    let rays = directions.dims()[0];
    let raw = decode(case, &decoder, used, directions);
    let scale = ["scale_per_ray", "scale"].into_iter().find(|n| case.expects(&format!("in.{n}")));
    let scale = scale.map(|name| {
        let data = case.data(&format!("in.{name}"));
        // One number per ray, or one per image (then possibly a single one).
        let shape = if name == "scale" { [data.values.len(), 1] } else { [data.values.len() / rays, rays] };
        (name, data.tensor::<2>(shape, device).require_grad())
    });
    let rgb = match &scale {
        Some((_, scale)) => raw + scale.clone().unsqueeze_dim::<3>(2),
        None => raw,
    };
    let rgb = activate(case, rgb);
    assert_eq!(rgb.dims(), [batch, rays, 3]);
    case.compare_tensor("out.rgb", &rgb);

    if let Some(probe) = case.get("probe.rgb") {
        let gradients = (rgb * probe.tensor([batch, rays, 3], device)).sum().backward();
        if case.expects("grad.in.latent") {
            case.compare_tensor(
                "grad.in.latent",
                &latent.grad(&gradients).expect("a gradient of the latent"),
            );
        }
        if let Some((name, scale)) = &scale {
            let name = format!("grad.in.{name}");
            if case.expects(&name) {
                case.compare_tensor(&name, &scale.grad(&gradients).expect("a gradient of the scale"));
            }
        }
        compare_gradients(case, "", &decoder, &gradients);
    }
    for (output, input) in [("out.image", "in.latent"), ("out.ae_image", "in.ae_latent")] {
        if case.expects(output) {
            let directions = map_directions(&case.data(output).shape, device);
            let image = activate(case, decode(case, &decoder, case.tensor(input, device), directions));
            case.compare_tensor(output, &image);
        }
    }
    Compared
}

/// Pixel-centre directions of a map [H, W, 3] in the authors' decoder frame, rounded as theirs.
pub(crate) fn map_directions(shape: &[usize], device: &Device) -> Tensor<2> {
    let [height, width, 3] = shape[..] else { panic!("{shape:?} is not the shape of a map") };
    let grid = Equirect::new(width, height);
    Data::new([grid.len(), 3], decoder_directions(grid).into_flattened()).tensor([grid.len(), 3], device)
}
