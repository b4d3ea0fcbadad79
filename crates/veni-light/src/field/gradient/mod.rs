//! The gradient of a loss on log radiance by the latent, in closed form: forward and backward of the folded
//! network, block by block, with nothing kept beyond a block.
//!
//! With the decoder fixed, the latent reaches the network in three places: the products zᵢ,xy · d_xy of the
//! directional input, the bias of the input projection, and one vector per layer. A block of directions goes
//! forward, its loss is taken, and it goes back while its activations are still in the second-level cache; what
//! is summed over all directions are those three gradients, a few hundred numbers. The rest of the chain (the
//! attention's two linear maps and the invariants) is taken once.
//!
//! Sums over directions run in a fixed order: the same bits whatever the number of threads.

mod backward;
mod block_equations;
mod chain;
mod jacobian;
mod lobe_equations;
mod lobes;
mod moments;
mod normal;
mod operations;
mod outer;
mod pass;
#[cfg(feature = "training")]
pub(crate) mod perceptron;
mod transposed;
#[cfg_attr(
    not(feature = "training"),
    allow(dead_code, reason = "only training asks for the gradient by the weights")
)]
mod weight_sums;

use super::Field;
use super::aligned::Aligned;
use crate::tasks;
use backward::{Backward, Sums};

pub(super) use jacobian::ValueOutput;
pub use moments::Moments;
pub use normal::{LocalQuadratic, NormalEquations};
pub(super) use transposed::Transposed;

/// Fewest directions of one task: a few blocks, so that all cores finish together.
const TASK: usize = 192;
/// Most tasks: each leaves sums of its own.
const TASKS: usize = 256;

/// A loss and its gradient with respect to the latent it was taken at.
#[derive(Clone, Debug, PartialEq)]
pub struct Gradient {
    /// The sum of what the loss gave for every direction.
    pub loss: f64,
    /// By the N latent vectors [x, y, z].
    pub vectors: Vec<[f32; 3]>,
    /// By the log exposure.
    pub log_exposure: f32,
}

impl Field {
    /// The gradient of Σᵢ ℓᵢ by the latent. `loss(i, p)` gets the log radiance p (r, g, b, exposure included) in
    /// direction i and gives ℓᵢ and its derivatives with respect to p; a loss that looks at the whole image is given as
    /// those derivatives, computed beforehand from [`Field::log_radiance_batch`].
    ///
    /// Costs the multiply-adds of two [`Field::log_radiance_batch`], on all cores; memory does not grow with
    /// the number of directions. p differs from that function's by rounding.
    pub fn gradient(
        &self,
        directions: &[[f32; 3]],
        loss: impl Fn(usize, [f32; 3]) -> (f64, [f32; 3]) + Sync,
    ) -> Gradient {
        let (weights, folded) = (&*self.weights, &*self.folded);
        let (mlp, n) = (&weights.mlp, weights.latent_vectors);
        let parts = in_tasks(directions, TASK, TASKS, |scratch, first, directions| {
            let mut sums = Sums::new(mlp, n);
            pulp::Arch::new().dispatch(Backward {
                mlp,
                folded,
                directions,
                loss: &|i, p| loss(first + i, p),
                sums: &mut sums,
                weights: None,
                scratch,
            });
            sums
        });
        let mut total = Sums::new(mlp, n);
        parts.iter().for_each(|part| total.add(part));
        chain::to_latent(weights, folded, &total)
    }
}

/// What `work` gives for parts of the directions, in their order, and in the same parts whatever the number of threads:
/// at most `most` tasks of a multiple of `least` directions. It gets scratch that it may keep, the index of the first
/// direction, and the directions.
fn in_tasks<T: Send>(
    directions: &[[f32; 3]],
    least: usize,
    most: usize,
    work: impl Fn(&mut Aligned, usize, &[[f32; 3]]) -> T + Sync,
) -> Vec<T> {
    let task = directions.len().div_ceil(most).next_multiple_of(least).max(least);
    let parts = directions.chunks(task).enumerate();
    tasks::map(parts, Aligned::default, |scratch, (at, part)| work(scratch, at * task, part))
}
