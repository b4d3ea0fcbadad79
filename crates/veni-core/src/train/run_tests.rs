//! Whole runs of the tiny preset on synthetic skies.

use std::fs;

use super::*;
use crate::data::random::{Purpose, stream};
use crate::latent::Latent;
use crate::model::Model;
use crate::panorama::{Panorama, Precision, WriteFormat, WriteOptions};
use crate::sphere::Equirect;
use crate::train::config::DecoderBy;
use crate::train::loss::LossForm;
use crate::train::presets::Preset;
use crate::train::schedule::{LearningRate, WeightSchedule};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A sky with a sun at `azimuth` over dark ground.
fn sky(azimuth: f32) -> Panorama {
    let sun = [azimuth.cos() * 0.8, azimuth.sin() * 0.8, 0.6];
    Panorama::from_fn(Equirect::new(32, 16), |d| {
        let toward = d.iter().zip(sun).map(|(a, b)| a * b).sum::<f32>();
        let base = if d[2] > 0.0 { [0.4, 0.6, 1.0] } else { [0.12, 0.1, 0.08] };
        base.map(|v| v + 20.0 * (12.0 * (toward - 1.0)).exp())
    })
}

/// A folder with `train/` (two skies) and `val/` (one), and a short run of the auto-encoder on it.
fn setup(steps: u64) -> (tempfile::TempDir, TrainConfig) {
    setup_of(Preset::Tiny.config(3), steps)
}

fn setup_of(config: TrainConfig, steps: u64) -> (tempfile::TempDir, TrainConfig) {
    let folder = tempfile::tempdir().unwrap();
    for (name, azimuth) in [("train/a", 0.3), ("train/b", 2.0), ("val/c", 4.0)] {
        let path = folder.path().join("data").join(name).with_extension("exr");
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        sky(azimuth).write(&path, &WriteOptions::new(WriteFormat::Exr(Precision::Float))).unwrap();
    }
    let mut config = config.with_overrides(&[format!("steps={steps}")]).unwrap();
    config.data.folders = vec![folder.path().join("data")];
    (folder, config)
}

/// Raises the stop flag, or panics, after an update.
struct After<'a> {
    step: u64,
    stop: &'a AtomicBool,
    panic: bool,
}

impl Progress for After<'_> {
    fn step(&mut self, report: &StepReport, _remaining: f64) {
        if report.step == self.step {
            assert!(!self.panic, "killed");
            self.stop.store(true, Ordering::Relaxed);
        }
    }
}

fn complete(trainer: &mut Trainer) {
    let finish = trainer.run(&AtomicBool::new(false), &mut crate::train::progress::Silent).unwrap();
    assert_eq!(finish, Finish::Complete);
}

