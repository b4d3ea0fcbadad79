use super::*;
use burn::tensor::TensorData;

const H: usize = 8;
const W: usize = 16;

/// Log-radiance images with structure, from a formula: no global generator.
fn image(phase: f64) -> Tensor<4> {
    let mut values = Vec::new();
    for b in 0..2 {
        for j in 0..H {
            for i in 0..W {
                for c in 0..3 {
                    let x = phase + 1.7 * b as f64 + 0.9 * j as f64 + 0.6 * i as f64 + 1.3 * c as f64;
                    values.push((2.0 * (x * 1.1).sin() + (x * x * 0.3).cos()) as f32);
                }
            }
        }
    }
    Tensor::from_data(TensorData::new(values, [2, H, W, 3]), &Device::flex())
}

fn number(value: Tensor<1>) -> f64 {
    f64::from(value.into_scalar::<f32>())
}

fn terms(config: &LossConfig, prediction: Tensor<4>, target: Tensor<4>) -> Vec<(&'static str, f64)> {
    let loss = Loss::new(config, H, W, &Device::flex());
    let terms = loss.terms(0, prediction, target, None).terms;
    terms.into_iter().map(|t| (t.name, number(t.value))).collect()
}

fn all_on(form: LossForm) -> LossConfig {
    let one = WeightSchedule::Constant(1.0);
    LossConfig {
        form,
        mage: one,
        scale_invariant: one,
        exposure: one,
        cosine: one,
        kld: one,
        log_mse: one,
        hdr_mse: one,
        ldr_mse: one,
        irradiance: one,
        ..LossConfig::default()
    }
}

#[test]
fn an_exact_prediction_costs_nothing() {
    for (name, value) in terms(&all_on(LossForm::Corrected), image(0.0), image(0.0)) {
        assert!(value.abs() < 1e-6, "{name}: {value}");
    }
}

#[test]
fn corrected_terms_do_not_see_a_factor_and_reference_terms_do() {
    let brighter = image(0.3) + 0.7;
    let corrected = |p: Tensor<4>| terms(&all_on(LossForm::Corrected), p, image(0.0));
    for ((name, before), (_, after)) in corrected(image(0.3)).into_iter().zip(corrected(brighter.clone())) {
        let invariant = ["mage", "scale_invariant", "cosine"].contains(&name);
        assert_eq!(
            invariant,
            (before - after).abs() < 1e-5 * before.abs().max(1.0),
            "{name}: {before} {after}"
        );
    }
    let reference = |p: Tensor<4>| terms(&all_on(LossForm::Reference), p, image(0.0));
    for ((name, before), (_, after)) in reference(image(0.3)).into_iter().zip(reference(brighter)) {
        assert!((before - after).abs() > 1e-3, "{name}: {before} {after}");
    }
}

#[test]
fn scale_invariant_and_level_add_up_to_the_log_error() {
    let values = terms(&all_on(LossForm::Corrected), image(0.4), image(0.0));
    let get = |name: &str| values.iter().find(|v| v.0 == name).unwrap().1;
    assert!((get("scale_invariant") + get("exposure") - get("log_mse")).abs() < 1e-5);
}

#[test]
fn corrected_terms_rotate_with_the_image() {
    let roll = |x: Tensor<4>| Tensor::cat(vec![x.clone().narrow(2, 6, W - 6), x.narrow(2, 0, 6)], 2);
    // the surfaces of the irradiance term are 26, at multiples of 45°
    let irradiance = WeightSchedule::Constant(0.0);
    let config = LossConfig { mage_scales: 1, irradiance, ..all_on(LossForm::Corrected) };
    let still = terms(&config, image(0.4), image(0.0));
    let rolled = terms(&config, roll(image(0.4)), roll(image(0.0)));
    for ((name, a), (_, b)) in still.into_iter().zip(rolled) {
        assert!((a - b).abs() < 1e-5 * a.abs().max(1.0), "{name}: {a} {b}");
    }
}

#[test]
fn the_irradiance_term_sees_factors_and_small_bright_things() {
    let surfaces = irradiance::surfaces(H, W, &Device::flex());
    let term = |p: Tensor<4>, i: Tensor<4>| number(irradiance::irradiance(p, i, surfaces.clone()));
    // a factor on radiance is one on irradiance
    assert!((term(image(0.0) + 0.7, image(0.0)) - 0.49).abs() < 1e-5);
    // 1 everywhere: the irradiance is π
    let one: Tensor<2> = surfaces.clone().sum_dim(1);
    let sums = one.into_data().try_to_vec::<f32>().unwrap();
    assert!(sums.iter().all(|e| (e / std::f32::consts::PI - 1.0).abs() < 0.05), "{sums:?}");
    // one pixel e⁵ times as bright, which the mean log error hardly sees
    let mut values = vec![0.0f32; H * W * 3];
    values[3 * (H / 4 * W + W / 2)..][..3].fill(5.0);
    let lit = Tensor::from_data(TensorData::new(values, [1, H, W, 3]), &Device::flex());
    let dark = Tensor::zeros([1, H, W, 3], &Device::flex());
    assert!(term(dark, lit) > 0.05);
}

