//! The residual perceptron that runs for every direction, packed for the kernels.

#[cfg(feature = "gradients")]
use std::sync::OnceLock;

use super::aligned::Aligned;
use super::bfloat16::{Bfloat16, Pairs};
#[cfg(feature = "gradients")]
use super::gradient::Transposed;

/// Outputs per panel: what one register tile computes.
pub(super) const PANEL: usize = 8;
/// Most directional inputs encoded at a time, so that their 5-fold encoding stays in the first-level cache.
const CHUNK: usize = 24;

/// A matrix [in, out] cut into panels of 8 outputs: panel-major, then input, then output. Outputs are filled
/// up with zeros.
#[derive(Debug)]
pub(super) struct Matrix {
    pub(super) inputs: usize,
    data: Aligned,
    /// The same in bfloat16, where products are computed so.
    pub(super) pairs: Option<Pairs>,
}

impl Matrix {
    /// `row(k)` is row k of the matrix, one value per output.
    fn pack<'a>(inputs: usize, outputs: usize, row: impl Fn(usize) -> &'a [f32]) -> Self {
        let mut data = Aligned::zeros(inputs * outputs.next_multiple_of(PANEL));
        let panels = data.as_mut_slice().chunks_exact_mut(inputs * PANEL);
        for (p, panel) in panels.enumerate() {
            for (k, packed) in panel.chunks_exact_mut(PANEL).enumerate() {
                let values = &row(k)[p * PANEL..outputs.min((p + 1) * PANEL)];
                packed[..values.len()].copy_from_slice(values);
            }
        }
        Self { inputs, data, pairs: None }
    }

    /// Of a row-major matrix [in, out].
    pub(super) fn new(data: &[f32], outputs: usize) -> Self {
        Self::pack(data.len() / outputs, outputs, |k| &data[k * outputs..][..outputs])
    }

    /// The same, to be multiplied in bfloat16.
    fn round(&mut self, token: Bfloat16) {
        self.pairs = Some(Pairs::new(token, self.inputs, self.rows()));
    }

    #[cfg(feature = "gradients")]
    /// The transpose of the first `outputs` columns, multiplied as this one is.
    pub(super) fn transposed(&self, outputs: usize) -> Self {
        let at = |k: usize, o: usize| self.rows()[o / PANEL * self.inputs + k][o % PANEL];
        let rows: Vec<Vec<f32>> =
            (0..outputs).map(|o| (0..self.inputs).map(|k| at(k, o)).collect()).collect();
        let mut transpose = Self::pack(outputs, self.inputs, |o| &rows[o]);
        if let Some(pairs) = &self.pairs {
            transpose.round(pairs.token());
        }
        transpose
    }

    /// Panels of `inputs` rows each.
    pub(super) fn panels(&self) -> std::slice::ChunksExact<'_, [f32; PANEL]> {
        self.rows().chunks_exact(self.inputs)
    }

    /// All panels, one after the other.
    pub(super) fn rows(&self) -> &[[f32; PANEL]] {
        self.data.as_slice().as_chunks::<PANEL>().0
    }
}

/// Rows of the residual projection that belong to some of the directional inputs. Per input five rows:
/// sin f₁, sin f₂, cos f₁, cos f₂, the input itself.
#[derive(Debug)]
pub(super) struct Chunk {
    pub(super) inputs: std::ops::Range<usize>,
    pub(super) weight: Matrix,
}

/// What a layer does to a direction; the vector that it adds comes from the latent.
#[derive(Debug)]
pub(super) struct Layer {
    pub(super) gamma1: Vec<f32>,
    pub(super) beta1: Vec<f32>,
    pub(super) ff1: Matrix,
    pub(super) ff1_bias: Vec<f32>,
    pub(super) ff2: Matrix,
    pub(super) ff2_bias: Vec<f32>,
    pub(super) gamma2: Vec<f32>,
}

