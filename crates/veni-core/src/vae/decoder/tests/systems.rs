//! The systems that the paper's network is compared with.

use super::*;
use crate::vae::decoder::TokenLayer;
use crate::vae::decoder::layer::perceptron;
use crate::vae::veni::model_of;
use burn::tensor::activation::softmax;
use veni_light::model::{
    Conditioning, Encoding, Equivariance, Invariance, Model, ModelConfig, ModelInfo, OutputForm,
};
use veni_light::random::{Purpose, Stream, stream};

const CONDITIONINGS: [Conditioning; 4] =
    [Conditioning::Attention, Conditioning::Film, Conditioning::Concat, Conditioning::Tokens];
const INVARIANCES: [Invariance; 2] = [Invariance::Vn, Invariance::GramMatrix];
const EQUIVARIANCES: [Equivariance; 3] = [Equivariance::So2, Equivariance::So3, Equivariance::None];

/// Every combination of the three.
fn systems() -> Vec<DecoderConfig> {
    let base = DecoderConfig {
        hidden: 16,
        layers: 2,
        heads: 2,
        // the true projection knows only the sign of U
        vn_relu: VnReluForm::Reference,
        // gentle: finite differences in f32 cannot follow a sine of 30 x, squared
        omega: 3.0,
        mapping_layers: 1,
        mapping_features: 8,
        ..DecoderConfig::default()
    };
    let mut all = Vec::new();
    for conditioning in CONDITIONINGS {
        for invariance in INVARIANCES {
            for equivariance in EQUIVARIANCES {
                let sines = matches!(conditioning, Conditioning::Film | Conditioning::Concat);
                let encoding = if sines { Encoding::None } else { Encoding::Directions };
                all.push(DecoderConfig { conditioning, invariance, equivariance, encoding, ..base.clone() });
            }
        }
    }
    all
}

fn build(config: &DecoderConfig, device: &Device) -> Decoder {
    Decoder::new(config, N, &mut Stream::from_seed(8), device)
}

fn name(config: &DecoderConfig) -> String {
    format!("{:?} {:?} {:?}", config.conditioning, config.invariance, config.equivariance)
}

#[test]
fn tensors_are_those_of_the_schema_and_come_back_from_a_model_file() {
    let device = Device::flex();
    let encodings = [Encoding::Directions, Encoding::Condition, Encoding::Both, Encoding::None];
    for config in systems() {
        for encoding in encodings {
            let decoder = DecoderConfig { encoding, ..config.clone() };
            let built = build(&decoder, &device);
            let weights = weights::read(&built, "decoder");
            let config = ModelConfig { decoder, ..ModelConfig::decode_only(N) };
            // refuses what the schema does not have
            let model = model_of(weights.clone(), &config, ModelInfo::default()).unwrap();
            let bytes = model.to_bytes(veni_light::model::StoredType::F32).unwrap();
            let model = Model::from_bytes(&bytes).unwrap();
            assert_eq!(model.config(), &config);
            assert!(weights.iter().all(|(name, w)| model.tensor(name).is_some_and(|t| t.data == w.data)));
            assert!(Model::filler(&config, 1).is_ok());
        }
    }
}

#[test]
fn each_keeps_the_symmetry_it_promises_and_no_more() {
    let device = Device::flex();
    let (s, c) = 0.7f32.sin_cos();
    let about_z = matrix([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]], &device);
    let about_x = matrix([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]], &device);
    for config in systems() {
        let decoder = build(&config, &device);
        let still = decoder.forward(latent(&device), directions(&device));
        let moves = |m: &Tensor<2>| {
            let rotated =
                decoder.forward(rotate(latent(&device), m.clone()), directions(&device).matmul(m.clone()));
            largest_difference(&still, &rotated)
        };
        let (z, x) = (moves(&about_z), moves(&about_x));
        let name = name(&config);
        match config.equivariance {
            Equivariance::So2 => assert!(z < 3e-5 && x > 1e-3, "{name}: {z} {x}"),
            Equivariance::So3 => assert!(z < 3e-5 && x < 3e-5, "{name}: {z} {x}"),
            Equivariance::None => assert!(z > 1e-3 && x > 1e-3, "{name}: {z} {x}"),
        }
    }
}