#[test]
fn mage_measures_gradients() {
    // R rises by 0.01 per row and nothing else; Scharr's taps sum to 32 over a difference of two rows,
    // 16 × 2 × the gradient.
    let rows: Vec<f32> = (0..H).flat_map(|j| vec![0.01 * j as f32; W * 3]).collect();
    let ramp: Tensor<4> = Tensor::from_data(TensorData::new(rows, [1, H, W, 3]), &Device::flex());
    let mage = mage::Mage::new(1, H, W, &Device::flex());
    let value = number(mage.loss(ramp.clone(), ramp.zeros_like()));
    assert!((value - 0.5 * 32.0 * 0.01).abs() < 1e-5, "{value}");
    // The reference implementation's pair answers to a mere exposure with 20 × it, halved by the average of the two.
    let level = Tensor::<3>::full([1, H, W], 0.1, &Device::flex());
    let theirs = mage::reference_planes(level.clone(), level.zeros_like(), mage::Operator::Scharr, 1, false);
    assert!((number(theirs) - 0.5 * 20.0 * 0.1).abs() < 1e-5);
}

#[test]
fn gradients_are_finite_where_both_images_vanish() {
    let device = Device::flex().autodiff();
    for form in [LossForm::Corrected, LossForm::Reference] {
        let prediction = Tensor::<4>::zeros([1, H, W, 3], &device).require_grad();
        let target = Tensor::<4>::zeros([1, H, W, 3], &device);
        let loss = Loss::new(&all_on(form), H, W, &device);
        let gradients = loss.terms(0, prediction.clone(), target, None).total().backward();
        let gradient: Vec<f32> = prediction.grad(&gradients).unwrap().into_data().try_into_vec().unwrap();
        assert!(gradient.iter().all(|g| g.is_finite()), "{form:?}");
    }
}

#[test]
fn gradients_agree_with_finite_differences() {
    let device = Device::flex().autodiff();
    let loss = Loss::new(&all_on(LossForm::Corrected), H, W, &device);
    let target = image(0.0).autodiff();
    let prediction = image(0.4).autodiff().require_grad();
    let gradients = loss.terms(0, prediction.clone(), target.clone(), None).total().backward();
    let gradient = prediction.grad(&gradients).unwrap();
    let value = |p: Tensor<4>| number(loss.terms(0, p.autodiff(), target.clone(), None).total());
    // Along a direction in which every element takes part.
    let along = image(5.0);
    let expected = number((gradient * along.clone()).sum());
    let step = 1e-3;
    let base = image(0.4);
    let found = (value(base.clone() + along.clone() * step) - value(base - along * step)) / (2.0 * step);
    assert!((expected - found).abs() < 2e-2 * expected.abs().max(0.1), "{expected} {found}");
}

#[test]
fn divergence_is_zero_at_the_prior_and_positive_elsewhere() {
    let device = Device::flex();
    let zero = kld::isotropic(Tensor::zeros([2, 5, 3], &device), Tensor::zeros([2, 5, 1], &device));
    assert_eq!(zero.dims(), [2]);
    assert!(number(zero.max()).abs() < 1e-6);
    for (mean, log_variance) in [(0.5, 0.0), (0.0, 0.4), (0.0, -0.4)] {
        let mean = Tensor::full([1, 5, 3], mean, &device);
        assert!(number(kld::isotropic(mean, Tensor::full([1, 5, 1], log_variance, &device))) > 0.05);
    }
}

#[test]
fn a_mask_leaves_out_what_it_covers() {
    let device = Device::flex();
    let half = Tensor::cat(
        vec![Tensor::<4>::ones([1, H, W / 2, 1], &device), Tensor::zeros([1, H, W / 2, 1], &device)],
        2,
    );
    let (p, i) = (image(0.2), image(0.0));
    let spoiled =
        Tensor::cat(vec![p.clone().narrow(2, 0, W / 2), p.clone().narrow(2, W / 2, W / 2) + 9.0], 2);
    let rows = rows::solid_angle(H, &device);
    let error = |p: Tensor<4>, mask| {
        number(mse::mse(LossForm::Corrected, LossSpace::Log, p, i.clone(), rows.clone(), mask))
    };
    assert_eq!(error(p.clone(), Some(half.clone())), error(spoiled.clone(), Some(half.clone())));
    assert!(error(spoiled, None) > error(p.clone(), None) + 1.0);
    // Divided by what counts: an error of 1 everywhere is 1 under any mask.
    assert!((error(i.clone() + 1.0, Some(half)) - 1.0).abs() < 1e-5);
}