fn file(folder: &Path, name: &str) -> Vec<u8> {
    fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Loss and step of every line, without wall-clock times.
fn losses(folder: &Path) -> Vec<(u64, Option<f64>)> {
    let text = String::from_utf8(file(folder, "metrics.jsonl")).unwrap();
    let record = |line: &str| serde_json::from_str::<serde_json::Value>(line).unwrap();
    text.lines().map(record).map(|r| (r["step"].as_u64().unwrap(), r["loss"].as_f64())).collect()
}

#[test]
fn stopped_and_killed_runs_continue_to_the_bit() {
    continues_to_the_bit(Preset::Tiny.config(3), &[]);
}

#[test]
fn an_auto_decoder_continues_to_the_bit_too() {
    let config = Preset::Tiny.auto_decoder(3);
    continues_to_the_bit(config, &["latents.safetensors"]);
}

fn continues_to_the_bit(config: TrainConfig, more: &[&str]) {
    let (folder, mut config) = setup_of(config, 4);
    let original = config.clone();
    config.report.checkpoint_every = 2;
    config.report.validate_every = 2;
    let [whole, stopped, killed] = ["whole", "stopped", "killed"].map(|name| folder.path().join(name));
    complete(&mut Trainer::create(&whole, config.clone(), "test").unwrap());

    let stop = AtomicBool::new(false);
    let mut trainer = Trainer::create(&stopped, config.clone(), "test").unwrap();
    let finish = trainer.run(&stop, &mut After { step: 3, stop: &stop, panic: false }).unwrap();
    assert_eq!((finish, trainer.steps_done()), (Finish::Stopped, 3));
    let mut trainer = Trainer::resume(&stopped, "test").unwrap();
    assert_eq!(trainer.steps_done(), 3);
    complete(&mut trainer);

    let mut trainer = Trainer::create(&killed, config, "test").unwrap();
    let mut progress = After { step: 3, stop: &stop, panic: true };
    let run = catch_unwind(AssertUnwindSafe(|| trainer.run(&AtomicBool::new(false), &mut progress)));
    assert!(run.is_err());
    let mut trainer = Trainer::resume(&killed, "test").unwrap();
    assert_eq!(trainer.steps_done(), 2, "the last checkpoint");
    complete(&mut trainer);

    for other in [&stopped, &killed] {
        let files = ["checkpoint/state.safetensors", "model.safetensors", "preview/step-000004.png"];
        for name in files.iter().chain(more) {
            assert!(file(&whole, name) == file(other, name), "{name} differs in {}", other.display());
        }
        assert_eq!(losses(&whole), losses(other));
    }
    // and another seed is another run
    let mut config = original;
    config.seed = 1;
    let path = folder.path().join("seed");
    complete(&mut Trainer::create(&path, config, "test").unwrap());
    assert_ne!(file(&whole, "checkpoint/state.safetensors"), file(&path, "checkpoint/state.safetensors"));
}

#[test]
fn a_tiny_model_learns_two_panoramas() {
    let (folder, mut config) = setup(150);
    config.augment = crate::data::AugmentConfig::default();
    config.loss.kld = WeightSchedule::Constant(0.0);
    let out = folder.path().join("run");
    complete(&mut Trainer::create(&out, config, "test").unwrap());
    let losses: Vec<f64> = losses(&out).into_iter().filter_map(|(_, loss)| loss).collect();
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (first, last) = (mean(&losses[..5]), mean(&losses[145..]));
    assert!(last < first / 4.0, "loss {first} to {last}");
    let model = Model::load(out.join("model.safetensors")).unwrap();
    assert!(model.has_encoder() && model.has_prior());
    let training = model.info().training.clone().unwrap();
    assert_eq!((training.seed, training.command.as_str()), (0, "test"));
}

#[test]
fn an_auto_decoder_learns_its_panoramas_and_leaves_its_table() {
    let mut config = Preset::Tiny.auto_decoder(3);
    config.report.validate_every = 0;
    config.report.stored = crate::train::config::Stored::F32;
    let (folder, mut config) = setup_of(config, 150);
    config.latents.as_mut().unwrap().free_exposure = true;
    let out = folder.path().join("run");
    let mut trainer = Trainer::create(&out, config, "test").unwrap();
    complete(&mut trainer);
    let losses: Vec<f64> = losses(&out).into_iter().filter_map(|(_, loss)| loss).collect();
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (first, last) = (mean(&losses[..5]), mean(&losses[145..]));
    assert!(last < first / 3.0, "loss {first} to {last}");

    let model = Model::load(out.join("model.safetensors")).unwrap();
    assert!(!model.has_encoder() && model.has_prior());
    assert_eq!(model.config().kind, crate::model::ModelKind::Reni);
    // the paper's network: the lighting world decodes it
    assert!(model.decoder().unwrap().condition(&Latent::from_seed(&model.prior(), 1)).is_ok());
    let bytes = file(&out, "latents.safetensors");
    let (_, header) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
    let about: serde_json::Value =
        serde_json::from_str(&header.metadata().as_ref().unwrap()["veni-latents"]).unwrap();
    assert_eq!(about["panoramas"], serde_json::json!(["a", "b"]));
    assert_eq!(about["model"], model.hash());
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let table = weights::read(trainer.network(), "");
    for name in ["mean", "log_variance", "scale"] {
        let found: Vec<f32> = tensors
            .tensor(name)
            .unwrap()
            .data()
            .as_chunks()
            .0
            .iter()
            .map(|b| f32::from_le_bytes(*b))
            .collect();
        assert_eq!(found, table[&format!("latents.{name}")].data, "{name}");
    }
}

#[test]
fn every_way_to_condition_learns_in_both_systems() {
    for conditioning in ["film", "concat", "tokens"] {
        for config in [Preset::Tiny.config(3), Preset::Tiny.auto_decoder(3)] {
            // the sines as their authors drive them: with plain inputs
            let plain = if conditioning == "tokens" { "directions" } else { "none" };
            let options = [
                format!("model.decoder.conditioning={conditioning}"),
                format!("model.decoder.encoding={plain}"),
                "model.decoder.omega=10".to_owned(),
                "report.validate_every=0".to_owned(),
            ];
            let mut config = config.with_overrides(&options).unwrap();
            config.augment = crate::data::AugmentConfig::default();
            let (folder, config) = setup_of(config, 60);
            let out = folder.path().join("run");
            complete(&mut Trainer::create(&out, config.clone(), "test").unwrap());
            let losses: Vec<f64> = losses(&out).into_iter().filter_map(|(_, loss)| loss).collect();
            let (first, last) = (losses[..5].iter().sum::<f64>(), losses[55..].iter().sum::<f64>());
            let system = (conditioning, config.model.kind);
            assert!(last < 0.9 * first, "{system:?}: {first} to {last}");
            let model = Model::load(out.join("model.safetensors")).unwrap();
            assert_eq!(model.config(), &config.model);
        }
    }
}

#[test]
fn a_used_folder_and_a_damaged_checkpoint_are_refused() {
    let (folder, mut config) = setup(1);
    let out = folder.path().join("run");
    complete(&mut Trainer::create(&out, config.clone(), "test").unwrap());
    let message = Trainer::create(&out, config.clone(), "test").unwrap_err().to_string();
    assert!(message.contains("not empty") && message.contains("--resume"), "{message}");
    let state = out.join("checkpoint/state.safetensors");
    let bytes = fs::read(&state).unwrap();
    fs::write(&state, &bytes[..bytes.len() / 2]).unwrap();
    let message = Trainer::resume(&out, "test").unwrap_err().to_string();
    assert!(message.contains("state.safetensors") && message.contains("damaged"), "{message}");
    config.data.folders = vec![folder.path().join("nowhere")];
    let message = Trainer::create(&folder.path().join("other"), config, "test").unwrap_err().to_string();
    assert!(message.contains("nowhere"), "{message}");
    assert!(!folder.path().join("other").exists(), "nothing is left behind");
}

/// The whole chain, encoder to weighted loss: the analytic slope along a random direction of each parameter
/// tensor against a central difference.
#[test]
fn gradients_of_the_whole_loss_match_finite_differences() {
    let (folder, mut config) = setup(1);
    config.loss.ldr_mse = WeightSchedule::Constant(1.0);
    // |·| has a kink at every pixel whose gradient error is 0; too many for a finite step in f32
    config.loss.mage = WeightSchedule::Constant(0.0);
    // one scene whatever the presets draw: others have kinks of the display curve within the step
    config.augment = crate::data::AugmentConfig::default();
    gradients_match(&folder.path().join("run"), config);
}

/// The same from the table to the loss of an auto-decoder, in both forms, with every term that it can have.
#[test]
fn gradients_of_an_auto_decoder_match_finite_differences() {
    for form in [LossForm::Reference, LossForm::Corrected] {
        let mut config = Preset::Tiny.auto_decoder(3);
        config.loss.form = form;
        config.loss.kld = WeightSchedule::Constant(0.01);
        config.loss.level = WeightSchedule::Constant(1.0);
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
    let loss_of = &trainer.stages[0].loss;
    let value = |veni: &Network| veni.terms(&batch, loss_of, &trainer.device).total();
    let both = [DecoderBy::Tensors, DecoderBy::Kernels].map(|by| {
        let (terms, gradients) = veni.gradients(&batch, loss_of, by, &trainer.device);
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
        // along the gradient, where the slope is large, and a random direction, so that no component hides
        let mut rng = stream(5, Purpose::Fit, 0, slot);
        let random: Vec<f64> = gradient.data.iter().map(|_| crate::data::random::normal(&mut rng)).collect();
        let gradient: Vec<f64> = gradient.data.iter().map(|g| f64::from(*g)).collect();
        let length = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-30);
        let (a, b) = (length(&gradient), length(&random));
        let direction: Vec<f64> = gradient.iter().zip(&random).map(|(g, r)| g / a + r / b).collect();
        let slope: f64 = direction.iter().zip(&gradient).map(|(d, g)| d * g).sum();
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
        let error = differences.iter().map(|d| (d - slope).abs()).fold(f64::INFINITY, f64::min);
        assert!(error < 1e-3 + 0.02 * slope.abs(), "{name}: differences {differences:?}, gradient {slope}");
        checked += usize::from(slope.abs() > 1e-2);
    }
    assert!(
        checked > gradients.len() / 2,
        "only {checked} of {} slopes rise above the noise",
        gradients.len()
    );
}

/// The run with `[[stage]]` sections as they stand in a file.
fn staged(config: &TrainConfig, stages: &str) -> TrainConfig {
    let text = config.to_toml().unwrap() + stages;
    TrainConfig::from_toml(&text).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_single_stage_is_the_run_without_stages() {
    let (folder, config) = setup(6);
    let [plain, one] = ["plain", "one"].map(|name| folder.path().join(name));
    complete(&mut Trainer::create(&plain, config.clone(), "test").unwrap());
    let config = staged(&config, "\n[[stage]]\nname = \"all\"\nsteps = 6\n");
    complete(&mut Trainer::create(&one, config, "test").unwrap());
    for name in ["checkpoint/state.safetensors", "model.safetensors", "preview/step-000006.png"] {
        assert!(file(&plain, name) == file(&one, name), "{name}");
    }
}

#[test]
fn each_stage_has_its_own_data_rates_and_schedules() {
    let (folder, mut config) = setup(7);
    // other skies, and one that validates the run
    let first = folder.path().join("first");
    fs::create_dir(&first).unwrap();
    for (name, azimuth) in [("d", 1.0), ("e", 5.0)] {
        let path = first.join(name).with_extension("exr");
        sky(azimuth).write(&path, &WriteOptions::new(WriteFormat::Exr(Precision::Float))).unwrap();
    }
    config.report.validate_every = 0;
    let stages = format!(
        "\n[[stage]]\nname = \"a\"\nsteps = 4\nbatch = 1\ndata.folders = [{first:?}, {:?}]\nloss.kld = 0\n\
         \n[[stage]]\nname = \"b\"\nsteps = 3\ndecoder.learning_rate.rate = 0.25\ndecoder.learning_rate.warm_up = 1\n",
        folder.path().join("data/val/c.exr")
    );
    let config = staged(&config, &stages);
    let out = folder.path().join("run");
    let mut trainer = Trainer::create(&out, config.clone(), "test").unwrap();
    let own = trainer.stages[0].data.as_ref().unwrap();
    let names: Vec<_> = own.items().iter().map(crate::data::Item::name).collect();
    assert_eq!(names, ["d", "e"], "what validates is not trained on");
    complete(&mut trainer);
    let text = String::from_utf8(file(&out, "metrics.jsonl")).unwrap();
    let lines: Vec<serde_json::Value> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let updates: Vec<_> = lines.iter().filter(|line| line.get("loss").is_some()).collect();
    let stages: Vec<_> = updates.iter().map(|line| line["stage"].as_str().unwrap()).collect();
    assert_eq!(stages.concat(), "aaaabbb");
    assert_eq!(
        updates.iter().map(|line| line["step"].as_u64().unwrap()).collect::<Vec<_>>(),
        [1, 2, 3, 4, 5, 6, 7]
    );
    assert!(updates[..4].iter().all(|line| line["parts"].get("kld").is_none()));
    assert!(updates[4..].iter().all(|line| line["parts"].get("kld").is_some()));
    // rates count from the stage's first update, and fall until its last
    let rate = |at: usize| updates[at]["learning_rate"]["decoder"].as_f64().unwrap();
    assert_eq!((rate(0), rate(4), rate(5)), (0.0, 0.0, 0.25));
    let LearningRate::Cosine { rate: high, warm_up, floor, .. } = config.decoder.learning_rate else {
        panic!("tiny's schedule")
    };
    let own = LearningRate::Cosine { rate: high, warm_up, steps: 4, floor, periodic: false };
    assert_eq!(rate(3), own.at(3));
    // validated where a stage ends
    let validations = lines.iter().filter(|line| line.get("validation").is_some());
    assert_eq!(validations.map(|line| line["step"].as_u64().unwrap()).collect::<Vec<_>>(), [4, 7]);
    let training = Model::load(out.join("model.safetensors")).unwrap().info().training.clone().unwrap();
    assert_eq!(training.data, "2 panoramas of data; a: first, c.exr");
}

/// The losses are means over the batch: in how many parts it is computed changes nothing but rounding.
#[test]
fn accumulated_gradients_are_those_of_the_whole_batch() {
    let (folder, mut config) = setup(1);
    config.batch = 4;
    config.loss.log_mse = WeightSchedule::Constant(0.3);
    config.loss.hdr_mse = WeightSchedule::Constant(0.3);
    for form in [LossForm::Corrected, LossForm::Reference] {
        config.loss.form = form;
        let computed = |accumulate: usize, batch: usize| {
            let mut config = config.clone();
            (config.accumulate, config.batch) = (accumulate, batch);
            let out = folder.path().join(format!("{form:?}-{accumulate}-{batch}"));
            let trainer = Trainer::create(&out, config, "test").unwrap();
            let running = &trainer.stages[0];
            let source = trainer.network.source(&running.stage.config, &trainer.splits.train).unwrap();
            trainer.gradients(&running.stage, &running.loss, source.prepare(1))
        };
        let whole = computed(1, 4);
        for parts in [2, 4] {
            let sum = computed(parts, 4);
            assert_eq!(sum.parts.len(), whole.parts.len());
            for (name, value) in &whole.parts {
                // a mean whose largest terms are a sun's rounds at 1.5e-5
                let other = sum.parts[name];
                assert!(
                    (other - value).abs() < 1e-4 * value,
                    "{form:?}, {parts} parts, {name}: {other} {value}"
                );
            }
            let distance = distance(&sum, &whole);
            assert!(distance < 1e-4, "{form:?}, {parts} parts: {distance}");
        }
        // half of the batch is something else
        assert!(distance(&computed(1, 2), &whole) > 1e-2);
    }
}

/// The largest relative difference of a parameter's gradient.
fn distance(a: &Computed, b: &Computed) -> f64 {
    let norm =
        |values: &mut dyn Iterator<Item = f32>| values.map(|v| f64::from(v).powi(2)).sum::<f64>().sqrt();
    let largest = norm(&mut b.gradients.values().flat_map(|g| g.data.iter().copied()));
    let one = |(name, g): (&String, &weights::Weight)| {
        let other = &b.gradients[name];
        let difference = norm(&mut g.data.iter().zip(&other.data).map(|(x, y)| x - y));
        // parameters whose gradient is rounding alone are measured by the whole
        difference / norm(&mut other.data.iter().copied()).max(1e-3 * largest)
    };
    a.gradients.iter().map(one).fold(0.0, f64::max)
}

#[test]
fn a_run_that_ended_while_it_began_can_be_begun_again() {
    let (folder, config) = setup(1);
    let out = folder.path().join("run");
    fs::create_dir_all(out.join("checkpoint")).unwrap();
    fs::write(out.join("checkpoint/.state.safetensors.0123456789abcdef-0.part"), "half").unwrap();
    assert!(is_free(&out).unwrap());
    complete(&mut Trainer::create(&out, config.clone(), "test").unwrap());
    assert!(leftovers(&out).unwrap().is_empty() && !is_free(&out).unwrap());
    // a checkpoint of work done is never overwritten
    fs::remove_file(out.join("config.toml")).unwrap();
    for name in ["metrics.jsonl", "model.safetensors"] {
        fs::remove_file(out.join(name)).unwrap();
    }
    fs::remove_dir_all(out.join("preview")).unwrap();
    assert!(Trainer::create(&out, config, "test").unwrap_err().to_string().contains("not empty"));
}
