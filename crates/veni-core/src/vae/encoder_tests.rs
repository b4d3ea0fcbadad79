//! Equivariance, options and gradients of the encoder.

use super::*;
use crate::nn::testing::{assert_gradients, features, rng};
use crate::vae::Veni;
use crate::vae::weights;
use burn::tensor::TensorData;
use veni_light::model::{DecoderConfig, ModelConfig, ModelInfo, VnReluForm};
use veni_light::sphere::Equirect;

const STRIPES: usize = 8;
const SAMPLES: usize = 16;

fn small() -> EncoderConfig {
    EncoderConfig {
        stripes: STRIPES,
        samples: Some(SAMPLES),
        channels: 12,
        depth: 2,
        heads: 2,
        head_channels: 6,
        feedforward: 2,
        ..EncoderConfig::default()
    }
}

/// Every option of the encoder once, the paper's ablations among them.
fn variants() -> Vec<(&'static str, EncoderConfig)> {
    use {Reduction::*, VectorLayer::*};
    vec![
        ("default", small()),
        ("early learned", EncoderConfig { reduction: EarlyLearned, ..small() }),
        ("late split", EncoderConfig { reduction: LateSplit, ..small() }),
        ("full SO(2)", EncoderConfig { transformer: So2, ..small() }),
        ("full VN", EncoderConfig { project_in: Vn, project_out: Vn, reduction: LateSplit, ..small() }),
        ("VN in", EncoderConfig { project_in: Vn, ..small() }),
        ("mean pooling", EncoderConfig { pooling: Pooling::Mean, ..small() }),
        ("fixed class token", EncoderConfig { learnable_cls: false, ..small() }),
        ("no patches", EncoderConfig { samples: None, ..small() }),
        ("not variational", EncoderConfig { variational: false, ..small() }),
        ("reference ReLU", EncoderConfig { vn_relu: VnReluForm::Reference, ..small() }),
    ]
}

/// A grid of whole meridians, `SAMPLES / 8` to a stripe, cell centres in azimuth and height: `[T, P, 3]`.
fn grid(device: &Device) -> Tensor<3> {
    let (per_stripe, heights) = (SAMPLES / 8, 8);
    let mut values = Vec::new();
    for stripe in 0..STRIPES {
        for meridian in 0..per_stripe {
            let azimuth = ((stripe * per_stripe + meridian) as f32 + 0.5) / (STRIPES * per_stripe) as f32;
            let (sin, cos) = (azimuth * std::f32::consts::TAU).sin_cos();
            for height in 0..heights {
                let z = 1.0 - (2 * height + 1) as f32 / heights as f32;
                let radius = (1.0 - z * z).sqrt();
                values.extend([radius * cos, radius * sin, z]);
            }
        }
    }
    Tensor::from_data(TensorData::new(values, [STRIPES, SAMPLES, 3]), device)
}

fn encoder(config: &EncoderConfig, device: &Device) -> Encoder {
    let mut encoder = Encoder::new(config, 5, &mut rng(1), device).unwrap();
    // The class token starts at zero; give it something to say.
    encoder.cls = encoder.cls.map(|cls| {
        let [invariants, channels] = cls.dims();
        cls.map(|t| features([1, 1, invariants, channels], 5, &t.device()).reshape([invariants, channels]))
    });
    encoder
}

/// Rotates vectors `[.., N, 3]` about z by `angle`.
fn rotate<const D: usize>(x: Tensor<D>, angle: f64) -> Tensor<D> {
    let (sin, cos) = (angle.sin() as f32, angle.cos() as f32);
    let matrix = Tensor::<2>::from_floats([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]], &x.device());
    let shape = x.shape();
    x.reshape([-1, 3]).matmul(matrix).reshape(shape)
}

/// max |a − b| / max |b|.
fn relative(a: &Tensor<3>, b: &Tensor<3>) -> f32 {
    let difference = (a.clone() - b.clone()).abs().max().into_scalar::<f32>();
    difference / b.clone().abs().max().into_scalar::<f32>()
}

#[test]
fn rotated_directions_rotate_the_latent() {
    let device = Device::flex();
    let radiance = features([2, STRIPES, SAMPLES, 3], 2, &device);
    for (name, config) in variants() {
        let encoder = encoder(&config, &device);
        let straight = encoder.forward(grid(&device), radiance.clone());
        let rotated = encoder.forward(rotate(grid(&device), 0.9), radiance.clone());
        let error = relative(&rotated.mean, &rotate(straight.mean.clone(), 0.9));
        assert!(error < 1e-5, "{name}: {error}");
        assert!(relative(&rotated.mean, &straight.mean) > 1e-3, "{name}: nothing rotated");
        if let (Some(a), Some(b)) = (&rotated.log_variance, &straight.log_variance) {
            assert!(relative(a, b) < 1e-5, "{name}: the variance is not invariant");
        }
        assert_eq!(straight.log_variance.is_some(), config.variational);
    }
}

