//! The field networks: the paper's, and those it is compared with.
//!
//! Options that our decoder does not have are brought about here: another axis is a permutation of the
//! coordinates, and most output activations follow the decoder.

use crate::case::{Case, Data};
use crate::{Outcome, Outcome::Compared, Outcome::Skipped};
use burn::tensor::{Device, Gradients, Tensor, activation};
use veni::model::{
    Array, Conditioning, DecoderConfig, Encoding, Equivariance, Invariance, OutputForm, VnReluForm,
};
use veni::random::Stream;
use veni::sphere::Equirect;
use veni::sphere::reference::decoder_directions;
use veni::vae::decoder::{Decoder, reni_2022_inputs, rotate};
use veni::vae::weights::{self, Weights};

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
    only("conditioning", &["Attention", "FiLM", "Concat"])
        .or_else(|| only("equivariance", &["SO2", "SO3", "None"]))
        .or_else(|| only("invariant_function", &["VN", "GramMatrix"]))
        .or_else(|| only("encoded_input", &["Directions", "Conditioning", "Both", "None"]))
        .or_else(|| only("positional_encoding", &["NeRF", "None"]))
        .or_else(|| only("output_activation", &["None", "sigmoid", "relu", "tanh", "exp"]))
        .or_else(|| only("axis_of_invariance", &["z", "x", "y"]))
}

/// Whether the inputs come in the order of RENI (2022).
fn is_reni_2022(case: &Case) -> bool {
    case.config.get("old_implementation").and_then(serde_json::Value::as_bool) == Some(true)
}

/// One of the field's parameters: the reference's key and shape, our name, whether ours is transposed.
struct Binding {
    key: String,
    shape: Vec<usize>,
    ours: String,
    transposed: bool,
}

/// What the reference's network has and ours has not: it must have no effect.
struct Dead {
    key: String,
}

/// A field, from the configuration of its case.
pub(crate) struct Sizes {
    pub(crate) n: usize,
    pub(crate) config: DecoderConfig,
    /// Which of our inputs each of theirs is, where that is not the same one.
    inputs: Option<Vec<usize>>,
}

impl Sizes {
    pub(crate) fn of(case: &Case) -> Self {
        let size =
            |key: &str| case.size(key).unwrap_or_else(|| panic!("the configuration has no size `{key}`"));
        let nerf = case.text("positional_encoding") != Some("None");
        let conditioning = match case.text("conditioning") {
            Some("Concat") => Conditioning::Concat,
            Some("FiLM") => Conditioning::Film,
            _ => Conditioning::Attention,
        };
        let default = DecoderConfig::default();
        let sine = case.config.get("last_layer_linear").and_then(serde_json::Value::as_bool) == Some(false);
        let config = DecoderConfig {
            hidden: size("hidden_features"),
            layers: match conditioning {
                Conditioning::Concat => size("hidden_layers"),
                // their input map counts as one
                Conditioning::Film => size("hidden_layers") - 1,
                _ => size("num_attention_layers"),
            },
            vn_relu: form(case),
            conditioning,
            invariance: match case.text("invariant_function") {
                Some("GramMatrix") => Invariance::GramMatrix,
                _ => Invariance::Vn,
            },
            equivariance: match case.text("equivariance") {
                Some("SO3") => Equivariance::So3,
                Some("None") => Equivariance::None,
                _ => Equivariance::So2,
            },
            encoding: match case.text("encoded_input").unwrap_or("Directions") {
                "Directions" if nerf => Encoding::Directions,
                "Conditioning" if nerf => Encoding::Condition,
                "Both" if nerf => Encoding::Both,
                _ => Encoding::None,
            },
            output: match case.text("output_activation") {
                Some("tanh") => OutputForm::Tanh,
                _ if sine && conditioning == Conditioning::Concat => OutputForm::Sine,
                _ => OutputForm::Linear,
            },
            mapping_layers: case.size("mapping_layers").unwrap_or(default.mapping_layers),
            mapping_features: case.size("mapping_features").unwrap_or(default.mapping_features),
            ..default
        };
        let n = size("latent_dim");
        let old = || reni_2022_inputs(&config, n).expect("RENI (2022) has this network");
        Self { n, inputs: is_reni_2022(case).then(old), config }
    }

