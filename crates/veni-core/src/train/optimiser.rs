//! Adam over parameter groups, with clipping per group, decoupled weight decay and an average of the weights.
//!
//! For each parameter θ with gradient g at update t = 1, 2, …, in the order of Kingma & Ba (2015):
//! ```text
//! g ← g · min(1, c / (‖g‖ + 1e-6))            ‖·‖ over all gradients of the group, c = clip
//! m ← m + (1 − β₁)(g − m),   v ← β₂ v + (1 − β₂) g²
//! θ ← θ − lr · weight_decay · θ                (Loshchilov & Hutter 2019)
//! θ ← θ − lr/(1 − β₁ᵗ) · m / (√v / √(1 − β₂ᵗ) + ε)
//! e ← d·e + (1 − d)·θ,   d = min(ema_decay, t/(t + 9))
//! ```
//! State and arithmetic live in host memory, one fused pass over each parameter: on a CPU device that is five
//! times faster than a chain of tensor operations, the same on every device, and saved as it is. Sums run in a
//! fixed order, so a step is the same to the bit whatever the threads do.

use burn::module::Module;
use burn::tensor::Gradients;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::vae::weights::{self, Weights};
use crate::{Error, Result};
use veni_light::model::Array;

/// Adam's constants for one group.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AdamConfig {
    /// β₁, decay of the first moment.
    pub beta1: f64,
    /// β₂, decay of the second moment.
    pub beta2: f64,
    /// ε, added to the root of the second moment.
    pub epsilon: f64,
    /// Decoupled weight decay; 0 is plain Adam.
    pub weight_decay: f64,
    /// Largest gradient norm of the group; absent: no clipping.
    #[serde(default)]
    pub clip: Option<f64>,
}

impl Default for AdamConfig {
    fn default() -> Self {
        Self { beta1: 0.9, beta2: 0.999, epsilon: 1e-8, weight_decay: 0.0, clip: Some(0.5) }
    }
}

/// Parameters whose path starts with `prefix`, trained alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// First part of the dotted path, e.g. `decoder`.
    pub prefix: String,
    /// Constants.
    pub adam: AdamConfig,
}

/// What one update did to a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroupReport {
    /// Euclidean norm of the group's gradient before clipping.
    pub gradient_norm: f64,
    /// Learning rate used.
    pub learning_rate: f64,
}

/// Adam's state: weights, moments and averaged weights of every trained parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Optimiser {
    groups: Vec<Group>,
    ema_decay: f64,
    updates: u64,
    weights: Weights,
    /// What belongs to each weight, under its path.
    slots: std::collections::BTreeMap<String, Slot>,
}

#[derive(Clone, Debug, PartialEq)]
struct Slot {
    group: usize,
    first: Vec<f32>,
    second: Vec<f32>,
    average: Vec<f32>,
}

/// The four tensors kept for each parameter, by prefix of their names in a checkpoint.
const PARTS: [&str; 4] = ["weight", "first", "second", "average"];

impl Optimiser {
    /// Fresh state for the trained parameters of `module`.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a parameter belongs to no group.
    pub fn new<M: Module>(module: &M, groups: Vec<Group>, ema_decay: f64) -> Result<Self> {
        let weights = weights::read(module, "");
        let mut slots = std::collections::BTreeMap::new();
        for (path, weight) in &weights {
            let inside = |g: &Group| path.strip_prefix(&g.prefix).is_some_and(|rest| rest.starts_with('.'));
            let group = groups.iter().position(inside);
            let group =
                group.ok_or_else(|| Error::invalid(format!("parameter {path} is in no optimiser group")))?;
            let zeros = vec![0.0; weight.data.len()];
            let average = weight.data.clone();
            slots.insert(path.clone(), Slot { group, first: zeros.clone(), second: zeros, average });
        }
        Ok(Self { groups, ema_decay, updates: 0, weights, slots })
    }

    /// Other constants for the groups, whose parameters stay.
    ///
    /// # Panics
    /// If the groups are not the same ones.
    pub fn set_groups(&mut self, groups: Vec<Group>) {
        let prefixes = |groups: &[Group]| groups.iter().map(|g| g.prefix.clone()).collect::<Vec<_>>();
        assert_eq!(prefixes(&groups), prefixes(&self.groups), "the optimiser's groups");
        self.groups = groups;
    }

    /// Number of updates made.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// One update with `learning_rates[g]` for group g. Parameters without a gradient keep weight and moments.
    ///
    /// # Panics
    /// If there is not one learning rate per group, or `module` is of another shape than the state.
    pub fn step<M: Module>(
        &mut self,
        module: M,
        grads: &Gradients,
        learning_rates: &[f64],
    ) -> (M, Vec<GroupReport>) {
        let reports = self.update(&weights::gradients(&module, "", grads), learning_rates);
        let module =
            weights::write(module, "", self.weights()).expect("the module that the state was made for");
        (module, reports)
    }

    /// One update by gradients under the parameters' paths; [`Optimiser::weights`] are then to be put into the module.
    ///
    /// # Panics
    /// If there is not one learning rate per group, or a gradient that belongs to no parameter.
    pub fn update(&mut self, grads: &Weights, learning_rates: &[f64]) -> Vec<GroupReport> {
        assert_eq!(learning_rates.len(), self.groups.len(), "one learning rate per optimiser group");
        let norms = self.norms(grads);
        self.updates += 1;
        let average_decay = self.ema_decay.min(self.updates as f64 / (self.updates as f64 + 9.0));
        let rules: Vec<_> = (self.groups.iter().zip(learning_rates).zip(&norms))
            .map(|((group, &rate), &norm)| Rule::new(&group.adam, rate, norm, self.updates, average_decay))
            .collect();
        for ((path, slot), weight) in self.slots.iter_mut().zip(self.weights.values_mut()) {
            if let Some(gradient) = grads.get(path) {
                slot.update(&mut weight.data, &gradient.data, &rules[slot.group]);
            }
        }
        let reports = norms.iter().zip(learning_rates);
        reports.map(|(&gradient_norm, &learning_rate)| GroupReport { gradient_norm, learning_rate }).collect()
    }

