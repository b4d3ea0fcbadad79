//! One step, and a short run, on every device of this build: flex, ndarray (feature), wgpu (feature).
//!
//! Without a graphics adapter the tests fail, unless `VENI_SKIP_GPU=1` says that this is known; then they say that they
//! went without.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use crate::train::config::{DecoderBackend, DeviceKind, TrainConfig};
use crate::train::network::{Network, Prepared};
use crate::train::presets::Preset;
use crate::train::replicas::Replicas;
use crate::train::step;
use crate::vae::weights::{self, Weights};
use veni_data::{Dataset, Item};
use veni_fit::schedule::WeightSchedule;
use veni_image::Panorama;
use veni_light::sphere::Equirect;

/// All but the cuda device, which needs a card.
fn devices() -> Vec<DeviceKind> {
    let mut kinds = vec![DeviceKind::Flex];
    kinds.extend(cfg!(feature = "ndarray").then_some(DeviceKind::Ndarray));
    if cfg!(feature = "wgpu") {
        match DeviceKind::Wgpu.open() {
            Ok(opened) => {
                say(&format!("wgpu: {}, software: {}", opened.name, opened.software));
                kinds.push(DeviceKind::Wgpu);
            }
            Err(error) => {
                let known = std::env::var("VENI_SKIP_GPU").is_ok_and(|v| v == "1");
                assert!(known, "{error}, or set VENI_SKIP_GPU=1");
                let thread = std::thread::current();
                let test = thread.name().unwrap_or("a test of devices").to_owned();
                say(&format!("{test}: wgpu skipped, since VENI_SKIP_GPU=1 is set ({error})"));
            }
        }
    }
    kinds
}

/// Past the test framework's capture.
fn say(line: &str) {
    let _ = std::io::stderr().write_all(format!("{line}\n").as_bytes());
}

/// Two skies with a sun each over dark ground.
fn skies() -> Dataset {
    let grid = Equirect::new(32, 16);
    let sky = |azimuth: f32| {
        let sun = [azimuth.cos() * 0.8, azimuth.sin() * 0.8, 0.6];
        let panorama = Panorama::from_fn(grid, |d| {
            let toward = d.iter().zip(sun).map(|(a, b)| a * b).sum::<f32>();
            let base = if d[2] > 0.0 { [0.4, 0.6, 1.0] } else { [0.12, 0.1, 0.08] };
            base.map(|v| v + 20.0 * (12.0 * (toward - 1.0)).exp())
        });
        Item::new(Path::new("sky"), &panorama, grid)
    };
    Dataset::new(grid, vec![sky(0.3), sky(2.0)])
}

/// What one step says.
struct Step {
    total: f64,
    parts: BTreeMap<&'static str, f64>,
    gradients: Weights,
    /// Mean and log variance of the posterior; nothing of an auto-decoder.
    encoded: Vec<f32>,
}

/// The step of `batch` on a device, from the weights of the configuration's seed or from others.
fn step_on(kind: DeviceKind, by: DecoderBackend, config: &TrainConfig, from: Option<&Weights>) -> Step {
    let device = kind.device().unwrap().autodiff();
    let skies = skies();
    let mut network = Network::new(config, skies.len(), &device).unwrap();
    if let Some(weights) = from {
        network = weights::write(network, "", weights).unwrap();
    }
    let batch = network.source(config, &skies).unwrap().prepare(1);
    let loss = Network::loss(config, &device);
    let (terms, gradients) = network.gradients(&batch, &loss, by, &device);
    let (total, parts) = terms.values();
    let encoded = match (&network, &batch) {
        (Network::Veni(veni), Prepared::Panoramas(batch)) => {
            let posterior = step::encode(veni, batch, &device);
            let spread = posterior.log_variance.expect("a variational encoder");
            [posterior.mean, spread].into_iter().flat_map(|t| t.into_data().try_into_vec().unwrap()).collect()
        }
        _ => Vec::new(),
    };
    Step { total, parts, gradients: weights::gradients(&network, "", &gradients), encoded }
}