    fn bindings(&self) -> (Vec<Binding>, Vec<Dead>) {
        let (n, h, layers) = (self.n, self.config.hidden, self.config.layers);
        let (directional, conditional) = (self.config.direction_inputs(n), self.config.condition_inputs(n));
        let (mut all, mut dead) = (Vec::new(), Vec::new());
        let vn = [
            ("vn_proj_in.1.weight", "scale", [1, 1], false),
            ("vn_invar.mlp.0.weight", "linear", [0, 1], true),
            ("vn_invar.mlp.1.W", "w", [0, 0], true),
            ("vn_invar.mlp.1.U", "u", [0, 0], true),
        ];
        for (key, ours, shape, transposed) in vn {
            let Some(c) = self.config.vn_channels() else {
                dead.push(Dead { key: key.into() });
                continue;
            };
            let shape = shape.iter().map(|s| if *s == 0 { c } else { *s }).collect();
            all.push(Binding { key: key.into(), shape, ours: format!("condition.{ours}"), transposed });
        }
        let mut linear = |key: String, ours: String, from: usize, to: usize| {
            let (weight, bias) = (format!("{ours}.weight"), format!("{ours}.bias"));
            let shape = vec![to, from];
            all.push(Binding { key: format!("network.{key}.weight"), shape, ours: weight, transposed: true });
            let shape = vec![to];
            all.push(Binding { key: format!("network.{key}.bias"), shape, ours: bias, transposed: false });
        };
        match self.config.conditioning {
            Conditioning::Concat => {
                linear("net.0.linear".into(), "input".into(), directional + conditional, h);
                for l in 0..layers {
                    linear(format!("net.{}.linear", l + 1), format!("layers.{l}"), h, h);
                }
                let last = if self.config.output == OutputForm::Sine { ".linear" } else { "" };
                linear(format!("net.{}{last}", layers + 1), "output".into(), h, 3);
            }
            Conditioning::Film => {
                let (count, width) = (self.config.mapping_layers, self.config.mapping_features);
                for k in 0..=count {
                    let (from, to) = (
                        if k == 0 { conditional } else { width },
                        if k == count { 2 * h * (layers + 1) } else { width },
                    );
                    let key = format!("mapping_network.network.{}", 2 * k);
                    linear(key, format!("mapping.{k}"), from, to);
                }
                linear("net.0.layer".into(), "input".into(), directional, h);
                for l in 0..layers {
                    linear(format!("net.{}.layer", l + 1), format!("layers.{l}"), h, h);
                }
                linear("final_layer".into(), "output".into(), h, 3);
            }
            _ => {
                linear("residual_projection".into(), "input".into(), directional, h);
                linear("fc".into(), "output".into(), h, 3);
                for l in 0..layers {
                    let (theirs, ours) = (format!("layers.{l}"), format!("layers.{l}"));
                    linear(format!("{theirs}.mha.value"), format!("{ours}.value"), conditional, h);
                    linear(format!("{theirs}.mha.fc_out"), format!("{ours}.out"), h, h);
                    linear(format!("{theirs}.fc.0"), format!("{ours}.ff1"), h, h);
                    linear(format!("{theirs}.fc.2"), format!("{ours}.ff2"), h, h);
                }
                for l in 0..layers {
                    for norm in ["norm1", "norm2"] {
                        for (theirs, ours) in [("weight", "gamma"), ("bias", "beta")] {
                            let key = format!("network.layers.{l}.{norm}.{theirs}");
                            let ours = format!("layers.{l}.{norm}.{ours}");
                            all.push(Binding { key, shape: vec![h], ours, transposed: false });
                        }
                    }
                    for part in ["query.weight", "query.bias", "key.weight", "key.bias"] {
                        dead.push(Dead { key: format!("network.layers.{l}.mha.{part}") });
                    }
                }
            }
        }
        (all, dead)
    }

