//! Names and shapes of an encoder's tensors, and the check of a model against them.

use std::collections::BTreeMap;

use veni_light::model::{Array, EncoderConfig, Model, ModelConfig, Pooling, Reduction, VectorLayer};
use veni_light::{Error, Result};

/// x, y, z and the colours r, g, b of one sample.
pub(super) const SAMPLE_COORDINATES: usize = 6;
/// x, y, z.
pub(super) const LATENT_COORDINATES: usize = 3;

/// Sizes of a linear map of vector features.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub(super) layer: VectorLayer,
    pub(super) inputs: usize,
    pub(super) outputs: usize,
    /// Coordinates that come in, x and y included.
    pub(super) from: usize,
    /// Coordinates that go out.
    pub(super) to: usize,
}

/// Shapes of all linear maps of an encoder.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shapes {
    pub(super) project_in: Shape,
    pub(super) into_heads: Shape,
    pub(super) out_of_heads: Shape,
    pub(super) expand: Shape,
    pub(super) contract: Shape,
    pub(super) project_out: Shape,
    /// Coordinates inside the transformer.
    pub(super) inner: usize,
}

impl Shapes {
    /// What the configuration implies for N latent vectors.
    ///
    /// # Errors
    /// [`Error::Invalid`] where a Vector-Neuron layer is asked to change the number of coordinates.
    pub(super) fn new(config: &EncoderConfig, latent_vectors: usize) -> Result<Self> {
        let EncoderConfig { channels, heads, head_channels, feedforward, transformer, .. } = *config;
        let refuse = |layer: &str, reduction: &str| {
            Err(Error::invalid(format!(
                "encoder: {layer} = \"vn\" cannot change the number of coordinates, which reduction = \"{reduction}\" \
                 asks of it; use {layer} = \"so2\" or reduction = \"late-split\""
            )))
        };
        let (inner, outer) = match config.reduction {
            Reduction::EarlyLearned if config.project_in == VectorLayer::Vn => {
                return refuse("project_in", "early-learned");
            }
            Reduction::LateLearned if config.project_out == VectorLayer::Vn => {
                return refuse("project_out", "late-learned");
            }
            Reduction::EarlyLearned => (LATENT_COORDINATES, LATENT_COORDINATES),
            Reduction::LateSplit => (SAMPLE_COORDINATES, SAMPLE_COORDINATES),
            Reduction::LateLearned => (SAMPLE_COORDINATES, LATENT_COORDINATES),
        };
        let linear = |layer, inputs, outputs, from, to| Shape { layer, inputs, outputs, from, to };
        let within = |inputs, outputs| linear(transformer, inputs, outputs, inner, inner);
        let samples = config.samples.unwrap_or(1);
        Ok(Self {
            project_in: linear(config.project_in, samples, channels, SAMPLE_COORDINATES, inner),
            into_heads: within(channels, heads * head_channels),
            out_of_heads: within(heads * head_channels, channels),
            expand: within(channels, channels * feedforward),
            contract: within(channels * feedforward, channels),
            project_out: linear(config.project_out, channels, latent_vectors, inner, outer),
            inner,
        })
    }
}

/// The tensors of the encoder that `config` describes, by full name, with their shapes; none where it describes no
/// encoder.
///
/// A linear map of Vector Neurons has `weight` `[inputs, outputs]`. An SO(2) one has, for c invariant coordinates in
/// and c′ out, `equivariant` `[(c+1)·inputs, outputs]` (rows k-major, k = 0 is the one), `invariant`
/// `[(c+1)·inputs, c′·outputs]` (rows k-major, k = c is the norm; columns coordinate-major) and `bias`
/// `[c′·outputs]`. All act on row vectors, y = x W.
///
/// # Errors
/// [`Error::Invalid`] for sizes out of range, and where a Vector-Neuron layer is asked to change the number of
/// coordinates.
pub fn encoder_schema(config: &ModelConfig) -> Result<Vec<(String, Vec<usize>)>> {
    config.validate()?;
    let Some(encoder) = &config.encoder else { return Ok(Vec::new()) };
    let shapes = Shapes::new(encoder, config.latent_vectors)?;
    let mut all = Vec::new();
    let mut put = |name: String, shape: &[usize]| all.push((format!("encoder.{name}"), shape.to_vec()));
    let linear = |put: &mut dyn FnMut(String, &[usize]), name: &str, shape: Shape| {
        let Shape { layer, inputs, outputs, from, to } = shape;
        match layer {
            VectorLayer::Vn => put(format!("{name}.weight"), &[inputs, outputs]),
            VectorLayer::So2 => {
                let (terms, columns) = ((from - 1) * inputs, (to - 2) * outputs);
                put(format!("{name}.equivariant"), &[terms, outputs]);
                put(format!("{name}.invariant"), &[terms, columns]);
                put(format!("{name}.bias"), &[columns]);
            }
        }
    };
    if encoder.pooling == Pooling::Cls && encoder.learnable_cls {
        put("cls".to_owned(), &[shapes.inner - 2, encoder.channels]);
    }
    linear(&mut put, "project_in", shapes.project_in);
    let hidden = shapes.expand.outputs;
    for l in 0..encoder.depth {
        let name = |part: &str| format!("transformer.layers.{l}.{part}");
        for part in ["query", "key", "value"] {
            linear(&mut put, &name(&format!("attention.{part}")), shapes.into_heads);
        }
        linear(&mut put, &name("attention.out"), shapes.out_of_heads);
        linear(&mut put, &name("feed_forward.expand"), shapes.expand);
        put(name("feed_forward.relu.w"), &[hidden, hidden]);
        put(name("feed_forward.relu.u"), &[hidden, hidden]);
        linear(&mut put, &name("feed_forward.contract"), shapes.contract);
        put(name("norm1.gamma"), &[encoder.channels]);
        put(name("norm2.gamma"), &[encoder.channels]);
    }
    linear(&mut put, "project_out", shapes.project_out);
    if encoder.variational {
        linear(&mut put, "project_log_variance", shapes.project_out);
    }
    Ok(all)
}

/// Tensors whose names and shapes have been checked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tensors<'a>(pub(super) &'a BTreeMap<String, Array>);

impl<'a> Tensors<'a> {
    /// The encoder's tensors of a model.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first tensor that is missing, of another shape, or unexpected.
    pub(super) fn check(model: &'a Model) -> Result<Self> {
        let schema: BTreeMap<_, _> = encoder_schema(model.config())?.into_iter().collect();
        for (name, shape) in &schema {
            match model.tensor(name) {
                None => return Err(Error::invalid(format!("tensor {name} {shape:?} is missing"))),
                Some(tensor) if tensor.shape != *shape => {
                    let found = &tensor.shape;
                    return Err(Error::invalid(format!(
                        "tensor {name} is {found:?}, the configuration says {shape:?}"
                    )));
                }
                Some(_) => {}
            }
        }
        let ours = model.tensors().iter().filter(|(name, _)| name.starts_with("encoder."));
        if let Some((name, tensor)) = ours.into_iter().find(|(name, _)| !schema.contains_key(*name)) {
            let shape = &tensor.shape;
            return Err(Error::invalid(format!("tensor {name} {shape:?} is unexpected in this encoder")));
        }
        Ok(Self(model.tensors()))
    }

    /// Values of a tensor of the schema.
    pub(super) fn get(self, name: &str) -> &'a [f32] {
        &self.0[name].data
    }

    /// Values of a tensor that may be absent.
    pub(super) fn find(self, name: &str) -> Option<&'a [f32]> {
        self.0.get(name).map(|tensor| &*tensor.data)
    }
}
