//! The whole model is equivariant: a panorama rotated by whole stripes gives the rotated latent, and that the
//! rotated picture. On a real panorama, with the shipped sizes of sampling and random weights.

use std::f64::consts::TAU;
use std::path::Path;
use veni_light::random::Stream;

use burn::tensor::Device;

use super::Veni;
use veni_data::augment::{mirror, rotate_columns};
use veni_data::{Dataset, panorama_files};
use veni_light::latent::Latent;
use veni_light::model::{DecoderConfig, EncoderConfig, ModelConfig};
use veni_light::sphere::Equirect;

const STRIPES: usize = 32;

struct Setup {
    veni: Veni,
    grid: Equirect,
    images: Vec<Vec<f32>>,
}

impl Setup {
    fn new() -> Self {
        let encoder = EncoderConfig {
            stripes: STRIPES,
            samples: Some(64),
            channels: 24,
            depth: 2,
            heads: 2,
            head_channels: 12,
            ..EncoderConfig::default()
        };
        let config = ModelConfig {
            decoder: DecoderConfig { hidden: 32, layers: 2, ..DecoderConfig::default() },
            encoder: Some(encoder),
            ..ModelConfig::decode_only(9)
        };
        let veni = Veni::new(&config, &mut Stream::from_seed(5), &Device::flex()).unwrap();
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/panoramas/val");
        let grid = Equirect::new(128, 64);
        let set = Dataset::load(&panorama_files(&folder, &veni_light::progress::Silent).unwrap()[..2], grid)
            .unwrap();
        let images = set.items().iter().map(|item| item.log_radiance.to_vec()).collect();
        Self { veni, grid, images }
    }

    fn encode(&self, change: impl Fn(&mut [f32])) -> Vec<Latent> {
        let mut images = self.images.clone();
        images.iter_mut().for_each(|image| change(image));
        let images: Vec<_> = images.iter().map(Vec::as_slice).collect();
        let encoded = self.veni.encode(self.grid, &images).unwrap();
        encoded.into_iter().map(|e| Latent::new(e.vectors)).collect()
    }

    fn decode(&self, latents: &[Latent]) -> Vec<Vec<f32>> {
        let vectors: Vec<_> = latents.iter().map(|z| z.vectors.clone()).collect();
        self.veni.decode(self.grid, &vectors)
    }

    /// The angle of a roll of the picture to the right.
    fn angle(&self, columns: usize) -> f64 {
        -TAU * columns as f64 / self.grid.width as f64
    }
}

/// |a − b|/|b| over all vectors, the worst pair.
fn relative(a: &[Latent], b: impl Iterator<Item = Latent>) -> f64 {
    let norm = |v: &[f32]| v.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
    let error = |(a, b): (&Latent, Latent)| {
        let (a, b) = (a.vectors.as_flattened(), b.vectors.as_flattened());
        let difference: Vec<_> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        norm(&difference) / norm(b)
    };
    a.iter().zip(b).map(error).fold(0.0, f64::max)
}

fn largest(a: &[Vec<f32>], b: &[Vec<f32>]) -> f32 {
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn whole_stripes_rotate_latent_and_picture() {
    let setup = Setup::new();
    let latents = setup.encode(|_| ());
    let decoded = setup.decode(&latents);
    let stripe = setup.grid.width / STRIPES;
    for columns in [stripe, 5 * stripe, setup.grid.width / 2] {
        let rotated = setup.encode(|image| rotate_columns(setup.grid, image, columns));
        let error = relative(&rotated, latents.iter().map(|z| z.rotated(setup.angle(columns))));
        assert!(error <= 1e-5, "latent, {columns} columns: {error}");
        let mut expected = decoded.clone();
        expected.iter_mut().for_each(|image| rotate_columns(setup.grid, image, columns));
        let error = largest(&setup.decode(&rotated), &expected);
        assert!(error <= 1e-4, "log radiance, {columns} columns: {error}");
    }
}

/// What the design does not promise is indeed not there: the measure above can fail.
#[test]
fn parts_of_stripes_and_mirrors_are_approximate() {
    let setup = Setup::new();
    let latents = setup.encode(|_| ());
    let half = setup.grid.width / STRIPES / 2;
    let rotated = setup.encode(|image| rotate_columns(setup.grid, image, half));
    let error = relative(&rotated, latents.iter().map(|z| z.rotated(setup.angle(half))));
    assert!((1e-4..0.5).contains(&error), "half a stripe: {error}");
    let mirrored = setup.encode(|image| mirror(setup.grid, image));
    let error = relative(&mirrored, latents.iter().map(Latent::mirrored));
    assert!((1e-4..0.5).contains(&error), "mirror: {error}");
    // the wrong sense of rotation is not a small error
    let stripe = setup.grid.width / STRIPES;
    let rotated = setup.encode(|image| rotate_columns(setup.grid, image, stripe));
    let error = relative(&rotated, latents.iter().map(|z| z.rotated(-setup.angle(stripe))));
    assert!(error > 1e-2, "rotated the wrong way: {error}");
}
