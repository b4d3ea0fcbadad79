//! The kernels that train the decoder against its tensor operations.

use super::*;
use veni_light::random::Stream;

/// Sizes at which blocks, panels and chunks are full, short and several: hidden, layers, latent vectors, rays.
const SIZES: [[usize; 4]; 4] = [[16, 2, 4, 32], [20, 1, 3, 7], [64, 3, 30, 500], [128, 2, 9, 1100]];

fn setup([hidden, layers, n, rays]: [usize; 4]) -> (Decoder, Tensor<3>, Tensor<3>) {
    let device = Device::flex().autodiff();
    let config = DecoderConfig { hidden, layers, heads: 2, ..DecoderConfig::default() };
    let decoder = Decoder::new(&config, n, &mut Stream::from_seed(4), &device);
    // away from 0 and 1, where a mistake in a norm's gain or offset would not show
    let mut all = weights::read(&decoder, "");
    for (name, weight) in &mut all {
        if name.contains("norm") {
            let moved = |i: usize| 0.2 * (1.7 * i as f32 + name.len() as f32).sin();
            weight.data.iter_mut().enumerate().for_each(|(i, w)| *w += moved(i));
        }
    }
    let decoder = weights::write(decoder, "", &all).unwrap();
    let z: Vec<f32> = (0..2 * n * 3).map(|i| (1.3 * i as f32 + 0.9).sin() * 1.5).collect();
    let latent = Tensor::from_data(TensorData::new(z, [2, n, 3]), &device).require_grad();
    // each image's own
    let d = (0..2 * rays).flat_map(|i| {
        let (z, phi) = (((i as f32 + 0.5) * 0.618).fract() * 2.0 - 1.0, i as f32 * 2.4);
        let r = (1.0 - z * z).sqrt();
        [r * phi.cos(), r * phi.sin(), z]
    });
    let directions = Tensor::from_data(TensorData::new(d.collect::<Vec<_>>(), [2, rays, 3]), &device);
    (decoder, latent, directions)
}

/// Log radiance, and the gradients of Σ g · log radiance by parameters and by the latent.
type Found = (Vec<f32>, weights::Weights);

fn output_gradient(i: usize) -> f32 {
    (0.7 * i as f32).cos()
}

fn with_latent(mut gradients: weights::Weights, latent: &Tensor<3>) -> weights::Weights {
    let latent = veni_light::model::Array { shape: latent.dims().to_vec(), data: values(latent) };
    gradients.insert("latent".into(), latent);
    gradients
}

fn by_tensors(decoder: &Decoder, latent: &Tensor<3>, directions: Tensor<3>) -> Found {
    let image = decoder.forward_per_image(latent.clone(), directions);
    let by_output: Vec<f32> = (0..values(&image).len()).map(output_gradient).collect();
    let by_output = Tensor::from_data(TensorData::new(by_output, image.dims()), &image.device());
    let gradients = (image.clone() * by_output).sum().backward();
    let found = weights::gradients(decoder, "", &gradients);
    (values(&image), with_latent(found, &latent.grad(&gradients).unwrap()))
}

fn by_kernels(decoder: &Decoder, latent: &Tensor<3>, directions: &[[f32; 3]], rays: usize) -> Found {
    let native = decoder.native(latent.clone()).unwrap();
    let image = native.forward(directions, rays);
    let by_output: Vec<f32> = (0..image.len()).map(output_gradient).collect();
    let gradients = native.backward(directions, rays, &by_output).backward();
    let found = weights::gradients(decoder, "", &gradients);
    (image, with_latent(found, &latent.grad(&gradients).unwrap()))
}

/// The largest difference of each tensor relative to its largest entry (at least a millionth of the largest of all),
/// log radiance as tensor `image`.
fn differences(a: &Found, b: &Found) -> Vec<(String, f32)> {
    let largest = |v: &[f32]| v.iter().fold(0.0f32, |m, x| m.max(x.abs()));
    let relative = |a: &[f32], b: &[f32]| {
        assert_eq!(a.len(), b.len());
        let difference: Vec<f32> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        largest(&difference) / largest(a).max(1e-3)
    };
    assert!(a.1.keys().eq(b.1.keys()), "{:?} {:?}", a.1.keys(), b.1.keys());
    let tensors = a.1.iter().map(|(name, t)| (name.clone(), relative(&t.data, &b.1[name].data)));
    tensors.chain([("image".to_owned(), relative(&a.0, &b.0))]).collect()
}

#[test]
fn kernels_give_the_values_and_gradients_of_tensor_operations() {
    for size in SIZES {
        let (decoder, latent, directions) = setup(size);
        let flat = values(&directions);
        let expected = by_tensors(&decoder, &latent, directions);
        let found = by_kernels(&decoder, &latent, flat.as_chunks().0, size[3]);
        for (name, difference) in differences(&expected, &found) {
            assert!(difference < 3e-5, "{size:?}: {name} differs by {difference}");
        }
    }
}

#[test]
fn shared_directions_are_those_of_every_image() {
    let (decoder, latent, directions) = setup(SIZES[0]);
    let first = directions.narrow(0, 0, 1);
    let both = Tensor::cat(vec![first.clone(), first.clone()], 0);
    let shared = by_kernels(&decoder, &latent, values(&first).as_chunks().0, 32);
    let own = by_kernels(&decoder, &latent, values(&both).as_chunks().0, 32);
    assert_eq!(shared.0, own.0);
    assert_eq!(shared.1, own.1);
}

/// Each kind of weight is moved on one side: what it multiplies or feeds must differ, so the comparison sees it.
#[test]
fn a_changed_weight_is_seen_by_the_comparison() {
    let (decoder, latent, directions) = setup(SIZES[0]);
    let flat = values(&directions);
    let expected = by_tensors(&decoder, &latent, directions);
    let original = weights::read(&decoder, "");
    for name in original.keys().filter(|name| !name.starts_with("condition.u")) {
        let mut changed = original.clone();
        changed.get_mut(name).unwrap().data[0] += 0.05;
        let changed = weights::write(decoder.clone(), "", &changed).unwrap();
        let found = by_kernels(&changed, &latent, flat.as_chunks().0, 32);
        let worst = differences(&expected, &found).into_iter().fold(0.0f32, |m, (_, d)| m.max(d));
        assert!(worst > 3e-4, "{name}: {worst}");
    }
}

#[test]
fn a_network_that_does_not_fold_is_refused_by_name() {
    let device = Device::flex();
    let config = DecoderConfig {
        conditioning: veni_light::model::Conditioning::Tokens,
        hidden: 16,
        heads: 2,
        ..DecoderConfig::default()
    };
    let decoder = Decoder::new(&config, N, &mut Stream::from_seed(4), &device);
    let error = decoder.native(latent(&device)).unwrap_err().to_string();
    assert!(error.contains("tokens"), "{error}");
}