/// The weights that meet a direction.
#[derive(Debug)]
pub(super) struct Mlp {
    /// h
    pub(super) hidden: usize,
    pub(super) input: Vec<Chunk>,
    pub(super) layers: Vec<Layer>,
    pub(super) output: Matrix,
    pub(super) output_bias: Vec<f32>,
    /// Made when the first gradient is asked for.
    #[cfg(feature = "gradients")]
    transposed: OnceLock<Transposed>,
}

impl Mlp {
    /// From named tensors, row-major: `input.weight`, `layers.{l}.norm1.gamma`, …, `output.bias`.
    pub(super) fn new<'a>(hidden: usize, layers: usize, tensor: impl Fn(&str) -> &'a [f32]) -> Self {
        let padded = |name: &str| {
            let mut data = tensor(name).to_vec();
            data.resize(data.len().next_multiple_of(PANEL), 0.0);
            data
        };
        let layer = |l: usize| {
            let name = |part: &str| format!("layers.{l}.{part}");
            Layer {
                gamma1: tensor(&name("norm1.gamma")).to_vec(),
                beta1: tensor(&name("norm1.beta")).to_vec(),
                ff1: Matrix::new(tensor(&name("ff1.weight")), hidden),
                ff1_bias: padded(&name("ff1.bias")),
                ff2: Matrix::new(tensor(&name("ff2.weight")), hidden),
                ff2_bias: padded(&name("ff2.bias")),
                gamma2: tensor(&name("norm2.gamma")).to_vec(),
            }
        };
        Self {
            hidden,
            input: chunks(tensor("input.weight"), hidden),
            layers: (0..layers).map(layer).collect(),
            output: Matrix::new(tensor("output.weight"), 3),
            output_bias: padded("output.bias"),
            #[cfg(feature = "gradients")]
            transposed: OnceLock::new(),
        }
    }

    /// The same, with matrices but for the output's multiplied in bfloat16.
    #[cfg_attr(not(feature = "training"), allow(dead_code, reason = "only training computes so"))]
    pub(super) fn in_bfloat16(mut self, token: Bfloat16) -> Self {
        let maps = self.layers.iter_mut().flat_map(|layer| [&mut layer.ff1, &mut layer.ff2]);
        self.input.iter_mut().map(|chunk| &mut chunk.weight).chain(maps).for_each(|m| m.round(token));
        #[cfg(feature = "gradients")]
        {
            self.transposed = OnceLock::new();
        }
        self
    }

    #[cfg(feature = "gradients")]
    /// Whether matrices but for the output's are multiplied in bfloat16, and the sums that are gradients by them added so.
    pub(super) fn bfloat16(&self) -> Option<Bfloat16> {
        self.input.first()?.weight.pairs.as_ref().map(Pairs::token)
    }

    /// The matrices the other way round.
    #[cfg(feature = "gradients")]
    pub(super) fn transposed(&self) -> &Transposed {
        self.transposed.get_or_init(|| Transposed::new(self))
    }

    /// h rounded up to whole panels.
    pub(super) fn padded(&self) -> usize {
        self.hidden.next_multiple_of(PANEL)
    }
}

/// `m` directional inputs; the stored rows are [sin: m × 2 frequencies | cos: m × 2 | the m inputs].
fn chunks(weight: &[f32], hidden: usize) -> Vec<Chunk> {
    let m = weight.len() / hidden / 5;
    let row = |r: usize| &weight[r * hidden..][..hidden];
    let size = m.div_ceil(m.div_ceil(CHUNK));
    let chunk = |from: usize| {
        let inputs = from..m.min(from + size);
        let stored = |k: usize| row(stored_row(m, from + k / 5, k % 5));
        Chunk { weight: Matrix::pack(5 * inputs.len(), hidden, stored), inputs }
    };
    (0..m).step_by(size).map(chunk).collect()
}

/// The row of the stored weight of `m` directional inputs that belongs to feature `k` of input `j`.
pub(super) fn stored_row(m: usize, j: usize, k: usize) -> usize {
    [2 * j, 2 * j + 1, 2 * (m + j), 2 * (m + j) + 1, 4 * m + j][k]
}