#[test]
fn rolling_by_whole_stripes_rotates_the_latent() {
    let device = Device::flex();
    let radiance = features([2, STRIPES, SAMPLES, 3], 2, &device);
    for (name, config) in variants() {
        let encoder = encoder(&config, &device);
        let straight = encoder.forward(grid(&device), radiance.clone());
        for roll in [1, 3] {
            let rolled = encoder.forward(grid(&device), radiance.clone().roll_dim(roll as i64, 1));
            let angle = std::f64::consts::TAU * roll as f64 / STRIPES as f64;
            let error = relative(&rolled.mean, &rotate(straight.mean.clone(), angle));
            assert!(error < 1e-5, "{name}, {roll} stripes: {error}");
        }
    }
}

#[test]
fn mirrored_directions_mirror_the_latent() {
    let device = Device::flex();
    let radiance = features([2, STRIPES, SAMPLES, 3], 2, &device);
    let mirror = Tensor::<1>::from_floats([1.0, -1.0, 1.0], &device).reshape([1, 1, 3]);
    for (name, config) in variants() {
        let encoder = encoder(&config, &device);
        let straight = encoder.forward(grid(&device), radiance.clone());
        let mirrored = encoder.forward(grid(&device) * mirror.clone(), radiance.clone());
        let error = relative(&mirrored.mean, &(straight.mean * mirror.clone()));
        assert!(error < 1e-5, "{name}: {error}");
    }
}

#[test]
fn folding_and_own_directions_change_nothing() {
    let device = Device::flex();
    let radiance = features([2, STRIPES, SAMPLES, 3], 2, &device);
    for (name, config) in variants() {
        let encoder = encoder(&config, &device);
        let shared = encoder.forward(grid(&device), radiance.clone());
        let own =
            encoder.forward_per_image(grid(&device).unsqueeze::<4>().repeat_dim(0, 2), radiance.clone());
        let folded = encoder.fold().forward(grid(&device), radiance.clone());
        assert_eq!(relative(&own.mean, &shared.mean), 0.0, "{name}");
        assert!(relative(&folded.mean, &shared.mean) < 1e-5, "{name}");
    }
}

#[test]
fn weights_for_the_opposite_directions() {
    let device = Device::flex();
    let radiance = features([1, STRIPES, SAMPLES, 3], 2, &device);
    for (name, config) in variants() {
        let encoder = encoder(&config, &device);
        let straight = encoder.forward(grid(&device), radiance.clone());
        match encoder.for_negated_directions() {
            Ok(rewritten) => {
                let opposite = rewritten.forward(grid(&device).neg(), radiance.clone());
                assert_eq!(relative(&opposite.mean, &straight.mean), 0.0, "{name}");
            }
            Err(error) => {
                assert!(
                    config.project_in == VectorLayer::Vn && error.to_string().contains("negate"),
                    "{name}"
                );
            }
        }
    }
}

#[test]
fn gradients_of_every_variant() {
    let device = Device::flex().autodiff();
    let device_grid = grid(&device).narrow(0, 0, 2).narrow(1, 0, 2);
    for (_, config) in variants() {
        let samples = config.samples.map(|_| 2);
        let tiny = EncoderConfig { samples, channels: 2, heads: 1, head_channels: 2, depth: 1, ..config };
        let encoder = encoder(&tiny, &device);
        assert_gradients(encoder, features([1, 2, 2, 3], 3, &device), |encoder, radiance| {
            let directions = device_grid.clone().cast(radiance.dtype());
            let Posterior { mean, log_variance } = encoder.forward(directions, radiance);
            let parts = std::iter::once(mean).chain(log_variance).collect();
            Tensor::cat(parts, 2).unsqueeze()
        });
    }
}