    /// Keys of the reference's weights that have no effect, under `prefix`.
    pub(crate) fn dead_keys(&self, prefix: &str) -> Vec<String> {
        self.bindings().1.into_iter().map(|dead| format!("{prefix}{}", dead.key)).collect()
    }

    /// Our rows of a map in the reference's order, or theirs in ours: one row per input.
    fn reorder(&self, binding: &Binding, values: Vec<f32>, to_ours: bool) -> Vec<f32> {
        let Some(inputs) = self.inputs.as_ref().filter(|_| binding.ours == "input.weight") else {
            return values;
        };
        let h = self.config.hidden;
        let mut out = vec![0.0; values.len()];
        for (theirs, ours) in inputs.iter().enumerate() {
            let (from, to) = if to_ours { (theirs, *ours) } else { (*ours, theirs) };
            out[to * h..(to + 1) * h].copy_from_slice(&values[from * h..(from + 1) * h]);
        }
        out
    }
}

/// The VN-ReLU of the reference implementation that the case is from.
pub(crate) fn form(case: &Case) -> VnReluForm {
    if case.module().starts_with("RENI") { VnReluForm::ReferenceNormGuard } else { VnReluForm::Reference }
}

/// The reference implementation's decoder with its weights, from `case` (parameters under `prefix` in front of each key).
pub(crate) fn build(case: &Case, prefix: &str, device: &Device) -> Decoder {
    let sizes = Sizes::of(case);
    let mut rng = Stream::from_seed(0);
    let decoder = Decoder::new(&sizes.config, sizes.n, &mut rng, device);
    let mut ours = weights::read(&decoder, "");
    for binding in sizes.bindings().0 {
        let key = format!("{prefix}{}", binding.key);
        let theirs =
            case.weight(&key, &binding.shape).unwrap_or_else(|| panic!("the case has no weight `{key}`"));
        let theirs = if binding.transposed { theirs.transposed() } else { theirs };
        let slot =
            ours.get_mut(&binding.ours).unwrap_or_else(|| panic!("our decoder has no {}", binding.ours));
        slot.data = sizes.reorder(&binding, theirs.values, true);
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
        let zero = || Array { shape: vec![], data: vec![0.0; binding.shape.iter().product()] };
        let mut values = ours.get(&binding.ours).cloned().unwrap_or_else(zero);
        values.data = sizes.reorder(&binding, values.data, false);
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

/// Log radiance [B, R, 3] for latents and directions in the reference's axes, before the output activation.
fn decode(case: &Case, decoder: &Decoder, latent: Tensor<3>, directions: Tensor<2>) -> Tensor<3> {
    // RENI (2022) inside RENI++ swaps the directions' y and z, which have their axis z then
    let directions = if is_reni_2022(case) { directions } else { to_our_axis(case, directions) };
    decoder.forward(to_our_axis(case, latent), directions)
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
        // their output is the tanh itself, ours its de-normalised value
        Some("tanh") => {
            let [least, most] = OutputForm::TANH_RANGE;
            (x - least) * (2.0 / (most - least)) - 1.0
        }
        Some("exp") => x.exp(),
        _ => x,
    }
}

/// The case that holds the weights, if it is not `case` itself; the error says why there is none.
pub(crate) fn companion(case: &Case) -> Result<Option<Case>, String> {
    let own = ["fc", "final_layer", "net.0.linear"].map(|map| format!("param.network.{map}.bias"));
    if own.iter().any(|bias| case.get(bias).is_some()) || case.config.get("filler_seed").is_some() {
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

/// Pixel-centre directions of a map [H, W, 3] in the reference's decoder frame, rounded as theirs.
pub(crate) fn map_directions(shape: &[usize], device: &Device) -> Tensor<2> {
    let [height, width, 3] = shape[..] else { panic!("{shape:?} is not the shape of a map") };
    let grid = Equirect::new(width, height);
    Data::new([grid.len(), 3], decoder_directions(grid).into_flattened()).tensor([grid.len(), 3], device)
}