    /// Current weights.
    pub fn weights(&self) -> &Weights {
        &self.weights
    }

    /// Averaged weights.
    pub fn averages(&self) -> Weights {
        let average = |(path, weight): (&String, &Array)| {
            let data = self.slots[path].average.clone();
            (path.clone(), Array { shape: weight.shape.clone(), data })
        };
        self.weights.iter().map(average).collect()
    }

    /// Everything, for a checkpoint: `weight.*`, `first.*`, `second.*`, `average.*`.
    pub fn state(&self) -> Weights {
        let mut out = Weights::new();
        for ((path, slot), weight) in self.slots.iter().zip(self.weights.values()) {
            for (part, data) in PARTS.iter().zip([&weight.data, &slot.first, &slot.second, &slot.average]) {
                let stored = Array { shape: weight.shape.clone(), data: data.clone() };
                out.insert(format!("{part}.{path}"), stored);
            }
        }
        out
    }

    /// Continues from `state` after `updates` updates; put [`Optimiser::weights`] into the module afterwards.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming a tensor that is missing, superfluous or of another shape.
    pub fn restore(&mut self, mut state: Weights, updates: u64) -> Result<()> {
        for ((path, slot), weight) in self.slots.iter_mut().zip(self.weights.values_mut()) {
            let targets = [&mut weight.data, &mut slot.first, &mut slot.second, &mut slot.average];
            for (part, target) in PARTS.iter().zip(targets) {
                let name = format!("{part}.{path}");
                let found =
                    state.remove(&name).ok_or_else(|| Error::invalid(format!("tensor {name} is missing")))?;
                if found.shape != weight.shape {
                    return Err(Error::invalid(format!(
                        "tensor {name} has shape {:?}, the model needs {:?}",
                        found.shape, weight.shape
                    )));
                }
                *target = found.data;
            }
        }
        if let Some(name) = state.keys().next() {
            return Err(Error::invalid(format!("tensor {name} belongs to no parameter of this model")));
        }
        self.updates = updates;
        Ok(())
    }

    fn norms(&self, grads: &Weights) -> Vec<f64> {
        let mut squares = vec![0.0; self.groups.len()];
        for (path, gradient) in grads {
            squares[self.slots[path].group] += square_sum(&gradient.data);
        }
        squares.into_iter().map(f64::sqrt).collect()
    }
}

/// Numbers that one thread takes on at a time.
const PIECE: usize = 1 << 16;

/// Σ g², in an order that does not depend on the threads.
fn square_sum(values: &[f32]) -> f64 {
    const LANES: usize = 8;
    let piece = |values: &[f32]| {
        let (rows, rest) = values.as_chunks::<LANES>();
        let mut lanes = [0.0; LANES];
        for row in rows {
            for (lane, g) in lanes.iter_mut().zip(row) {
                *lane += f64::from(*g) * f64::from(*g);
            }
        }
        lanes.iter().sum::<f64>() + rest.iter().map(|g| f64::from(*g) * f64::from(*g)).sum::<f64>()
    };
    values.par_chunks(PIECE).map(piece).collect::<Vec<_>>().into_iter().sum()
}

/// The scalars of one update of one group.
struct Rule {
    clip: f32,
    keep1: f32,
    beta2: f32,
    keep2: f32,
    shrink: f32,
    rate: f32,
    root: f32,
    epsilon: f32,
    average: f32,
}

impl Rule {
    fn new(adam: &AdamConfig, rate: f64, norm: f64, updates: u64, average: f64) -> Self {
        let t = updates as f64;
        Self {
            clip: adam.clip.map_or(1.0, |c| (c / (norm + 1e-6)).min(1.0)) as f32,
            keep1: (1.0 - adam.beta1) as f32,
            beta2: adam.beta2 as f32,
            keep2: (1.0 - adam.beta2) as f32,
            shrink: (1.0 - rate * adam.weight_decay) as f32,
            rate: (rate / (1.0 - adam.beta1.powf(t))) as f32,
            root: (1.0 - adam.beta2.powf(t)).sqrt() as f32,
            epsilon: adam.epsilon as f32,
            average: (1.0 - average) as f32,
        }
    }
}

impl Slot {
    fn update(&mut self, weights: &mut [f32], gradient: &[f32], rule: &Rule) {
        // elementwise, so cutting it into pieces for the threads cannot change a bit
        let weights = weights.par_chunks_mut(PIECE);
        let moments = self.first.par_chunks_mut(PIECE).zip(self.second.par_chunks_mut(PIECE));
        let rest = self.average.par_chunks_mut(PIECE).zip(gradient.par_chunks(PIECE));
        weights.zip(moments).zip(rest).for_each(|((w, (m, v)), (e, g))| {
            for ((((w, m), v), e), g) in w.iter_mut().zip(m).zip(v).zip(e).zip(g) {
                let g = g * rule.clip;
                *m += rule.keep1 * (g - *m);
                *v = *v * rule.beta2 + rule.keep2 * g * g;
                *w *= rule.shrink;
                *w -= rule.rate * (*m / (v.sqrt() / rule.root + rule.epsilon));
                *e += rule.average * (*w - *e);
            }
        });
    }
}

#[cfg(test)]
mod tests;
