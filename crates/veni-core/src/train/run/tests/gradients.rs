//! Gradients of a whole step.

use super::*;

/// The whole chain, encoder to weighted loss: the analytic derivative along a random direction of each parameter
/// tensor against a central difference.
#[test]
fn gradients_of_the_whole_loss_match_finite_differences() {
    let (folder, mut config) = setup(1);
    // of some seeds a ReLU switches within every step
    config.seed = 2;
    config.loss.ldr_mse = WeightSchedule::Constant(1.0);
    // |·| has a kink at every pixel whose gradient error is 0; too many for a finite step in f32
    config.loss.mage = WeightSchedule::Constant(0.0);
    // one scene whatever the presets draw: others have kinks of the display curve within the step
    config.augment = veni_data::AugmentConfig::default();
    gradients_match(&folder.path().join("run"), config);
}

/// The same from the table to the loss of an auto-decoder, in both forms, with every term that it can have.
#[test]
fn gradients_of_an_auto_decoder_match_finite_differences() {
    for form in [LossForm::Reference, LossForm::Corrected] {
        let mut config = Preset::Tiny.auto_decoder(3);
        config.loss.form = form;
        config.loss.kld = WeightSchedule::Constant(0.01);
        config.loss.exposure = WeightSchedule::Constant(1.0);
        config.loss.log_mse = WeightSchedule::Constant(0.3);
        let (folder, mut config) = setup_of(config, 1);
        config.latents.as_mut().unwrap().free_exposure = true;
        gradients_match(&folder.path().join("run"), config);
    }
}

fn gradients_match(run: &Path, config: TrainConfig) {
    let trainer = Trainer::create(run, config, "test").unwrap();
    let veni = trainer.network().clone();
    let batch = veni.source(trainer.config(), &trainer.splits.train).unwrap().prepare(1);
    let device = DeviceKind::Flex.device().unwrap().autodiff();
    let loss_of = &Network::loss(trainer.config(), &device);
    let value = |veni: &Network| veni.terms(&batch, loss_of, &device).total();
    let both = [DecoderBackend::Tensors, DecoderBackend::Kernels].map(|by| {
        let (terms, gradients) = veni.gradients(&batch, loss_of, by, &device);
        (terms.total().into_scalar::<f32>(), weights::gradients(&veni, "", &gradients))
    });
    let [(loss, gradients), (kernel_loss, by_kernels)] = both;
    assert!((loss - kernel_loss).abs() < 1e-5 * loss.abs(), "{loss} {kernel_loss}");
    assert!(gradients.keys().eq(by_kernels.keys()));
    for (name, gradient) in &gradients {
        let largest = gradient.data.iter().fold(1e-4f32, |m, g| m.max(g.abs()));
        for (a, b) in gradient.data.iter().zip(&by_kernels[name].data) {
            assert!((a - b).abs() < 2e-4 * largest, "{name}: {a} by tensors, {b} by kernels");
        }
    }
    let start = weights::read(&veni, "");
    let mut checked = 0;
    for (slot, (name, gradient)) in (0..).zip(&gradients) {
        // along the gradient, where the derivative is large, and a random direction, so that no component hides
        let mut rng = stream(5, Purpose::Fit, 0, slot);
        let random: Vec<f64> = gradient.data.iter().map(|_| rng.normal()).collect();
        let gradient: Vec<f64> = gradient.data.iter().map(|g| f64::from(*g)).collect();
        let length = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-30);
        let (a, b) = (length(&gradient), length(&random));
        let direction: Vec<f64> = gradient.iter().zip(&random).map(|(g, r)| g / a + r / b).collect();
        let derivative: f64 = direction.iter().zip(&gradient).map(|(d, g)| d * g).sum();
        let at = |h: f64| {
            let mut moved = start.clone();
            let data = &mut moved.get_mut(name).unwrap().data;
            data.iter_mut().zip(&direction).for_each(|(w, d)| *w += (h * d) as f32);
            let moved = weights::write(veni.clone(), "", &moved).unwrap();
            f64::from(value(&moved).into_scalar::<f32>())
        };
        // Richardson's combination of two central differences has an error of order h⁴; where a ReLU switches
        // within the step it has one of order h. One of the steps must agree.
        let difference = |h: f64| (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
        let differences = [2e-3, 5e-4, 1e-4].map(difference);
        let error = differences.iter().map(|d| (d - derivative).abs()).fold(f64::INFINITY, f64::min);
        assert!(
            error < 1e-3 + 0.02 * derivative.abs(),
            "{name}: differences {differences:?}, gradient {derivative}"
        );
        checked += usize::from(derivative.abs() > 1e-2);
    }
    assert!(
        checked > gradients.len() / 2,
        "only {checked} of {} derivatives rise above the noise",
        gradients.len()
    );
}

/// The losses are means over the batch: in how many parts it is computed, on one device or on several, changes nothing but
/// rounding.
#[test]
fn gradients_of_parts_are_those_of_the_whole_batch() {
    let (folder, mut config) = setup(1);
    config.batch = 5;
    config.loss.log_mse = WeightSchedule::Constant(0.3);
    config.loss.hdr_mse = WeightSchedule::Constant(0.3);
    for form in [LossForm::Corrected, LossForm::Reference] {
        config.loss.form = form;
        let computed = |devices: usize, accumulate: usize, batch: usize| {
            let mut config = config.clone();
            (config.accumulate, config.batch) = (accumulate, batch);
            config.devices = Devices::first(devices);
            let out = folder.path().join(format!("{form:?}-{devices}-{accumulate}-{batch}"));
            let trainer = Trainer::create(&out, config, "test").unwrap();
            let source = trainer.network().source(trainer.config(), &trainer.splits.train).unwrap();
            trainer.replicas.gradients(source.prepare(1), accumulate)
        };
        let whole = computed(1, 1, 5);
        for parts in [[1, 2], [1, 5], [2, 1], [5, 1], [2, 2]] {
            let sum = computed(parts[0], parts[1], 5);
            assert_eq!(sum.parts.len(), whole.parts.len());
            for (name, value) in &whole.parts {
                // a mean whose largest terms are a sun's rounds at 1.5e-5
                let other = sum.parts[name];
                assert!(
                    (other - value).abs() < 1e-4 * value,
                    "{form:?}, {parts:?} parts, {name}: {other} {value}"
                );
            }
            let distance = distance(&sum, &whole);
            assert!(distance < 1e-4, "{form:?}, {parts:?} parts: {distance}");
        }
        // a batch that lacks a part is something else
        assert!(distance(&computed(1, 1, 4), &whole) > 1e-2);
    }
}

/// The largest relative difference of a parameter's gradient.
fn distance(a: &Computed, b: &Computed) -> f64 {
    let norm =
        |values: &mut dyn Iterator<Item = f32>| values.map(|v| f64::from(v).powi(2)).sum::<f64>().sqrt();
    let largest = norm(&mut b.gradients.values().flat_map(|g| g.data.iter().copied()));
    let one = |(name, g): (&String, &veni_light::model::Array)| {
        let other = &b.gradients[name];
        let difference = norm(&mut g.data.iter().zip(&other.data).map(|(x, y)| x - y));
        // parameters whose gradient is rounding alone are measured by the whole
        difference / norm(&mut other.data.iter().copied()).max(1e-3 * largest)
    };
    a.gradients.iter().map(one).fold(0.0, f64::max)
}
