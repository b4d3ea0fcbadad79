//! A decoder's weights in the order that conditioning and kernels read them. Packed once per model.

#[cfg(feature = "gradients")]
use std::sync::OnceLock;

#[cfg(feature = "gradients")]
use super::gradient::ValueOutput;
use super::mlp::{Mlp, PANEL};
use crate::model::{Model, VnReluForm};

/// y = x W + b on row vectors, unpacked: for the conditioning, which runs once per latent.
#[derive(Debug)]
pub(super) struct Affine {
    pub(super) weight: Vec<f32>,
    pub(super) bias: Vec<f32>,
}

/// What makes the vectors that a layer adds.
#[derive(Debug)]
pub(super) struct Attention {
    pub(super) value: Affine,
    pub(super) out: Affine,
    /// β of the layer's second norm, which the next layer's attention joins.
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
    pub(super) model: String,
    pub(super) invariant: Invariant,
    /// One per layer.
    pub(super) attention: Vec<Attention>,
    pub(super) input_bias: Vec<f32>,
    pub(super) mlp: Mlp,
    /// Made when the first normal equations are asked for.
    #[cfg(feature = "gradients")]
    value_output: OnceLock<Vec<ValueOutput>>,
}

impl Weights {
    pub(super) fn new(model: &Model) -> Self {
        let config = model.config();
        // a `Model` holds every tensor of its schema in the schema's shape
        let tensor = |name: &str| model.tensors()[&format!("decoder.{name}")].data.as_slice();
        let vector = |name: String| tensor(&name).to_vec();
        let attention = |l: usize| {
            let affine = |part: &str| Affine {
                weight: vector(format!("layers.{l}.{part}.weight")),
                bias: vector(format!("layers.{l}.{part}.bias")),
            };
            let beta2 = vector(format!("layers.{l}.norm2.beta"));
            Attention { value: affine("value"), out: affine("out"), beta2 }
        };
        let mut input_bias = vector("input.bias".into());
        input_bias.resize(input_bias.len().next_multiple_of(PANEL), 0.0);
        Self {
            latent_vectors: config.latent_vectors,
            model: model.hash(),
            invariant: invariant(model),
            attention: (0..config.decoder.layers).map(attention).collect(),
            input_bias,
            mlp: Mlp::new(config.decoder.hidden, config.decoder.layers, tensor),
            #[cfg(feature = "gradients")]
            value_output: OnceLock::new(),
        }
    }

    /// The two linear maps of every layer's attention in one.
    #[cfg(feature = "gradients")]
    pub(super) fn value_output(&self) -> &[ValueOutput] {
        self.value_output
            .get_or_init(|| self.attention.iter().map(|a| ValueOutput::new(&a.value, &a.out)).collect())
    }
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