/// What encodes for users is a second implementation, in plain f32.
#[test]
fn the_plain_encoder_is_this_one() {
    let device = Device::flex();
    let grid = Equirect::new(64, 32);
    let sky = |d: [f32; 3]| [2.0 * d[2] + d[0], (3.0 * d[1]).sin() + d[2], 3.0 * d[0] * d[2] - 0.5];
    let panorama: Vec<f32> = grid.directions().into_iter().flat_map(sky).collect();
    for (name, config) in variants() {
        let decoder = DecoderConfig { hidden: 16, layers: 1, ..DecoderConfig::default() };
        let whole = ModelConfig { decoder, encoder: Some(config.clone()), ..ModelConfig::decode_only(5) };
        let mut veni = Veni::new(&whole, &mut rng(1), &device).unwrap();
        veni.encoder = encoder(&config, &device);
        let ours = veni.encode(grid, &[&panorama]).unwrap().remove(0);
        let error = |veni: &Veni| {
            let model = veni.to_model(&whole, ModelInfo::default()).unwrap();
            let plain = veni_fit::Encoder::new(&model).unwrap().encode(grid, &[&panorama]).unwrap().remove(0);
            let variances = plain.log_variances.map(|l| l.into_iter().map(f32::exp).collect::<Vec<_>>());
            assert_eq!(variances.is_some(), ours.variances.is_some(), "{name}");
            let parts = [(plain.vectors.into_flattened(), ours.vectors.as_flattened())];
            let variances = variances.iter().cloned().zip(ours.variances.as_deref());
            parts.into_iter().chain(variances).map(|(a, b)| largest_error(&a, b)).fold(0f32, f32::max)
        };
        let same = error(&veni);
        assert!(same < 1e-5, "{name}: {same}");
        let mut moved = weights::read(&veni, "");
        let (_, weight) = moved.iter_mut().find(|(name, _)| name.starts_with("encoder.project_in")).unwrap();
        weight.data[0] += 0.1;
        let moved = error(&weights::write(veni.clone(), "", &moved).unwrap());
        assert!(moved > 1e-4, "{name}: one moved weight, and {moved}");
    }
}

/// max |a − b| / max |b|.
fn largest_error(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    let largest = |values: &mut dyn Iterator<Item = f32>| values.fold(0f32, |most, v| most.max(v.abs()));
    largest(&mut a.iter().zip(b).map(|(a, b)| a - b)) / largest(&mut b.iter().copied())
}

/// A class token without x and y meets norms at zero in the full SO(2) transformer, and a black stripe elsewhere.
#[test]
fn zeros_give_finite_gradients() {
    let device = Device::flex().autodiff();
    for (name, config) in variants() {
        let encoder = Encoder::new(&config, 5, &mut rng(1), &device).unwrap();
        let radiance = Tensor::<4>::zeros([1, STRIPES, SAMPLES, 3], &device).require_grad();
        let directions = Tensor::<3>::zeros([STRIPES, SAMPLES, 3], &device).require_grad();
        let Posterior { mean, log_variance } = encoder.forward(directions.clone(), radiance.clone());
        let mut loss = mean.sum();
        if let Some(log_variance) = log_variance {
            loss = loss + log_variance.sum();
        }
        assert!(loss.clone().into_scalar::<f32>().is_finite(), "{name}");
        let gradients = loss.backward();
        let by_radiance = radiance.grad(&gradients).unwrap();
        let by_direction = directions.grad(&gradients).unwrap();
        assert!(by_radiance.is_finite().all().into_scalar::<bool>(), "{name}");
        assert!(by_direction.is_finite().all().into_scalar::<bool>(), "{name}");
    }
}

#[test]
fn one_seed_one_encoder() {
    let device = Device::flex();
    let radiance = features([1, STRIPES, SAMPLES, 3], 2, &device);
    let mean = |seed| {
        let encoder = Encoder::new(&small(), 5, &mut rng(seed), &device).unwrap();
        encoder.forward(grid(&device), radiance.clone()).mean
    };
    assert_eq!(relative(&mean(3), &mean(3)), 0.0);
    assert!(relative(&mean(3), &mean(4)) > 0.1);
}

#[test]
fn impossible_configurations_are_refused() {
    let device = Device::flex();
    let message = |config: EncoderConfig| {
        Encoder::new(&config, 5, &mut rng(1), &device).expect_err("must be refused").to_string()
    };
    assert!(message(EncoderConfig { project_out: VectorLayer::Vn, ..small() }).contains("late-split"));
    let early = EncoderConfig { project_in: VectorLayer::Vn, reduction: Reduction::EarlyLearned, ..small() };
    assert!(message(early).contains("project_in"));
    assert!(message(EncoderConfig { heads: 0, ..small() }).contains("heads is 0"));
}

#[test]
fn the_papers_size_has_the_papers_parameters() {
    let device = Device::flex();
    for (latent_vectors, parameters) in [(9, 20_629_522), (100, 21_095_624)] {
        let encoder = Encoder::new(&EncoderConfig::default(), latent_vectors, &mut rng(1), &device).unwrap();
        assert_eq!(encoder.num_params(), parameters);
    }
}
