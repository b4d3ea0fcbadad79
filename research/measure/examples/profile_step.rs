//! Where the time of a training step goes.
//!
//! `cargo run --release -p veni-research --example profile_step -- DATA [small|tiny|paper] [key=value …]`

#![allow(clippy::print_stdout, reason = "a program for a terminal")]

use std::path::PathBuf;
use std::time::Instant;

use burn::tensor::Tensor;
use veni_core::data::Splits;
use veni_core::train::batch::Batches;
use veni_core::train::config::DecoderBackend;
use veni_core::train::network::{Network, Prepared};
use veni_core::train::optimiser::{Group, Optimiser};
use veni_core::train::presets::Preset;
use veni_core::train::step::{encode, tensor};
use veni_core::{Error, Result};

/// As the training example.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Steps that are measured, after one that is not.
const STEPS: u64 = 10;

/// Mean seconds of each part, in the order they first ran.
#[derive(Default)]
struct Clock(Vec<(&'static str, f64)>);

impl Clock {
    fn time<T>(&mut self, part: &'static str, counts: bool, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        let seconds = if counts { start.elapsed().as_secs_f64() / STEPS as f64 } else { 0.0 };
        match self.0.iter_mut().find(|(name, _)| *name == part) {
            Some((_, sum)) => *sum += seconds,
            None => self.0.push((part, seconds)),
        }
        result
    }
}

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [data, rest @ ..] = arguments.as_slice() else {
        return Err(Error::invalid("usage: profile_step DATA [PRESET] [key=value …]"));
    };
    let (preset, overrides) = match rest {
        [first, tail @ ..] if !first.contains('=') => (first.parse()?, tail),
        all => (Preset::Small, all),
    };
    let mut config = preset.config(9).with_overrides(overrides)?;
    config.data.folders = vec![PathBuf::from(data)];
    config.check()?;
    let splits = Splits::open(&config.data, config.seed)?;
    let device = config.device.device()?.autodiff();
    let mut network = Network::new(&config, splits.train.len(), &device)?;
    let groups = config.groups().into_iter();
    let groups = groups.map(|(prefix, g)| Group { prefix: prefix.into(), adam: g.adam });
    let mut optimiser = Optimiser::new(&network, groups.collect(), config.ema_decay)?;
    let Network::Veni(veni) = &network else {
        return Err(Error::invalid("only auto-encoders are profiled"));
    };
    let batches = Batches::new(&config, veni.stripes()?, &splits.train);
    let loss = Network::loss(&config, &device);

    let mut clock = Clock::default();
    for step in 1..=1 + STEPS {
        let counts = step > 1;
        let batch = clock.time("data (on another thread in a run)", counts, || batches.prepare(step));
        let prepared = Prepared::Panoramas(batch.clone());
        let mut gradients =
            |part, by| clock.time(part, counts, || network.gradients(&prepared, &loss, by, &device).1);
        gradients("whole step: gradients by tensor operations", DecoderBackend::Tensors);
        let found = gradients("whole step: gradients by kernels", DecoderBackend::Kernels);
        let rates = config.groups().into_iter().map(|(_, g)| g.learning_rate.at(step)).collect::<Vec<_>>();
        (network, _) = clock.time("whole step: Adam, clipping, average", counts, || {
            optimiser.step(network.clone(), &found, &rates)
        });
        let Network::Veni(veni) = &network else { unreachable!("made as one") };

        // the parts again, each on a graph of its own
        let posterior = clock.time("encoder alone: forward", counts, || encode(veni, &batch, &device));
        clock.time("encoder alone: backward", counts, || posterior.mean.sum().backward());
        let [rows, columns] = batch.loss_size;
        let shape = [batch.images, rows, columns, 3];
        let latent =
            tensor::<3>(&batch.noise, [batch.images, veni.latent_vectors(), 3], &device).require_grad();
        let directions = tensor(&batch.loss_directions, [rows * columns, 3], &device);
        let decoded = clock.time("decoder by tensor operations: forward", counts, || {
            veni.decoder.forward(latent.clone(), directions)
        });
        let image: Tensor<4> = decoded.clone().detach().reshape(shape).require_grad();
        clock.time("decoder by tensor operations: backward", counts, || decoded.sum().backward());
        let native = veni.decoder.native(latent)?;
        let directions = batch.loss_directions.as_chunks().0;
        let rays = directions.len();
        let values = clock.time("decoder by kernels: forward", counts, || native.forward(directions, rays));
        clock.time("decoder by kernels: backward", counts, || {
            native.backward(directions, rays, &vec![1.0; values.len()]).backward()
        });
        let target = tensor(&batch.target, shape, &device);
        let value =
            clock.time("losses alone: forward", counts, || loss.terms(step, image, target, None).total());
        clock.time("losses alone: backward", counts, || value.backward());
    }
    for (part, seconds) in clock.0 {
        println!("{part:44} {:8.1} ms", 1e3 * seconds);
    }
    Ok(())
}
