use super::*;
use crate::vae::weights;
use burn::tensor::TensorData;
use veni_light::model::VnReluForm;
use veni_light::random::Stream;
use veni_light::sphere::Equirect;

const N: usize = 4;
const FORMS: [VnReluForm; 3] =
    [VnReluForm::Projection, VnReluForm::Reference, VnReluForm::ReferenceNormGuard];

fn decoder(form: VnReluForm, device: &Device) -> Decoder {
    let config = DecoderConfig { hidden: 16, layers: 2, heads: 2, vn_relu: form, ..DecoderConfig::default() };
    Decoder::new(&config, N, &mut Stream::from_seed(7), device)
}

/// Latents of two images, at which no ReLU of the test network is within a finite difference of its kink.
fn latent(device: &Device) -> Tensor<3> {
    let values: Vec<f32> = (0..2 * N * 3).map(|i| (1.3 * i as f32 + 0.9).sin() * 1.5).collect();
    Tensor::from_data(TensorData::new(values, [2, N, 3]), device)
}

fn directions(device: &Device) -> Tensor<2> {
    let values: Vec<f32> = Equirect::new(8, 4).directions().into_flattened();
    Tensor::from_data(TensorData::new(values, [32, 3]), device)
}

fn values<const D: usize>(tensor: &Tensor<D>) -> Vec<f32> {
    tensor.to_data().try_into_vec().unwrap()
}

fn largest_difference<const D: usize>(a: &Tensor<D>, b: &Tensor<D>) -> f32 {
    assert_eq!(a.dims(), b.dims());
    values(a).iter().zip(values(b)).fold(0.0, |m, (x, y)| m.max((x - y).abs()))
}

/// Row vectors times this matrix.
fn matrix(m: [[f32; 3]; 3], device: &Device) -> Tensor<2> {
    Tensor::from_data(m, device)
}

#[test]
fn rotating_or_mirroring_the_latent_rotates_or_mirrors_the_image() {
    let device = Device::flex();
    for form in FORMS {
        let decoder = decoder(form, &device);
        let expected = decoder.forward(latent(&device), directions(&device));
        for angle in [0.1f32, 1.0, 2.5, -3.0] {
            let (s, c) = angle.sin_cos();
            for sign in [1.0, -1.0] {
                let m = matrix([[c, s, 0.0], [-s * sign, c * sign, 0.0], [0.0, 0.0, 1.0]], &device);
                let rotated =
                    decoder.forward(rotate(latent(&device), m.clone()), directions(&device).matmul(m));
                let difference = largest_difference(&expected, &rotated);
                assert!(difference < 1e-5, "{form:?}, angle {angle}, sign {sign}: {difference}");
            }
        }
        // Anything else is seen.
        let upside_down = matrix([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]], &device);
        let flipped = decoder
            .forward(rotate(latent(&device), upside_down.clone()), directions(&device).matmul(upside_down));
        assert!(largest_difference(&expected, &flipped) > 1e-2);
    }
}

#[test]
fn images_of_a_batch_do_not_know_of_each_other() {
    let device = Device::flex();
    let decoder = decoder(VnReluForm::Projection, &device);
    let both = decoder.forward(latent(&device), directions(&device));
    let second = decoder.forward(latent(&device).narrow(0, 1, 1), directions(&device));
    assert!(largest_difference(&both.clone().narrow(0, 1, 1), &second) < 1e-6);
    // Each image's own directions: the second image gets them in reverse.
    let reversed = directions(&device).flip([0]);
    let own = Tensor::stack::<3>(vec![directions(&device), reversed], 0);
    let own = decoder.forward_per_image(latent(&device), own);
    assert!(largest_difference(&both.clone().narrow(0, 0, 1), &own.clone().narrow(0, 0, 1)) < 1e-6);
    assert!(largest_difference(&second.flip([1]), &own.narrow(0, 1, 1)) < 1e-6);
}

#[test]
fn gradients_are_finite_at_latent_zero() {
    let device = Device::flex().autodiff();
    for form in FORMS {
        let decoder = decoder(form, &device);
        // One image is all zero, one has a single vector on the axis.
        let mut z = vec![0.0f32; 2 * N * 3];
        z[N * 3 + 2] = 1.0;
        let z: Tensor<3> = Tensor::from_data(TensorData::new(z, [2, N, 3]), &device).require_grad();
        let image = decoder.forward(z.clone(), directions(&device));
        let gradients = (image.clone() * image).sum().backward();
        assert!(values(&z.grad(&gradients).unwrap()).iter().all(|g| g.is_finite()), "{form:?}");
        for (name, weight) in weights::gradients(&decoder, "", &gradients) {
            assert!(weight.data.iter().all(|g| g.is_finite()), "{form:?}: {name}");
        }
    }
}