/// The largest deviations of losses, gradients and the encoder's output, each in units of what is allowed.
///
/// Allowed are 2e-5 of a loss, 2e-4 of a parameter's largest gradient (or of 1e-4, where it vanishes) and 2e-5 of the
/// largest coordinate: devices add up in another order, and a sum over a few thousand numbers of either sign loses two
/// or three of f32's seven digits in a gradient.
fn deviations(ours: &Step, other: &Step) -> [f64; 3] {
    assert!(ours.parts.keys().eq(other.parts.keys()) && ours.gradients.keys().eq(other.gradients.keys()));
    let loss = |a: f64, b: f64| (a - b).abs() / (2e-5 * a.abs().max(1e-3));
    let parts = ours.parts.iter().map(|(name, value)| loss(*value, other.parts[name]));
    let losses = parts.fold(loss(ours.total, other.total), f64::max);
    let apart = |a: &[f32], b: &[f32], allowed: f64, least: f32| {
        assert_eq!(a.len(), b.len());
        let largest = f64::from(a.iter().fold(least, |m, v| m.max(v.abs())));
        let apart = a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs()));
        apart.fold(0.0, |m, d| if d.is_nan() { f64::INFINITY } else { m.max(d) }) / (allowed * largest)
    };
    let gradients = ours.gradients.iter();
    let gradients = gradients.map(|(name, g)| apart(&g.data, &other.gradients[name].data, 2e-4, 1e-4));
    let gradients = gradients.fold(0.0, f64::max);
    [losses, gradients, apart(&ours.encoded, &other.encoded, 2e-5, 1e-4)]
}

#[test]
fn every_device_computes_the_same_step() {
    let mut veni = Preset::Tiny.config(3);
    for schedule in [&mut veni.loss.log_mse, &mut veni.loss.hdr_mse, &mut veni.loss.ldr_mse] {
        *schedule = WeightSchedule::Constant(0.3);
    }
    let mut reni = Preset::Tiny.auto_decoder(3);
    reni.loss.kld = WeightSchedule::Constant(0.01);
    reni.latents.as_mut().unwrap().free_exposure = true;
    for config in [veni, reni] {
        let expected = step_on(DeviceKind::Flex, DecoderBackend::Tensors, &config, None);
        let (terms, parameters) = (expected.parts.len(), expected.gradients.len());
        assert!(terms >= 3 && parameters > 15, "{terms} losses, {parameters} gradients");
        for kind in devices() {
            for by in [DecoderBackend::Tensors, DecoderBackend::Kernels] {
                let found = deviations(&expected, &step_on(kind, by, &config, None));
                say(&format!("{:?}: {kind:?} by {by:?}: {found:.3?} of what is allowed", config.model.kind));
                assert!(found.iter().all(|d| *d < 1.0), "{kind:?}, {by:?}: {found:?} of what is allowed");
            }
        }
    }
}

/// A batch shared among all devices of this build, the last of which has two panoramas of five, is the batch on one. With a
/// wrong weight for its parts it is not.
#[test]
fn devices_of_every_kind_share_a_batch() {
    let mut config = Preset::Tiny.config(3);
    (config.batch, config.decoder_backend) = (5, DecoderBackend::Tensors);
    let skies = skies();
    let kinds = devices();
    let opened: Vec<_> = kinds.iter().map(|kind| kind.device().unwrap().autodiff()).collect();
    let first = Network::new(&config, skies.len(), &opened[0]).unwrap();
    let batch = first.source(&config, &skies).unwrap().prepare(1);
    let on = |devices: &[burn::tensor::Device], batch: &Prepared| {
        let computed = Replicas::new(first.clone(), &config, devices).unwrap().gradients(batch.clone(), 1);
        let (total, parts, gradients) = (computed.value, computed.parts, computed.gradients);
        Step { total, parts, gradients, encoded: Vec::new() }
    };
    let whole = on(&opened[..1], &batch);
    // at least two, if of one kind
    let shared: Vec<_> = opened.iter().chain(&opened[..1]).cloned().collect();
    let found = deviations(&whole, &on(&shared, &batch));
    say(&format!("shared among {kinds:?} and the first again: {found:.3?} of what is allowed"));
    assert!(found.iter().all(|d| *d < 1.0), "{found:?} of what is allowed");

    let mut parts = batch.split(2).into_iter().map(|part| on(&opened[..1], &part));
    let (mut mean, other) = (parts.next().unwrap(), parts.next().unwrap());
    mean.total = f64::midpoint(mean.total, other.total);
    for (name, gradient) in &mut mean.gradients {
        let other = &other.gradients[name].data;
        gradient.data.iter_mut().zip(other).for_each(|(a, b)| *a = f32::midpoint(*a, *b));
    }
    let found = deviations(&whole, &mean);
    assert!(found[0] > 3.0 && found[1] > 3.0, "{found:?}");
}