#[test]
fn images_of_a_batch_are_their_own() {
    let device = Device::flex();
    for config in systems() {
        let decoder = build(&config, &device);
        let both = decoder.forward(latent(&device), directions(&device));
        let second = decoder.forward(latent(&device).narrow(0, 1, 1), directions(&device));
        assert!(largest_difference(&both.narrow(0, 1, 1), &second) < 1e-5, "{}", name(&config));
    }
}

#[test]
fn gradients_agree_with_finite_differences() {
    let device = Device::flex().autodiff();
    for config in systems() {
        let decoder = build(&config, &device);
        let z = latent(&device).require_grad();
        let gradients = probe(decoder.forward(z.clone(), directions(&device))).backward();
        // along the sign pattern of the gradient, whose derivative is the gradient's 1-norm
        let mut checked: Vec<(String, f64, f64)> = Vec::new();
        let gradient = values(&z.grad(&gradients).unwrap());
        let at = |step: f32| {
            let moved =
                values(&latent(&device)).into_iter().zip(&gradient).map(|(v, g)| v + step * g.signum());
            let moved = TensorData::new(moved.collect::<Vec<_>>(), [2, N, 3]);
            probe_value(&decoder.forward(Tensor::from_data(moved, &device), directions(&device)))
        };
        let step = 2e-5;
        let norm = |g: &[f32]| g.iter().map(|g| f64::from(g.abs())).sum::<f64>();
        checked.push(("latent".into(), (at(step) - at(-step)) / f64::from(2.0 * step), norm(&gradient)));
        let base = weights::read(&decoder, "");
        let gradients = weights::gradients(&decoder, "", &gradients);
        // the other groups have the same weights
        let weights = base.iter().filter(|_| config.equivariance == Equivariance::So2);
        for (part, weight) in weights {
            let found =
                gradients.get(part).unwrap_or_else(|| panic!("{}: no gradient of {part}", name(&config)));
            let gradient = &found.data;
            let step = 1e-4 / (weight.data.len() as f32).sqrt();
            let at = |sign: f32| {
                let mut moved = base.clone();
                let data = &mut moved.get_mut(part).unwrap().data;
                data.iter_mut().zip(gradient).for_each(|(w, g)| *w += sign * step * g.signum());
                let decoder = weights::write(decoder.clone(), "", &moved).unwrap();
                probe_value(&decoder.forward(latent(&device), directions(&device)))
            };
            checked.push((part.clone(), (at(1.0) - at(-1.0)) / f64::from(2.0 * step), norm(gradient)));
        }
        for (part, found, expected) in checked {
            let allowed = 3e-2 * expected.max(1.0);
            assert!((found - expected).abs() < allowed, "{} {part}: {found} {expected}", name(&config));
        }
    }
}

#[test]
fn gradients_are_finite_at_latent_zero_everywhere() {
    let device = Device::flex().autodiff();
    for config in systems() {
        let decoder = build(&config, &device);
        let z = Tensor::<3>::zeros([1, N, 3], &device).require_grad();
        let gradients = probe(decoder.forward(z.clone(), directions(&device))).backward();
        let gradient = values(&z.grad(&gradients).unwrap());
        assert!(gradient.iter().all(|g| g.is_finite()), "{}", name(&config));
    }
}

/// The layer's attention as it is written in textbooks: queries, keys and values head by head, then the output map.
fn plain_attention(layer: &TokenLayer, x: Tensor<3>, tokens: Tensor<3>, heads: usize) -> Tensor<3> {
    let [batch, _, hidden] = x.dims();
    let width = hidden / heads;
    let [q, k, v] =
        [layer.query.forward(x.clone()), layer.key.forward(tokens.clone()), layer.value.forward(tokens)];
    let of = |y: &Tensor<3>, head: usize| {
        y.clone().slice([0..batch, 0..y.dims()[1], head * width..(head + 1) * width])
    };
    let each = (0..heads).map(|head| {
        let scores = of(&q, head).matmul(of(&k, head).swap_dims(1, 2)) / (width as f64).sqrt();
        softmax(scores, 2).matmul(of(&v, head))
    });
    layer.out.forward(Tensor::cat(each.collect(), 2))
}