/// How much each output counts in the scalar that is differentiated.
fn importance(i: usize) -> f64 {
    (0.7 * i as f64).cos()
}

/// A scalar with every output in it.
fn probe(image: Tensor<3>) -> Tensor<1> {
    let [b, r, c] = image.dims();
    let weights: Vec<f32> = (0..b * r * c).map(|i| importance(i) as f32).collect();
    (image.clone() * Tensor::from_data(TensorData::new(weights, [b, r, c]), &image.device())).sum()
}

/// The same scalar, summed in f64: finite differences must not drown in its rounding.
fn probe_value(image: &Tensor<3>) -> f64 {
    values(image).iter().enumerate().map(|(i, v)| importance(i) * f64::from(*v)).sum()
}

#[test]
fn latent_gradients_agree_with_finite_differences() {
    let device = Device::flex().autodiff();
    for form in FORMS {
        let decoder = decoder(form, &device);
        let z = latent(&device).require_grad();
        let gradients = probe(decoder.forward(z.clone(), directions(&device))).backward();
        let gradient = values(&z.grad(&gradients).unwrap());
        let scale = gradient.iter().fold(0.0f32, |m, g| m.max(g.abs()));
        let base = values(&latent(&device));
        for i in 0..base.len() {
            let step = 2e-4;
            let at = |delta: f32| {
                let mut z = base.clone();
                z[i] += delta;
                let z = Tensor::from_data(TensorData::new(z, [2, N, 3]), &device);
                probe_value(&decoder.forward(z, directions(&device)))
            };
            let found = ((at(step) - at(-step)) / f64::from(2.0 * step)) as f32;
            // What the curvature of the fast encoding and the rounding of the difference leave.
            assert!((found - gradient[i]).abs() < 1e-2 * scale, "{form:?} {i}: {found} {}", gradient[i]);
        }
    }
}

#[test]
fn weight_gradients_agree_with_finite_differences() {
    let device = Device::flex().autodiff();
    let decoder = decoder(VnReluForm::Reference, &device);
    let gradients = probe(decoder.forward(latent(&device), directions(&device))).backward();
    let gradients = weights::gradients(&decoder, "", &gradients);
    let base = weights::read(&decoder, "");
    for (name, weight) in &base {
        // Along the sign pattern of the gradient: the directional derivative is its 1-norm.
        let gradient = &gradients[name].data;
        let expected: f32 = gradient.iter().map(|g| g.abs()).sum();
        // So small that hardly a ReLU crosses its kink on the way.
        let step = 1e-4 / (weight.data.len() as f32).sqrt();
        let at = |sign: f32| {
            let mut moved = base.clone();
            let data = &mut moved.get_mut(name).unwrap().data;
            data.iter_mut().zip(gradient).for_each(|(w, g)| *w += sign * step * g.signum());
            let decoder = weights::write(decoder.clone(), "", &moved).unwrap();
            probe_value(&decoder.forward(latent(&device), directions(&device)))
        };
        let found = ((at(1.0) - at(-1.0)) / f64::from(2.0 * step)) as f32;
        assert!((found - expected).abs() < 3e-2 * expected.max(1.0), "{name}: {found} {expected}");
    }
}

#[test]
fn conditioning_starts_alive_whatever_the_seed() {
    let device = Device::flex();
    for seed in 0..40 {
        let mut rng = Stream::from_seed(seed);
        let condition = Condition::new(VnReluForm::Projection, 2, &mut rng, &device);
        let a = condition.forward(latent(&device));
        let dead = values(&a).iter().filter(|v| **v == 0.0).count();
        assert_eq!(dead, 0, "seed {seed}");
    }
}

#[test]
fn the_seed_determines_the_weights() {
    let device = Device::flex();
    let build = |seed| {
        let mut rng = Stream::from_seed(seed);
        weights::read(&Decoder::new(&DecoderConfig::default(), 2, &mut rng, &device), "")
    };
    assert_eq!(build(1), build(1));
    assert_ne!(build(1), build(2));
    let weights = build(1);
    // Uniform in ±1/√inputs.
    for (name, inputs) in [("input.weight", 20), ("layers.3.ff1.bias", 128), ("output.weight", 128)] {
        let bound = 1.0 / f64::from(inputs).sqrt();
        let data = &weights[name].data;
        let largest = data.iter().fold(0.0f64, |m, v| m.max(f64::from(v.abs())));
        assert!(largest <= bound && largest > 0.9 * bound, "{name}: {largest} of {bound}");
    }
}

#[test]
#[should_panic(expected = "the decoder takes latents [B, 4, 3]")]
fn a_latent_of_another_size_is_refused() {
    let device = Device::flex();
    decoder(VnReluForm::Projection, &device).forward(Tensor::zeros([1, 5, 3], &device), directions(&device));
}

mod kernels;
mod systems;
