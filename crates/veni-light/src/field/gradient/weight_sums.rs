//! Gradients with respect to the weights that meet a direction, summed over directions.

use pulp::Simd;

use super::outer::{self, Wide};
use crate::field::bfloat16::Bfloat16;
use crate::field::block::Row;
use crate::field::mlp::{Mlp, PANEL, stored_row};

/// The gradients, one tensor after the other in the order of [`layout`].
#[derive(Clone, Debug)]
pub(in crate::field) struct WeightSums {
    pub(in crate::field) values: Vec<f32>,
}

/// Name and length of every tensor.
pub(in crate::field) fn layout(mlp: &Mlp) -> Vec<(String, usize)> {
    let h = mlp.hidden;
    let inputs: usize = mlp.input.iter().map(|chunk| chunk.weight.inputs).sum();
    let mut all = vec![("input.weight".to_owned(), inputs * h)];
    for l in 0..mlp.layers.len() {
        let parts = [("ff1.weight", h * h), ("ff2.weight", h * h)].into_iter().chain(VECTORS.map(|v| (v, h)));
        all.extend(parts.map(|(part, len)| (format!("layers.{l}.{part}"), len)));
    }
    all.extend([("output.weight".to_owned(), 3 * h), ("output.bias".to_owned(), 3)]);
    all
}

/// The vectors of a layer, in the order of [`LayerWorkspace::vectors`].
const VECTORS: [&str; 5] = ["norm1.gamma", "norm1.beta", "ff1.bias", "ff2.bias", "norm2.gamma"];

impl WeightSums {
    pub(in crate::field) fn new(mlp: &Mlp) -> Self {
        Self { values: vec![0.0; layout(mlp).iter().map(|(_, len)| len).sum()] }
    }

    pub(in crate::field) fn add(&mut self, other: &Self) {
        for (sum, value) in self.values.iter_mut().zip(&other.values) {
            *sum += value;
        }
    }
}

/// Workspace for the sums of one task, as the kernels leave them.
pub(super) struct WeightWorkspace<'a, S: Simd> {
    /// A block's gradient with respect to the outputs of a matrix, direction by direction.
    transposed: &'a mut [Wide<S>],
    bfloat16: Option<Bfloat16>,
    /// One per chunk of directional inputs.
    pub(super) input: Vec<&'a mut [Wide<S>]>,
    pub(super) layers: Vec<LayerWorkspace<'a, S>>,
    /// A vector per entry of the transposed output matrix [3, h].
    pub(super) output: &'a mut [S::f32s],
    pub(super) output_bias: &'a mut [S::f32s],
}

/// Sums of one layer.
pub(super) struct LayerWorkspace<'a, S: Simd> {
    pub(super) ff1: &'a mut [Wide<S>],
    pub(super) ff2: &'a mut [Wide<S>],
    /// γ₁, β₁, the two biases, γ₂: h vectors each.
    pub(super) vectors: [&'a mut [S::f32s]; 5],
}

/// Which of [`LayerWorkspace::vectors`].
pub(super) mod vector {
    pub(in super::super) const GAMMA1: usize = 0;
    pub(in super::super) const BETA1: usize = 1;
    pub(in super::super) const FF1_BIAS: usize = 2;
    pub(in super::super) const FF2_BIAS: usize = 3;
    pub(in super::super) const GAMMA2: usize = 4;
}

impl<'a, S: Simd> WeightWorkspace<'a, S> {
    /// SIMD vectors that it takes.
    pub(super) fn vectors(mlp: &Mlp) -> usize {
        let (h, panels) = (mlp.hidden, outer::panels::<S>(mlp.hidden));
        let inputs: usize = mlp.input.iter().map(|chunk| chunk.weight.inputs).sum();
        let wide = panels * (outer::lanes::<S>() + inputs + 2 * h * mlp.layers.len());
        wide * size_of::<Wide<S>>() / size_of::<S::f32s>() + 5 * h * mlp.layers.len() + 3 * h + 3
    }

    /// All zero.
    pub(super) fn new(simd: S, mlp: &Mlp, workspace: &'a mut [S::f32s]) -> Self {
        let (h, panels) = (mlp.hidden, outer::panels::<S>(mlp.hidden));
        workspace.fill(simd.splat_f32s(0.0));
        let mut rest = workspace;
        let transposed = take_wide::<S>(&mut rest, panels * outer::lanes::<S>());
        let input = mlp.input.iter().map(|c| take_wide::<S>(&mut rest, panels * c.weight.inputs)).collect();
        let layers = mlp.layers.iter().map(|_| LayerWorkspace {
            ff1: take_wide::<S>(&mut rest, panels * h),
            ff2: take_wide::<S>(&mut rest, panels * h),
            vectors: std::array::from_fn(|_| take(&mut rest, h)),
        });
        let layers = layers.collect();
        let (output, output_bias) = (take(&mut rest, 3 * h), take(&mut rest, 3));
        Self { transposed, bfloat16: mlp.bfloat16(), input, layers, output, output_bias }
    }

