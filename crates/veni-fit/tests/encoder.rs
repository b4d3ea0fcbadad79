//! Equivariance of every kind of encoder, what must not change its results, and what it refuses.

#[allow(dead_code, reason = "each user needs a part of it")]
mod common;

use std::f32::consts::TAU;

use common::{model, numbers};
use veni_fit::{Encoded, Encoder};
use veni_light::model::{EncoderConfig, Pooling, Reduction, VectorLayer, VnReluForm};
use veni_light::sphere::{Equirect, StripeSampling};

const STRIPES: usize = 8;
const SAMPLES: usize = 16;
const N: usize = 5;

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
        ("full SO(2), early", EncoderConfig { transformer: So2, reduction: EarlyLearned, ..small() }),
        ("full VN", EncoderConfig { project_in: Vn, project_out: Vn, reduction: LateSplit, ..small() }),
        ("VN in", EncoderConfig { project_in: Vn, ..small() }),
        ("mean pooling", EncoderConfig { pooling: Pooling::Mean, ..small() }),
        ("fixed class token", EncoderConfig { learnable_cls: false, ..small() }),
        ("no patches", EncoderConfig { samples: None, ..small() }),
        ("not variational", EncoderConfig { variational: false, ..small() }),
        ("reference ReLU", EncoderConfig { vn_relu: VnReluForm::Reference, ..small() }),
        ("norm guard", EncoderConfig { vn_relu: VnReluForm::ReferenceNormGuard, ..small() }),
        ("one block", EncoderConfig { depth: 1, ..small() }),
        ("uneven sizes", EncoderConfig { channels: 45, heads: 3, head_channels: 11, ..small() }),
    ]
}

fn encoder(config: &EncoderConfig) -> Encoder {
    Encoder::new(&model(config.clone(), N)).expect("a whole model")
}

/// The encoder's largest rotation that is exact is by whole stripes: 4 columns here.
const GRID: Equirect = Equirect { width: 32, height: 16 };

fn panorama(seed: u32) -> Vec<f32> {
    let mut number = numbers(seed);
    (0..3 * GRID.len()).map(|_| 3.0 * number()).collect()
}

/// Moved `columns` to the left: rotated about z by 2π · columns/W.
fn rolled(image: &[f32], columns: usize) -> Vec<f32> {
    let row = |row: &[f32]| [&row[3 * columns..], &row[..3 * columns]].concat();
    image.chunks_exact(3 * GRID.width).flat_map(row).collect()
}

fn rotated(vectors: &[[f32; 3]], angle: f32) -> Vec<[f32; 3]> {
    let (sin, cos) = angle.sin_cos();
    vectors.iter().map(|[x, y, z]| [cos * x - sin * y, sin * x + cos * y, *z]).collect()
}

/// max |a − b| / max |b|.
fn difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    let largest = b.iter().fold(0.0, |m: f32, v| m.max(v.abs()));
    a.iter().zip(b).fold(0.0, |m: f32, (a, b)| m.max((a - b).abs())) / largest
}

fn error(got: &Encoded, expected: &[[f32; 3]]) -> f32 {
    difference(got.vectors.as_flattened(), expected.as_flattened())
}

/// How far encoding a rolled panorama is from rotating the code.
fn equivariance(encoder: &Encoder, columns: usize) -> f32 {
    let image = panorama(2);
    let encode = |image: &[f32]| encoder.encode(GRID, &[image]).expect("a panorama").remove(0);
    let (straight, other) = (encode(&image), encode(&rolled(&image, columns)));
    let angle = TAU * columns as f32 / GRID.width as f32;
    if let (Some(a), Some(b)) = (&straight.log_variances, &other.log_variances) {
        let invariance = difference(b, a);
        return invariance.max(error(&other, &rotated(&straight.vectors, angle)));
    }
    error(&other, &rotated(&straight.vectors, angle))
}

#[test]
fn rolling_by_whole_stripes_rotates_the_latent() {
    for (name, config) in variants() {
        let encoder = encoder(&config);
        let columns = GRID.width / STRIPES;
        for stripes in [1, 3] {
            let error = equivariance(&encoder, stripes * columns);
            assert!(error < 1e-5, "{name}, {stripes} stripes: {error}");
        }
        assert!(equivariance(&encoder, 1) > 1e-4, "{name}: part of a stripe is not an exact rotation");
    }
}

/// The reference implementation's sampling sees one meridian twice and does not wrap the seam; the check above must notice.
#[test]
fn the_check_of_equivariance_can_fail() {
    let config = EncoderConfig { sampling: StripeSampling::Reference, ..small() };
    assert!(equivariance(&encoder(&config), GRID.width / STRIPES) > 1e-3);
}

#[test]
fn rotated_and_mirrored_directions_rotate_and_mirror_the_latent() {
    let mirror = |v: &[[f32; 3]]| v.iter().map(|[x, y, z]| [*x, -y, *z]).collect::<Vec<_>>();
    for (name, config) in variants() {
        let encoder = encoder(&config);
        let mut number = numbers(3);
        let count = STRIPES * SAMPLES;
        let mut vectors = || (0..count).map(|_| [number(), number(), number()]).collect::<Vec<_>>();
        let (directions, colours) = (vectors(), vectors());
        let encode = |directions: &[[f32; 3]]| {
            encoder.forward(directions, &[&colours]).expect("whole stripes").remove(0)
        };
        let straight = encode(&directions);
        assert_eq!(straight.vectors.len(), N);
        assert_eq!(straight.log_variances.is_some(), config.variational, "{name}");
        let other = encode(&rotated(&directions, 0.9));
        assert!(error(&other, &rotated(&straight.vectors, 0.9)) < 1e-5, "{name}");
        assert!(error(&other, &straight.vectors) > 1e-3, "{name}: nothing rotated");
        let other = encode(&mirror(&directions));
        assert!(error(&other, &mirror(&straight.vectors)) < 1e-5, "{name}");
    }
}

/// A class token without x and y meets norms at zero, and a black stripe elsewhere.
#[test]
fn zeros_give_finite_numbers() {
    for (name, config) in variants() {
        let zeros = vec![[0.0; 3]; STRIPES * SAMPLES];
        let encoded = encoder(&config).forward(&zeros, &[&zeros]).expect("whole stripes").remove(0);
        assert!(encoded.vectors.as_flattened().iter().all(|v| v.is_finite()), "{name}");
    }
}

#[test]
fn neither_company_nor_threads_change_a_bit() {
    let images: Vec<_> = (0..7).map(panorama).collect();
    let images: Vec<&[f32]> = images.iter().map(Vec::as_slice).collect();
    for (name, config) in variants() {
        let encoder = encoder(&config);
        let together = encoder.encode(GRID, &images).expect("panoramas");
        let one = || {
            let one = |image: &&[f32]| encoder.encode(GRID, &[image]).expect("a panorama").remove(0);
            images.iter().map(one).collect::<Vec<_>>()
        };
        assert_eq!(one(), together, "{name}");
        #[cfg(feature = "parallel")]
        for threads in [1, 3, 16] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            assert_eq!(pool.install(one), together, "{name} on {threads} threads");
        }
    }
}

#[test]
fn the_papers_size_has_the_papers_parameters() {
    for (n, parameters) in [(9, 20_629_522), (100, 21_095_624)] {
        let schema = veni_fit::encoder::encoder_schema(&common::config(EncoderConfig::default(), n));
        let schema = schema.expect("the paper's size");
        assert_eq!(schema.iter().map(|(_, s)| s.iter().product::<usize>()).sum::<usize>(), parameters);
    }
}
