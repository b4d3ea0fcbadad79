//! VN-ViT, the rotation-equivariant encoder: a panorama seen as vertical stripes, one token each.
//!
//! 1. A stripe of P samples becomes a token of P channels with coordinates (x, y, z, r, g, b): its directions and its
//!    log radiance.
//! 2. `project_in` maps samples to channels.
//! 3. A class token joins in front: zero in x, y; learned in the invariant coordinates.
//! 4. The transformer; then the class token (or the mean over tokens) is read:
//! 5. `project_out` gives μ; `project_log_variance` gives vectors w with ln σ² = |w_xy| + w_z.
//!
//! A vector feature is `[token, coordinate, channel]`, row-major, so that a linear map of Vector Neurons is one plain
//! matrix product. Rotating all directions about z rotates the latent by the same angle; the order of stripes does not
//! matter. Hence a panorama rolled by whole stripes gives the rotated latent exactly.

mod attention;
mod feed_forward;
mod fold;
mod gate;
#[cfg(test)]
mod golden;
mod layout;
mod linear;
mod matrix;
mod norm;
mod parallel;
mod posterior;
mod simd;
mod so2;
mod softmax;
mod tokens;
mod transformer;
mod weights;
mod workspace;

use veni_light::model::{EncoderConfig, Model, Pooling};
use veni_light::sphere::{Equirect, Stripes};
use veni_light::{Error, Result};

use layout::Layout;
use matrix::padded;
use parallel::for_each;
use posterior::ProjectOut;
use tokens::ProjectIn;
use transformer::{Buffers, Transformer};
use weights::{Shapes, Tensors};
use workspace::Pool;

pub use weights::encoder_schema;

/// Most numbers that a buffer of activations may hold (1 GiB).
const LARGEST: usize = 1 << 28;

/// The encoder of a model, with its products of weights computed once. Usable from many threads.
#[derive(Debug)]
pub struct Encoder {
    config: EncoderConfig,
    latent_vectors: usize,
    coordinates: usize,
    project_in: ProjectIn,
    /// The class token, `[coordinate, width]`; absent where tokens are averaged.
    cls: Option<Vec<f32>>,
    transformer: Transformer,
    project_out: ProjectOut,
    layout: Layout,
    workspaces: Pool<tokens::Workspace>,
    buffers: Pool<Buffers>,
}

/// What the encoder says about one panorama: N independent isotropic Gaussians in R³, one per latent vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Encoded {
    /// μ, the means of the N latent vectors, native frame (z up).
    pub vectors: Vec<[f32; 3]>,
    /// ln σ² of each, the same in x, y and z; absent where none are predicted.
    pub log_variances: Option<Vec<f32>>,
}

impl Encoder {
    /// The encoder of a model.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the model has no encoder, if one of its tensors is missing, has another shape than the
    /// configuration implies, or is unexpected, or if a Vector-Neuron layer is asked to change the number of
    /// coordinates. All is checked before anything is allocated.
    pub fn new(model: &Model) -> Result<Self> {
        let config = model.config().encoder.as_ref().filter(|_| model.has_encoder());
        let config = config.ok_or_else(|| Error::invalid("the model has no encoder: it can only decode"))?;
        let tensors = Tensors::check(model)?;
        let shapes = Shapes::new(config, model.latent_vectors())?;
        let transformer = Transformer::new(tensors, "encoder.transformer", config, &shapes);
        let width = padded(config.channels);
        let cls = (config.pooling == Pooling::Cls).then(|| {
            let mut token = vec![0.0; shapes.inner * width];
            let rows = tensors.find("encoder.cls").into_iter().flat_map(|c| c.chunks_exact(config.channels));
            for (row, values) in token.chunks_exact_mut(width).skip(2).zip(rows) {
                row[..values.len()].copy_from_slice(values);
            }
            token
        });
        Ok(Self {
            config: config.clone(),
            latent_vectors: model.latent_vectors(),
            coordinates: shapes.inner,
            project_in: ProjectIn::new(tensors, "encoder.project_in", shapes.project_in),
            cls,
            transformer,
            project_out: ProjectOut::new(tensors, shapes.project_out, config.variational),
            layout: Layout::default(),
            workspaces: Pool::default(),
            buffers: Pool::default(),
        })
    }

    /// The hyper-parameters.
    pub fn config(&self) -> &EncoderConfig {
        &self.config
    }

    /// N, the number of latent vectors.
    pub fn latent_vectors(&self) -> usize {
        self.latent_vectors
    }

    /// Where the encoder looks. Where every sample is a token, there is one meridian per stripe.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the configured numbers of stripes and samples cannot be laid out.
    pub fn stripes(&self) -> Result<Stripes> {
        let EncoderConfig { stripes, samples, sampling, .. } = self.config;
        Stripes::new(stripes, samples.unwrap_or(stripes / 2), sampling)
    }

