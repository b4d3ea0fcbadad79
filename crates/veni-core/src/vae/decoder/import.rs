//! The input order of RENI (2022).

use veni_light::model::{Conditioning, DecoderConfig, Equivariance, Invariance};

/// For every input of RENI (2022)'s first map, in its order, which row of [`Decoder::input`](super::Decoder::input)
/// it is: the program of 2022 stacks them otherwise. Their other maps have one order.
///
/// In our frame (its y is our z, latents and directions alike) theirs is, under SO(2),
/// - concat: ⟨z_i,xy, d_xy⟩, ⟨z_i,xy, z_j,xy⟩, |d_xy|, z_i,z, d_z;
/// - FiLM: |d_xy|, d_z, ⟨z_i,xy, d_xy⟩;
///
/// and under SO(3) or none the same as ours. The result is a permutation. `None` if RENI (2022) had no such network:
/// it has Gram matrices, plain inputs, FiLM or concat.
#[doc(hidden)]
pub fn reni_2022_inputs(config: &DecoderConfig, latent_vectors: usize) -> Option<Vec<usize>> {
    let n = latent_vectors;
    if config.invariance != Invariance::GramMatrix
        || config.encodes_directions()
        || config.encodes_condition()
    {
        return None;
    }
    let (height, radius, gram) = (n, n + 1, n + 2);
    match (config.conditioning, config.equivariance) {
        (Conditioning::Attention | Conditioning::Tokens, _) => None,
        (Conditioning::Concat, Equivariance::So2) => {
            let heights = gram + n * n;
            Some(
                (0..n)
                    .chain(gram..heights)
                    .chain([radius])
                    .chain(heights..heights + n)
                    .chain([height])
                    .collect(),
            )
        }
        (Conditioning::Film, Equivariance::So2) => Some([radius, height].into_iter().chain(0..n).collect()),
        (Conditioning::Concat, _) => Some((0..n + config.condition_inputs(n)).collect()),
        (Conditioning::Film, _) => Some((0..n).collect()),
    }
}
