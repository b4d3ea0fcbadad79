//! The latent's condition features: what the network is conditioned on apart from its products with the direction.
//! MODEL (17).

use super::Condition;
use super::input::encode;
use burn::tensor::Tensor;
use veni_light::model::{DecoderConfig, Equivariance, Invariance};

/// All of it as one vector per image: latents [B, N, 3] → [B, C].
///
/// - Vector Neurons: the numbers of [`Condition`], vector after vector;
/// - Gram matrix under SO(2): ⟨z_i,xy, z_j,xy⟩ row by row, then every z_z; under SO(3): ⟨z_i, z_j⟩;
/// - no equivariance: the latent itself.
///
/// `condition` is the Vector-Neuron layer of a network that has one.
pub(super) fn vector(config: &DecoderConfig, condition: Option<&Condition>, latent: Tensor<3>) -> Tensor<2> {
    let [batch, n, _] = latent.dims();
    let flat = |x: Tensor<3>| {
        let [_, tokens, width] = x.dims();
        x.reshape([batch, 1, tokens * width])
    };
    let gram = config.invariance == Invariance::GramMatrix && config.equivariance == Equivariance::So2;
    let features = if gram {
        let heights = latent.clone().narrow(2, 2, 1).reshape([batch, 1, n]);
        Tensor::cat(vec![flat(inner_products(latent.narrow(2, 0, 2))), heights], 2)
    } else {
        flat(of_each(config, condition, latent))
    };
    let features = if config.encodes_condition() { encode(features) } else { features };
    features.squeeze_dim(1)
}

/// The same by latent vector: [B, N, 3] → [B, N, C/N]. With a Gram matrix each has its row, and its z_z.
pub(super) fn tokens(config: &DecoderConfig, condition: Option<&Condition>, latent: Tensor<3>) -> Tensor<3> {
    let features = of_each(config, condition, latent);
    if config.encodes_condition() { encode(features) } else { features }
}

fn of_each(config: &DecoderConfig, condition: Option<&Condition>, latent: Tensor<3>) -> Tensor<3> {
    match (config.invariance, config.equivariance, condition) {
        (Invariance::GramMatrix, Equivariance::So2, _) => {
            let heights = latent.clone().narrow(2, 2, 1);
            Tensor::cat(vec![inner_products(latent.narrow(2, 0, 2)), heights], 2)
        }
        (Invariance::GramMatrix, Equivariance::So3, _) => inner_products(latent),
        (Invariance::Vn, Equivariance::So2 | Equivariance::So3, Some(condition)) => condition.forward(latent),
        (_, Equivariance::None, _) => latent,
        (Invariance::Vn, _, None) => unreachable!("a network with VN invariance holds its layer"),
    }
}

/// ⟨v_i, v_j⟩: [B, N, c] → [B, N, N].
fn inner_products(vectors: Tensor<3>) -> Tensor<3> {
    vectors.clone().matmul(vectors.swap_dims(1, 2))
}
