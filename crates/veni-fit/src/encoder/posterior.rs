//! From the output token to a Gaussian over latents.

use super::Encoded;
use super::linear::{Feature, Linear, Prepared};
use super::matrix::padded;
use super::weights::{Shape, Tensors};

/// The maps to μ and, where a variance is predicted, to the vectors that it is read from.
#[derive(Clone, Debug)]
pub(super) struct ProjectOut {
    /// Both side by side.
    linear: Linear,
    latent_vectors: usize,
    coordinates: usize,
    variational: bool,
}

impl ProjectOut {
    pub(super) fn new(tensors: Tensors<'_>, shape: Shape, variational: bool) -> Self {
        let mut names = vec!["encoder.project_out".to_owned()];
        names.extend(variational.then(|| "encoder.project_log_variance".to_owned()));
        Self {
            linear: Linear::new(tensors, &names, shape, 1.0),
            latent_vectors: shape.outputs,
            coordinates: shape.to,
            variational,
        }
    }

    /// μ, and ln σ² = |w_xy| + w_z, from one token `[coordinate, channel]`.
    pub(super) fn read(&self, token: &[f32], coordinates: usize, channels: usize) -> Encoded {
        let (n, width) = (self.latent_vectors, self.linear.width());
        let mut prepared = Prepared::default();
        let feature = Feature { data: token, coordinates, channels, width: padded(channels) };
        prepared.prepare(self.linear.layer(), feature);
        let mut out = vec![0.0; self.coordinates * width];
        self.linear.apply(&prepared, &mut out);
        let vector = |channel: usize| [0, 1, 2].map(|c| out[c * width + channel]);
        let log_variance = |i: usize| {
            let [x, y, z] = vector(padded(n) + i);
            (x * x + y * y).sqrt() + z
        };
        Encoded {
            vectors: (0..n).map(vector).collect(),
            log_variances: self.variational.then(|| (0..n).map(log_variance).collect()),
        }
    }
}