#[test]
fn folded_attention_over_tokens_is_attention() {
    let device = Device::flex();
    let mut rng = stream(5, Purpose::Weights, 0, 0);
    let layer = TokenLayer::new(16, 4, &mut rng, &device);
    let wave = |rows: usize, pitch: f32| {
        let values: Vec<f32> = (0..2 * rows * 16).map(|i| (pitch * i as f32).sin()).collect();
        Tensor::<3>::from_data(TensorData::new(values, [2, rows, 16]), &device)
    };
    let (x, tokens) = (wave(3, 0.37), wave(5, 0.53));
    let folded = layer.forward(x.clone(), layer.remember(tokens.clone()));
    let written = |heads| {
        let attention = plain_attention(&layer, x.clone(), tokens.clone(), heads);
        perceptron(x.clone() + attention, &layer.norm1, &layer.ff1, &layer.ff2)
    };
    assert!(largest_difference(&folded, &written(4)) < 1e-5);
    // it would tell heads that were mixed up
    assert!(largest_difference(&folded, &written(2)) > 1e-3);
}

#[test]
fn every_token_has_its_say() {
    let device = Device::flex();
    let config = DecoderConfig {
        conditioning: Conditioning::Tokens,
        hidden: 16,
        heads: 2,
        layers: 1,
        ..DecoderConfig::default()
    };
    let decoder = build(&config, &device);
    let Layers::Tokens(layers) = &decoder.layers else { panic!("token layers") };
    let tokens = decoder
        .tokens
        .as_ref()
        .unwrap()
        .forward(decoder.condition.as_ref().unwrap().forward(latent(&device)));
    let x: Vec<f32> = (0..2 * 3 * 16).map(|i| (0.37 * i as f32).sin()).collect();
    let x = Tensor::<3>::from_data(TensorData::new(x, [2, 3, 16]), &device);
    let out = |tokens: Tensor<3>| layers[0].forward(x.clone(), layers[0].remember(tokens));
    let base = out(tokens.clone());
    for i in 0..N {
        let moved = tokens.clone().slice_assign([0..2, i..i + 1, 0..16], Tensor::zeros([2, 1, 16], &device));
        assert!(largest_difference(&base, &out(moved)) > 1e-3, "token {i}");
    }
    // attention does not know an order: that the bias of each token brings
    assert!(largest_difference(&base, &out(tokens.flip([1]))) < 1e-5);
    let [a, b] =
        [latent(&device), latent(&device).flip([1])].map(|z| decoder.forward(z, directions(&device)));
    assert!(largest_difference(&a, &b) > 1e-3);
}

#[test]
fn sines_start_with_activations_that_keep_their_size() {
    let device = Device::flex();
    for conditioning in [Conditioning::Film, Conditioning::Concat] {
        let invariance = Invariance::GramMatrix;
        let config = DecoderConfig { conditioning, invariance, ..DecoderConfig::reni_2022() };
        let deviation = |layers| {
            let decoder = build(&DecoderConfig { layers, ..config.clone() }, &device);
            let image = values(&decoder.forward(latent(&device), directions(&device)));
            let [least, most] = OutputForm::TANH_RANGE.map(|v| v as f32);
            // before the tanh
            let y: Vec<f32> =
                image.iter().map(|v| (2.0 * (v - least) / (most - least) - 1.0).atanh()).collect();
            let mean = y.iter().sum::<f32>() / y.len() as f32;
            (y.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / y.len() as f32).sqrt()
        };
        let (shallow, deep) = (deviation(1), deviation(6));
        assert!(deep > 0.3 * shallow && deep < 3.0 * shallow, "{conditioning:?}: {shallow} {deep}");
    }
}

#[test]
fn the_order_of_2022_is_a_permutation() {
    for conditioning in CONDITIONINGS {
        for equivariance in EQUIVARIANCES {
            let config = DecoderConfig { conditioning, equivariance, ..DecoderConfig::reni_2022() };
            let order = reni_2022_inputs(&config, N);
            let Some(mut order) = order else {
                assert!(matches!(conditioning, Conditioning::Attention | Conditioning::Tokens));
                continue;
            };
            order.sort_unstable();
            let rows = build(&config, &Device::flex()).input.weight.dims()[0];
            assert_eq!(order, (0..rows).collect::<Vec<_>>());
        }
    }
}