/// New weights reach every device: after them each computes what the first does.
#[test]
fn new_weights_reach_every_device() {
    let config = Preset::Tiny.config(3);
    let skies = skies();
    let opened: Vec<_> = devices().iter().map(|kind| kind.device().unwrap().autodiff()).collect();
    let devices: Vec<_> = opened.iter().chain(&opened[..1]).cloned().collect();
    let mut other = config.clone();
    other.seed += 1;
    let [network, moved] =
        [&config, &other].map(|config| Network::new(config, skies.len(), &opened[0]).unwrap());
    let mut shared = config.clone();
    shared.batch = devices.len();
    let batch = network.source(&shared, &skies).unwrap().prepare(1);
    let mut replicas = Replicas::new(network, &shared, &devices).unwrap();
    let before = replicas.gradients(batch.clone(), 1).value;
    replicas.write(&weights::read(&moved, "")).unwrap();
    let expected = Replicas::new(moved, &shared, &devices[..1]).unwrap().gradients(batch.clone(), 1).value;
    let found = replicas.gradients(batch, 1).value;
    assert!((found - expected).abs() < 2e-5 * expected, "{found} {expected}");
    assert!((before - expected).abs() > 1e-2 * expected, "{before} {expected}");
}

/// A weight that is off by a thousandth of itself, of the encoder or of the decoder, is seen by the comparison.
#[test]
fn a_device_that_computes_something_else_is_caught() {
    let config = Preset::Tiny.config(3);
    let kind = *devices().last().unwrap();
    let device = kind.device().unwrap();
    let weights = weights::read(&Network::new(&config, 2, &device).unwrap(), "");
    let expected = step_on(DeviceKind::Flex, DecoderBackend::Tensors, &config, None);
    for (part, at) in [("encoder.", 2), ("decoder.", 1)] {
        let mut broken = weights.clone();
        let named = broken.iter_mut().filter(|(name, _)| name.starts_with(part));
        let (name, weight) = named.max_by_key(|(_, weight)| weight.data.len()).unwrap();
        let name = name.clone();
        weight.data.iter_mut().for_each(|w| *w *= 1.001);
        let found = deviations(&expected, &step_on(kind, DecoderBackend::Tensors, &config, Some(&broken)));
        assert!(found[at] > 3.0, "{name}: {found:?}");
    }
}

/// Mixed precision moves losses by less than a hundredth, and the gradient by the decoder's weights too; and it does move
/// them, so that it was at work. Elsewhere the step is refused before it begins.
#[test]
fn bfloat16_computes_nearly_the_same_step() {
    let by = DecoderBackend::KernelsBfloat16;
    if let Err(error) = by.check() {
        say(&format!("bfloat16 skipped: {error}"));
        assert!(error.to_string().contains("take decoder_backend = kernels"), "{error}");
        return;
    }
    for config in [Preset::Tiny.config(3), Preset::Tiny.auto_decoder(3)] {
        let expected = step_on(DeviceKind::Flex, DecoderBackend::Kernels, &config, None);
        let found = step_on(DeviceKind::Flex, by, &config, None);
        for (name, value) in &expected.parts {
            let apart = (value - found.parts[name]).abs() / value.abs();
            assert!(apart < 1e-2, "{name}: {value}, in bfloat16 {}", found.parts[name]);
        }
        let apart = |decoder: bool| {
            let parts = expected.gradients.iter().filter(|(name, _)| name.starts_with("decoder.") == decoder);
            let [own, moved] = parts.fold([0.0; 2], |sums, (name, gradient)| {
                let pairs = gradient.data.iter().zip(&found.gradients[name].data);
                pairs
                    .map(|(x, y)| (f64::from(*x), f64::from(*y)))
                    .fold(sums, |[own, moved], (x, y)| [own + x * x, moved + (x - y) * (x - y)])
            });
            (moved / own).sqrt()
        };
        // the latent's is a sum over directions in which most of what the decoder's are made of cancels
        let (decoder, others) = (apart(true), apart(false));
        say(&format!("{:?} in bfloat16: gradients move by {decoder:.4} and {others:.4}", config.model.kind));
        assert!(
            (1e-4..0.03).contains(&decoder) && others < 0.15,
            "{decoder} {others} of the gradients' lengths"
        );
    }
}
