//! The network on each device of a run: all compute a part of every batch, at the same time. MODEL (34).
//!
//! The losses are means over panoramas, so the gradient of a batch is the mean of its parts' gradients, each weighted by
//! its panoramas. Gradients come to the host, where the optimiser is, and are added in the order of the devices, not in
//! that of their arrival: who is first changes nothing. Then all devices are given the new weights.
//!
//! On a processor the devices of a run are shares of its threads. What a step does one after the other on all of them (much
//! of an encoder's passes over memory), replicas do side by side.

use std::collections::BTreeMap;

use burn::tensor::Device;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::train::config::{DecoderBackend, TrainConfig};
use crate::train::loss::Loss;
use crate::train::network::{Network, Prepared};
use crate::vae::weights::{self, Weights};
use crate::{Error, Result};

/// The network on each device of a run.
#[derive(Debug)]
pub struct Replicas {
    all: Vec<Replica>,
    by: DecoderBackend,
}

#[derive(Debug)]
struct Replica {
    device: Device,
    network: Network,
    loss: Loss,
    /// Its own, where there are others.
    threads: Option<ThreadPool>,
}

/// What a batch, or a part of one, says.
#[derive(Debug, Default)]
pub struct Computed {
    /// The weighted sum of the losses.
    pub value: f64,
    /// The weighted losses by name.
    pub parts: BTreeMap<&'static str, f64>,
    /// Gradients of `value` by the parameters' paths.
    pub gradients: Weights,
}

impl Replicas {
    /// `network`, which lies on the first of `devices`, on each of them, with the losses of `config`.
    ///
    /// # Errors
    /// As [`Network::new`]; [`Error::Unsupported`] if threads cannot be started.
    pub fn new(network: Network, config: &TrainConfig, devices: &[Device]) -> Result<Self> {
        let by = config.decoder_backend;
        let threaded = config.device.is_processor() || by.is_kernels();
        let count = if threaded { (rayon::current_num_threads() / devices.len()).max(1) } else { 1 };
        let threads = |at: usize| {
            let named = move |n| format!("replica {at}, {n}");
            let pool = ThreadPoolBuilder::new().num_threads(count).thread_name(named).build();
            pool.map_err(|e| Error::unsupported(format!("cannot start {count} threads for a replica: {e}")))
        };
        let panoramas = match &network {
            Network::Veni(_) => 0,
            Network::Reni(reni) => reni.latents.panoramas(),
        };
        let start = weights::read(&network, "");
        let mut first = Some(network);
        let replica = |(at, device): (usize, &Device)| -> Result<Replica> {
            let network = match first.take() {
                Some(network) => network,
                None => weights::write(Network::new(config, panoramas, device)?, "", &start)?,
            };
            let threads = (devices.len() > 1).then(|| threads(at)).transpose()?;
            Ok(Replica { device: device.clone(), network, loss: Network::loss(config, device), threads })
        };
        Ok(Self { all: devices.iter().enumerate().map(replica).collect::<Result<_>>()?, by })
    }

    /// Takes the losses of `config` from now on.
    pub fn set_losses(&mut self, config: &TrainConfig) {
        for replica in &mut self.all {
            replica.loss = Network::loss(config, &replica.device);
        }
    }

    /// The network on the first device.
    ///
    /// # Panics
    /// Never: there is a first device.
    pub fn first(&self) -> &Network {
        &self.all[0].network
    }

    /// Losses and gradients of a batch, computed on each device in `accumulate` parts, one after the other.
    ///
    /// # Panics
    /// As [`Network::gradients`] and [`Prepared::split`].
    pub fn gradients(&self, batch: Prepared, accumulate: usize) -> Computed {
        let count = accumulate * self.all.len();
        if count == 1 {
            return self.all[0].compute(&batch, self.by);
        }
        let images = batch.images();
        let parts = batch.split(count);
        let mean = |replica: &Replica, parts: &[Prepared]| {
            let mut sum = Computed::default();
            for part in parts {
                sum.add(replica.compute(part, self.by), part.images() as f64 / images as f64);
            }
            sum
        };
        let shares = parts.chunks(accumulate);
        let means = on_each(self.all.iter().zip(shares), |(replica, parts)| {
            replica.on_its_threads(|| mean(replica, parts))
        });
        let mut means = means.into_iter();
        let mut sum = means.next().unwrap_or_default();
        means.for_each(|mean| sum.add(mean, 1.0));
        sum
    }

    /// Gives all devices these weights.
    ///
    /// # Errors
    /// As [`weights::write`].
    pub fn write(&mut self, weights: &Weights) -> Result<()> {
        let written = on_each(self.all.iter_mut(), |replica| {
            let network = replica.network.clone();
            replica.network = replica.on_its_threads(|| weights::write(network, "", weights))?;
            Ok(())
        });
        written.into_iter().collect()
    }
}

impl Replica {
    fn on_its_threads<T: Send>(&self, run: impl FnOnce() -> T + Send) -> T {
        match &self.threads {
            Some(pool) => pool.install(run),
            None => run(),
        }
    }

    fn compute(&self, batch: &Prepared, by: DecoderBackend) -> Computed {
        let (terms, gradients) = self.network.gradients(batch, &self.loss, by, &self.device);
        let (value, parts) = terms.values();
        Computed { value, parts, gradients: weights::gradients(&self.network, "", &gradients) }
    }
}

/// The results of `run`, in the order of `items`, each on a thread of its own; one item is done here.
fn on_each<I: Send, T: Send>(items: impl ExactSizeIterator<Item = I>, run: impl Fn(I) -> T + Sync) -> Vec<T> {
    if items.len() == 1 {
        return items.map(run).collect();
    }
    std::thread::scope(|scope| {
        let run = &run;
        let spawned: Vec<_> = items.map(|item| scope.spawn(move || run(item))).collect();
        let joined = spawned.into_iter().map(std::thread::ScopedJoinHandle::join);
        joined.map(|result| result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    })
}

impl Computed {
    /// Adds `share` of another.
    fn add(&mut self, other: Self, share: f64) {
        // elementwise, so cutting it into pieces for the threads cannot change a bit
        const PIECE: usize = 1 << 16;
        self.value += share * other.value;
        for (name, value) in other.parts {
            *self.parts.entry(name).or_default() += share * value;
        }
        let share = share as f32;
        for (name, mut gradient) in other.gradients {
            match self.gradients.get_mut(&name) {
                Some(sum) => (sum.data.par_chunks_mut(PIECE))
                    .zip(gradient.data.par_chunks(PIECE))
                    .for_each(|(sum, part)| sum.iter_mut().zip(part).for_each(|(s, g)| *s += share * g)),
                None => {
                    let scale = |piece: &mut [f32]| piece.iter_mut().for_each(|g| *g *= share);
                    gradient.data.par_chunks_mut(PIECE).for_each(scale);
                    self.gradients.insert(name, gradient);
                }
            }
        }
    }
}
