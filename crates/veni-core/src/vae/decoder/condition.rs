//! The Vector-Neuron invariants of the latent vectors.

use crate::nn::uniform;
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use veni_light::model::VnReluForm;
use veni_light::random::Stream;

/// The Vector-Neuron invariant of each latent vector.
///
/// Under SO(2), per vector z, the official network computes y = s·z_xy, q = W a₀ y, k = U a₀ y (two channels,
/// e = 0, 1), A = VN-ReLU(q, k), and reads ⟨y, A_e⟩. Every vector in it is parallel to z_xy, so with α = W a₀,
/// β = U a₀, t = s²|z_xy|² it has a closed form, which has no norm in it and is smooth at z_xy = 0:
///
/// ```text
/// a_e = α_e t                                    where α_e β_e ≥ 0
/// a_e = 0                                        otherwise, for the true projection
/// a_e = α_e t (1 − m/√max(m, g)), m = β_e² t     otherwise, in the reference's form; g is their guard
/// ```
///
/// It knows only |z_xy| and z_z; relative angles between latent vectors reach the network through the
/// directional input. Under SO(3) y = s·z and there are three channels.
#[derive(Module, Debug)]
pub struct Condition {
    /// s, `[1]`.
    pub scale: Param<Tensor<1>>,
    /// a₀, `[1, c]`; c is 2 under SO(2), 3 under SO(3).
    pub linear: Param<Tensor<2>>,
    /// W, `[in c, out c]`.
    pub w: Param<Tensor<2>>,
    /// U, `[in c, out c]`.
    pub u: Param<Tensor<2>>,
    #[module(skip)]
    form: VnReluForm,
}

impl Condition {
    /// Weights uniform in ±1/√inputs, for `channels` 2 or 3.
    ///
    /// Under [`VnReluForm::Projection`] a channel with α_e β_e < 0 is exactly 0 for every latent and gets
    /// no gradient, so it would stay dead for ever. The sign of column e of U is therefore chosen such
    /// that every channel starts alive; U enters that form through the sign only.
    pub fn new(form: VnReluForm, channels: usize, rng: &mut Stream, device: &Device) -> Self {
        let mut draw =
            |n: usize, bound: f32| -> Vec<f32> { (0..n).map(|_| bound * rng.signed() as f32).collect() };
        let (c, bound) = (channels, (channels as f32).recip().sqrt());
        let weights = [draw(c, 1.0), draw(c * c, bound), draw(c * c, bound)];
        Self::of(form, uniform([1], 1.0, rng, device), weights, device)
    }

    /// The same with weights from N(0, 1), as in RENI++.
    pub fn standard_normal(form: VnReluForm, channels: usize, rng: &mut Stream, device: &Device) -> Self {
        let mut draw = |n: usize| -> Vec<f32> { (0..n).map(|_| rng.normal() as f32).collect() };
        let c = channels;
        let (weights, scale) = ([draw(c), draw(c * c), draw(c * c)], draw(1));
        let scale = Param::from_data(TensorData::new(scale, [1]), device);
        Self::of(form, scale, weights, device)
    }

    /// From the values of a₀, W and U, which are made alive.
    fn of(form: VnReluForm, scale: Param<Tensor<1>>, weights: [Vec<f32>; 3], device: &Device) -> Self {
        let [linear, w, mut u] = weights;
        let c = linear.len();
        if form == VnReluForm::Projection {
            for e in 0..c {
                let through = |m: &[f32]| (0..c).map(|i| linear[i] * m[c * i + e]).sum::<f32>();
                if through(&w) * through(&u) < 0.0 {
                    (0..c).for_each(|i| u[c * i + e] = -u[c * i + e]);
                }
            }
        }
        let param =
            |values: Vec<f32>, shape: [usize; 2]| Param::from_data(TensorData::new(values, shape), device);
        Self { scale, linear: param(linear, [1, c]), w: param(w, [c, c]), u: param(u, [c, c]), form }
    }

    /// Latents `[B, N, 3]` → `[B, N, 3]`: (a_0, a_1, z_z) of each vector, or (a_0, a_1, a_2).
    pub fn forward(&self, latent: Tensor<3>) -> Tensor<3> {
        let channels = self.w.dims()[0];
        let rotated = latent.clone().narrow(2, 0, channels);
        let scale: Tensor<3> = self.scale.val().unsqueeze();
        let t = (rotated.clone() * rotated).sum_dim(2) * (scale.clone() * scale);
        let alpha: Tensor<3> = self.linear.val().matmul(self.w.val()).unsqueeze();
        let beta: Tensor<3> = self.linear.val().matmul(self.u.val()).unsqueeze();
        let dropped = (alpha.clone() * beta.clone()).detach().lower_elem(0.0).float();
        let removed = match self.form {
            VnReluForm::Projection => dropped,
            VnReluForm::Reference => dropped * length(beta, t.clone(), 1e-6),
            VnReluForm::ReferenceNormGuard => dropped * length(beta, t.clone(), 1e-12),
        };
        let a = alpha * t * (removed.neg() + 1.0);
        if channels == 3 { a } else { Tensor::cat(vec![a, latent.narrow(2, 2, 1)], 2) }
    }
}

/// m/√max(m, g) with m = β² t: the length |k|, guarded from below. `[1, 1, c]` and `[B, N, 1]` → `[B, N, c]`.
fn length(beta: Tensor<3>, t: Tensor<3>, guard: f64) -> Tensor<3> {
    let m = beta.clone() * beta * t;
    m.clone() / m.clamp_min(guard).sqrt()
}
