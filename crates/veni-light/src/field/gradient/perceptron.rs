//! The decoder for several latents, with the gradient with respect to its weights too: what training runs in place of tensor
//! operations.
//!
//! Conditioning (latent to [`Conditioned`]) is a few small matrices and stays with whoever trains; here is what runs for
//! every direction. The way back takes the derivatives with respect to log radiance, so that a loss may look at whole
//! images. It goes forward once more, block by block: keeping the activations of a batch costs more time in memory than
//! that.
//!
//! Directions are split into tasks by their number alone and tasks are added in order: the same bits whatever the
//! number of threads.

use super::backward::{Backward, Sums};
use super::weight_sums::{WeightSums, layout};
use crate::compact::Lights;
use crate::field::Folded;
use crate::field::aligned::Aligned;
use crate::field::bfloat16::Bfloat16;
use crate::field::block::Blocks;
use crate::field::mlp::Mlp;
use crate::tasks;

/// Directions of a forward task.
const FORWARD: usize = 192;
/// Fewest directions of a backward task, and about how many tasks: each has sums for all weights.
const BACKWARD: usize = 256;
const TASKS: usize = 16;

/// The weights that meet a direction, packed.
#[derive(Debug)]
pub struct Perceptron {
    mlp: Mlp,
}

/// What conditioning leaves of one latent.
#[derive(Clone, Debug)]
pub struct Conditioned(Folded);

/// Gradients, summed over directions.
#[derive(Clone, Debug)]
pub struct Gradients {
    /// One per image.
    pub images: Vec<ConditionedGradient>,
    /// By the weights, summed over images: tensor name (`input.weight`, `layers.0.norm1.gamma`, …) and row-major
    /// values.
    pub weights: Vec<(String, Vec<f32>)>,
}

/// Gradients with respect to what conditioning leaves of a latent.
#[derive(Clone, Debug)]
pub struct ConditionedGradient {
    /// By x and y of the N latent vectors, through the directional input.
    pub vectors: Vec<[f32; 2]>,
    /// By what is added before the first layer, then after each, [1 + layers, h].
    pub added: Vec<f32>,
}

impl Perceptron {
    /// From named tensors, row-major: `input.weight`, `layers.{l}.norm1.gamma`, …, `output.bias`.
    pub fn new<'a>(hidden: usize, layers: usize, tensor: impl Fn(&str) -> &'a [f32]) -> Self {
        Self { mlp: Mlp::new(hidden, layers, tensor) }
    }

    /// The same, with matrices but for the output's multiplied in bfloat16.
    pub fn in_bfloat16(self, token: Bfloat16) -> Self {
        Self { mlp: self.mlp.in_bfloat16(token) }
    }

    /// N vectors [x, y, z], and for the first layer and after each layer what is added there, h numbers each.
    ///
    /// # Panics
    /// If there are not 1 + layers of h.
    pub fn conditioned(&self, vectors: &[[f32; 3]], added: &[&[f32]]) -> Conditioned {
        let (hidden, layers, padded) = (self.mlp.hidden, self.mlp.layers.len(), self.mlp.padded());
        let fits = added.len() == 1 + layers && added.iter().all(|a| a.len() == hidden);
        assert!(fits, "{layers} layers of {hidden} take {} vectors of {hidden}", 1 + layers);
        let mut input_bias = added[0].to_vec();
        input_bias.resize(padded, 0.0);
        Conditioned(Folded {
            vectors: vectors.iter().map(|[x, y, _]| [*x, *y]).collect(),
            input_bias,
            no_bias: vec![0.0; padded],
            shift: added[1..].iter().map(|shift| shift.to_vec()).collect(),
            lobes: Vec::new(),
            lights: Lights::default(),
            emitters: Vec::new(),
            log_exposure: 0.0,
        })
    }

    /// Log radiance [B · R] of each image in its directions.
    pub fn forward(&self, images: &[Conditioned], directions: &[&[[f32; 3]]]) -> Vec<[f32; 3]> {
        let mut out = vec![[0.0; 3]; directions.iter().map(|d| d.len()).sum()];
        let mut rest = out.as_mut_slice();
        let mut parts = Vec::new();
        for (image, directions) in images.iter().zip(directions) {
            for directions in directions.chunks(FORWARD) {
                let (head, tail) = rest.split_at_mut(directions.len());
                parts.push((image, directions, head));
                rest = tail;
            }
        }
        tasks::each(
            parts.into_iter(),
            Aligned::default,
            |scratch, (Conditioned(folded), directions, out)| {
                let mlp = &self.mlp;
                pulp::Arch::new().dispatch(Blocks {
                    mlp,
                    folded,
                    directions,
                    out,
                    log: true,
                    lights: false,
                    scratch,
                });
            },
        );
        out
    }

    /// The gradient of Σ gradient · log radiance; `gradients` are as [`Perceptron::forward`] returns log radiance.
    pub fn backward(
        &self,
        images: &[Conditioned],
        directions: &[&[[f32; 3]]],
        gradients: &[[f32; 3]],
    ) -> Gradients {
        let mlp = &self.mlp;
        let all: usize = directions.iter().map(|d| d.len()).sum();
        let task = all.div_ceil(TASKS).max(BACKWARD);
        let mut parts = Vec::new();
        let mut rest = gradients;
        for (i, (image, directions)) in images.iter().zip(directions).enumerate() {
            let even = directions.len().div_ceil(directions.len().div_ceil(task).max(1)).max(1);
            for directions in directions.chunks(even) {
                let (head, tail) = rest.split_at(directions.len());
                parts.push((i, image, directions, head));
                rest = tail;
            }
        }
        let parts = tasks::map(
            parts.into_iter(),
            Aligned::default,
            |scratch, (i, Conditioned(folded), directions, gradients)| {
                let mut sums = Sums::new(mlp, folded.vectors.len());
                let mut weights = WeightSums::new(mlp);
                pulp::Arch::new().dispatch(Backward {
                    mlp,
                    folded,
                    directions,
                    loss: &|i, _| (0.0, gradients[i]),
                    sums: &mut sums,
                    weights: Some(&mut weights),
                    scratch,
                });
                (i, sums, weights)
            },
        );
        let mut sums: Vec<_> = images.iter().map(|Conditioned(f)| Sums::new(mlp, f.vectors.len())).collect();
        let mut weights = WeightSums::new(mlp);
        // collected in order, added in order
        for (i, part, part_weights) in parts {
            sums[i].add(&part);
            weights.add(&part_weights);
        }
        let image = |sums: Sums| ConditionedGradient {
            vectors: sums.vectors.iter().map(|v| v.map(|c| c as f32)).collect(),
            added: sums.added.iter().map(|a| *a as f32).collect(),
        };
        let mut values = weights.values.as_slice();
        let tensor = |(name, len)| {
            let (head, tail) = values.split_at(len);
            values = tail;
            (name, head.to_vec())
        };
        Gradients {
            images: sums.into_iter().map(image).collect(),
            weights: layout(mlp).into_iter().map(tensor).collect(),
        }
    }
}
