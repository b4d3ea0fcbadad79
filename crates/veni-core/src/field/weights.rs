//! The decoder's weights in the order the kernels read them. Packed once per model.

use std::sync::OnceLock;

use super::aligned::Aligned;
use super::gradient::Transposed;
use crate::model::{Model, Tensor, VnReluForm};

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
        Self { inputs, data }
    }

    fn new(tensor: &Tensor) -> Self {
        let [inputs, outputs] = [tensor.shape[0], tensor.shape[1]];
        Self::pack(inputs, outputs, |k| &tensor.data[k * outputs..][..outputs])
    }

    /// The transpose of the first `outputs` columns.
    pub(super) fn transposed(&self, outputs: usize) -> Self {
        let at = |k: usize, o: usize| self.rows()[o / PANEL * self.inputs + k][o % PANEL];
        let rows: Vec<Vec<f32>> =
            (0..outputs).map(|o| (0..self.inputs).map(|k| at(k, o)).collect()).collect();
        Self::pack(outputs, self.inputs, |o| &rows[o])
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

/// y = x W + b on row vectors, unpacked: for the conditioning, which runs once per latent.
#[derive(Debug)]
pub(super) struct Affine {
    pub(super) weight: Vec<f32>,
    pub(super) bias: Vec<f32>,
}

#[derive(Debug)]
pub(super) struct Layer {
    pub(super) value: Affine,
    pub(super) out: Affine,
    pub(super) gamma1: Vec<f32>,
    pub(super) beta1: Vec<f32>,
    pub(super) ff1: Matrix,
    pub(super) ff1_bias: Vec<f32>,
    pub(super) ff2: Matrix,
    pub(super) ff2_bias: Vec<f32>,
    pub(super) gamma2: Vec<f32>,
    pub(super) beta2: Vec<f32>,
}

/// The VN-invariant layer of the conditioning, of which only products are needed (see `condition`).
#[derive(Clone, Debug)]
pub(super) struct Invariant {
    pub(super) scale: f64,
    pub(super) alpha: [f64; 2],
    pub(super) beta: [f64; 2],
    pub(super) form: VnReluForm,
}

/// Everything of a decoder that does not depend on a latent.
#[derive(Debug)]
pub(super) struct Weights {
    /// N
    pub(super) latent_vectors: usize,
    /// h
    pub(super) hidden: usize,
    pub(super) model: String,
    pub(super) invariant: Invariant,
    pub(super) input: Vec<Chunk>,
    pub(super) input_bias: Vec<f32>,
    pub(super) layers: Vec<Layer>,
    pub(super) output: Matrix,
    pub(super) output_bias: Vec<f32>,
    /// Made when the first gradient is asked for.
    transposed: OnceLock<Transposed>,
}

impl Weights {
    pub(super) fn new(model: &Model) -> Self {
        let config = model.config();
        let (n, hidden) = (config.latent_vectors, config.decoder.hidden);
        // a `Model` holds every tensor of its schema in the schema's shape
        let tensor = |name: &str| &model.tensors()[&format!("decoder.{name}")];
        let vector = |name: &str| tensor(name).data.clone();
        let padded = |name: &str| {
            let mut data = vector(name);
            data.resize(data.len().next_multiple_of(PANEL), 0.0);
            data
        };
        let layer = |l: usize| {
            let name = |part: &str| format!("layers.{l}.{part}");
            let affine = |part: &str| Affine {
                weight: vector(&name(&format!("{part}.weight"))),
                bias: vector(&name(&format!("{part}.bias"))),
            };
            Layer {
                value: affine("value"),
                out: affine("out"),
                gamma1: vector(&name("norm1.gamma")),
                beta1: vector(&name("norm1.beta")),
                ff1: Matrix::new(tensor(&name("ff1.weight"))),
                ff1_bias: padded(&name("ff1.bias")),
                ff2: Matrix::new(tensor(&name("ff2.weight"))),
                ff2_bias: padded(&name("ff2.bias")),
                gamma2: vector(&name("norm2.gamma")),
                beta2: vector(&name("norm2.beta")),
            }
        };
        Self {
            latent_vectors: n,
            hidden,
            model: model.hash(),
            invariant: invariant(model),
            input: chunks(tensor("input.weight"), n + 2),
            input_bias: padded("input.bias"),
            layers: (0..config.decoder.layers).map(layer).collect(),
            output: Matrix::new(tensor("output.weight")),
            output_bias: padded("output.bias"),
            transposed: OnceLock::new(),
        }
    }

    /// The matrices the other way round.
    pub(super) fn transposed(&self) -> &Transposed {
        self.transposed.get_or_init(|| Transposed::new(self))
    }

    /// h rounded up to whole panels.
    pub(super) fn padded(&self) -> usize {
        self.hidden.next_multiple_of(PANEL)
    }
}

/// `m` directional inputs; the stored rows are [sin: m × 2 frequencies | cos: m × 2 | the m inputs].
fn chunks(weight: &Tensor, m: usize) -> Vec<Chunk> {
    let hidden = weight.shape[1];
    let row = |r: usize| &weight.data[r * hidden..][..hidden];
    let size = m.div_ceil(m.div_ceil(CHUNK));
    let chunk = |from: usize| {
        let inputs = from..m.min(from + size);
        let stored = |k: usize| {
            let j = from + k / 5;
            row([2 * j, 2 * j + 1, 2 * (m + j), 2 * (m + j) + 1, 4 * m + j][k % 5])
        };
        Chunk { weight: Matrix::pack(5 * inputs.len(), hidden, stored), inputs }
    };
    (0..m).step_by(size).map(chunk).collect()
}

fn invariant(model: &Model) -> Invariant {
    let values = |name: &str| -> Vec<f64> {
        model.tensors()[&format!("decoder.condition.{name}")].data.iter().map(|v| f64::from(*v)).collect()
    };
    let linear = values("linear");
    // stored [in, out]
    let times = |m: Vec<f64>| [0, 1].map(|e| m[e] * linear[0] + m[2 + e] * linear[1]);
    Invariant {
        scale: values("scale")[0],
        alpha: times(values("w")),
        beta: times(values("u")),
        form: model.config().decoder.vn_relu,
    }
}