    /// Encodes panoramas: natural log radiance at exposure 0 on `grid`, 3·W·H values each, row-major from the top.
    /// The first panorama of a grid costs a little more, because the places to look at are kept for the next.
    ///
    /// # Errors
    /// [`Error::Invalid`] as [`Encoder::stripes`], if a panorama has another number of values, or if one would need
    /// more than 1 GiB.
    pub fn encode(&self, grid: Equirect, images: &[&[f32]]) -> Result<Vec<Encoded>> {
        if let Some(image) = images.iter().find(|image| image.len() != 3 * grid.len()) {
            let (Equirect { width, height }, count) = (grid, image.len());
            return Err(Error::invalid(format!(
                "{count} values are not a panorama of {width} × {height} in RGB"
            )));
        }
        let directions = self.layout.directions(self)?;
        let gather = self.layout.gather(self, grid)?;
        Ok(self.for_each_image(images, |image, workers| {
            let samples = gather.sample(image.as_chunks().0);
            self.encode_samples(&directions.directions, &directions.folded, &samples, workers)
        }))
    }

    /// Encodes what was seen in given directions, the same for all images: unit vectors in the native frame (z up),
    /// and for every image natural log radiance at exposure 0; both `[stripe, sample]`, row-major. The number of
    /// stripes is free.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the directions are not whole stripes, an image has another number of samples, or one
    /// would need more than 1 GiB.
    pub fn forward(&self, directions: &[[f32; 3]], images: &[&[[f32; 3]]]) -> Result<Vec<Encoded>> {
        let (count, samples) = (directions.len(), self.config.samples.unwrap_or(1));
        if count == 0 || !count.is_multiple_of(samples) {
            return Err(Error::invalid(format!(
                "{count} directions are not whole stripes of {samples} samples"
            )));
        }
        if let Some(image) = images.iter().find(|image| image.len() != count) {
            let other = image.len();
            return Err(Error::invalid(format!("{other} samples of log radiance for {count} directions")));
        }
        self.check_size(count / samples)?;
        let folded = self.project_in.fold(directions, self.coordinates);
        Ok(self.for_each_image(images, |samples, workers| {
            self.encode_samples(directions, &folded, samples, workers)
        }))
    }

    /// Images on all cores; where there are fewer images than cores, several cores to an image.
    fn for_each_image<T: ?Sized + Sync>(
        &self,
        images: &[&T],
        encode: impl Fn(&T, usize) -> Encoded + Sync + Send,
    ) -> Vec<Encoded> {
        let threads = parallel::threads();
        let within = threads.div_ceil(images.len().max(1));
        let mut out: Vec<Option<Encoded>> = vec![None; images.len()];
        let tasks = images.iter().zip(&mut out).collect();
        for_each(threads, tasks, |(image, out)| *out = Some(encode(image, within)));
        out.into_iter().flatten().collect()
    }

    fn encode_samples(
        &self,
        directions: &[[f32; 3]],
        folded: &[f32],
        samples: &[[f32; 3]],
        workers: usize,
    ) -> Encoded {
        let token = self.transformer.token();
        let each = self.config.samples.unwrap_or(1);
        let stripes = samples.len() / each;
        self.buffers.with(|buffers| {
            let x = &mut buffers.x;
            x.clear();
            x.extend_from_slice(self.cls.as_deref().unwrap_or_default());
            let first = x.len();
            x.extend_from_slice(folded);
            let share = stripes.div_ceil(workers).min(64);
            let tasks = x[first..].chunks_mut(share * token);
            let tasks = tasks.zip(directions.chunks(share * each)).zip(samples.chunks(share * each));
            for_each(workers, tasks.collect(), |((x, directions), samples)| {
                self.workspaces.with(|workspace| {
                    self.project_in.add(directions, samples, self.coordinates, x, workspace);
                });
            });
            self.transformer.run(buffers, self.cls.is_some(), workers);
            let x = &mut buffers.x;
            if self.cls.is_none() {
                mean(x, token);
            }
            self.project_out.read(&x[..token], self.coordinates, self.config.channels)
        })
    }

    /// Refuses numbers of stripes whose activations would not fit [`LARGEST`].
    fn check_size(&self, stripes: usize) -> Result<()> {
        let EncoderConfig { channels, heads, head_channels, samples, .. } = self.config;
        let inner = 2 * padded(heads * head_channels) + heads * matrix::PANEL;
        let widest = self.coordinates * padded(channels).max(inner);
        let widest = widest.max(5 * samples.unwrap_or(1));
        match (stripes + 1).checked_mul(widest) {
            Some(size) if size <= LARGEST => Ok(()),
            _ => Err(Error::invalid(format!(
                "{stripes} tokens of {channels} channels would need more than {} MiB",
                (LARGEST * size_of::<f32>()) >> 20
            ))),
        }
    }
}

/// The mean over tokens, in place of the first.
fn mean(x: &mut [f32], token: usize) {
    let count = (x.len() / token) as f32;
    let (first, rest) = x.split_at_mut(token);
    for token in rest.chunks_exact(token) {
        first.iter_mut().zip(token).for_each(|(sum, v)| *sum += v);
    }
    first.iter_mut().for_each(|v| *v /= count);
}