    /// x gᵀ for the directional inputs; every chunk's features fill whole panels of `encodings`.
    #[inline(always)]
    pub(super) fn add_input(&mut self, simd: S, mlp: &Mlp, encodings: &[Row<S>], gradient: &[Row<S>]) {
        let outer = outer::Outer::new(self.bfloat16, gradient, self.transposed);
        let mut from = 0;
        for (chunk, sums) in mlp.input.iter().zip(&mut self.input) {
            let inputs = chunk.weight.inputs;
            outer.add(simd, &encodings[from..from + inputs], sums);
            from += inputs.next_multiple_of(PANEL);
        }
    }

    /// x gᵀ for the first feed-forward map of layer `l`.
    #[inline(always)]
    pub(super) fn add_ff1(&mut self, simd: S, l: usize, x: &[Row<S>], gradient: &[Row<S>]) {
        let outer = outer::Outer::new(self.bfloat16, gradient, self.transposed);
        outer.add(simd, x, self.layers[l].ff1);
    }

    /// x gᵀ for the second.
    #[inline(always)]
    pub(super) fn add_ff2(&mut self, simd: S, l: usize, x: &[Row<S>], gradient: &[Row<S>]) {
        let outer = outer::Outer::new(self.bfloat16, gradient, self.transposed);
        outer.add(simd, x, self.layers[l].ff2);
    }

    /// Adds what was summed to `sums`.
    ///
    /// The kernels leave Σ x̂ gᵀ for the first feed-forward map, whose input is γ₁ x̂ + β₁: by W that is
    /// γ₁ ⊙ (Σ x̂ gᵀ) + β₁ (Σ g)ᵀ.
    pub(super) fn drain(&self, mlp: &Mlp, sums: &mut WeightSums) {
        let h = mlp.hidden;
        let m = mlp.input.iter().map(|chunk| chunk.inputs.len()).sum();
        let mut rest = sums.values.as_mut_slice();
        let mut next = |len: usize| {
            let (head, tail) = std::mem::take(&mut rest).split_at_mut(len);
            rest = tail;
            head
        };
        let input = next(5 * m * h);
        for (chunk, workspace) in mlp.input.iter().zip(&self.input) {
            for k in 0..chunk.weight.inputs {
                let row = stored_row(m, chunk.inputs.start + k / 5, k % 5);
                outer::read::<S>(workspace, chunk.weight.inputs, k, &mut input[row * h..][..h]);
            }
        }
        let total = |v: &S::f32s| -> f32 {
            bytemuck::cast_slice::<S::f32s, f32>(std::slice::from_ref(v)).iter().sum()
        };
        for (layer, workspace) in mlp.layers.iter().zip(&self.layers) {
            let bias: Vec<f32> = workspace.vectors[vector::FF1_BIAS].iter().map(total).collect();
            let ff1 = next(h * h);
            for (k, row) in ff1.chunks_exact_mut(h).enumerate() {
                let mut products = vec![0.0; h];
                outer::read::<S>(workspace.ff1, h, k, &mut products);
                for ((out, product), bias) in row.iter_mut().zip(products).zip(&bias) {
                    *out += layer.gamma1[k] * product + layer.beta1[k] * bias;
                }
            }
            for (k, row) in next(h * h).chunks_exact_mut(h).enumerate() {
                outer::read::<S>(workspace.ff2, h, k, row);
            }
            for vectors in &workspace.vectors {
                for (out, vector) in next(h).iter_mut().zip(vectors.iter()) {
                    *out += total(vector);
                }
            }
        }
        let output = next(3 * h);
        for (c, vectors) in self.output.chunks_exact(h).enumerate() {
            for (k, vector) in vectors.iter().enumerate() {
                output[3 * k + c] += total(vector);
            }
        }
        for (out, vector) in next(3).iter_mut().zip(self.output_bias.iter()) {
            *out += total(vector);
        }
    }
}

fn take<'a, V>(rest: &mut &'a mut [V], len: usize) -> &'a mut [V] {
    let (head, tail) = std::mem::take(rest).split_at_mut(len);
    *rest = tail;
    head
}

fn take_wide<'a, S: Simd>(rest: &mut &'a mut [S::f32s], len: usize) -> &'a mut [Wide<S>] {
    let vectors = size_of::<Wide<S>>() / size_of::<S::f32s>();
    take(rest, vectors * len).as_chunks_mut().0
}
