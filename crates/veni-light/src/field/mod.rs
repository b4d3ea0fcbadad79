//! The decoder conditioned on one latent: a plain function from direction to radiance.
//!
//! [`Decoder`] holds a model's weights in the order the kernels read them. [`Decoder::condition`] folds a
//! [`Latent`] into a few vectors and gives a [`Field`]. For a unit direction d (native frame, z up):
//!
//! 1. inputs pᵢ = zᵢ,x dx + zᵢ,y dy for the N vectors, d_z and √(dx² + dy²);
//! 2. their sines and cosines at frequencies 1 and 4 and themselves, projected to h = 128 features x;
//! 3. per layer x ← LN(x + a), x ← LN(x + W₂ max(0, W₁ x + b₁) + b₂), where a depends on the latent only;
//! 4. log radiance = W x + b + the latent's lobes + its log exposure;
//! 5. radiance = exp(log radiance) + that of the latent's lights: discs, and smooth lobes of what is wider.
//!
//! All entry points give the same bits for the same direction: one direction, a batch, a baked panorama; but for the lights, of
//! which a pixel holds the exact part that lies in it. Functions of log radiance leave the lights out. The kernels run at the
//! widest SIMD the processor has.
//!
//! The residual perceptron of steps 2 to 4 is written six times, each for a speed or a language of its own:
//! - `block`: a block of directions at a time, what everything here runs on; `single`: one direction. The same bits:
//!   `tests/properties.rs`, `every_entry_point_gives_the_same_bits`.
//! - `gradient/pass`: kept for the way back. Against differences of the reference: `tests/gradient.rs`.
//! - WGSL (`veni-gpu/shaders`). Against `block`: `veni-gpu/tests/gpu/cross_check.rs`.
//! - burn (`veni-core`, `vae::decoder`). Against these kernels: its `tests/kernels.rs`, values and gradients.
//! - the reference in f64, by the definitions: `tests/reference.rs`, to which `block` is held at many sizes and in every form.

mod aligned;
mod bake;
#[cfg_attr(
    not(all(target_arch = "x86_64", feature = "training")),
    allow(dead_code, unreachable_pub, reason = "without kernels nothing reads what they are given")
)]
pub(crate) mod bfloat16;
mod block;
mod condition;
mod evaluator;
#[cfg(feature = "gradients")]
pub(crate) mod gradient;
mod lights;
mod lobes;
mod math;
mod mlp;
mod rate;
mod single;
mod weights;

use std::sync::Arc;

use crate::compact::{Emitter, Lights};
use crate::latent::{Latent, Lobe};
use crate::model::Model;
use crate::{Error, Result};
use weights::Weights;

#[cfg(feature = "training")]
pub mod training;

pub use evaluator::Evaluator;
#[cfg(feature = "gradients")]
pub use gradient::{Gradient, LocalQuadratic, Moments, NormalEquations};
pub use rate::multiply_add_rate;

/// Largest |z_x|, |z_y| of a latent. Beyond it f32 does not resolve the phase of the encoding; trained codes
/// stay below 10.
pub const MAX_COORDINATE: f32 = 65536.0;

/// A decoder ready to be conditioned. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Decoder {
    weights: Arc<Weights>,
}

/// The radiance field of one latent. Cheap to clone, usable from many threads.
#[derive(Clone, Debug)]
pub struct Field {
    weights: Arc<Weights>,
    folded: Arc<Folded>,
}

/// What remains of a latent.
#[derive(Clone, Debug)]
struct Folded {
    /// xy of the latent vectors.
    vectors: Vec<[f32; 2]>,
    /// Bias of the residual projection plus the first layer's attention.
    input_bias: Vec<f32>,
    /// Zeros of the same length.
    no_bias: Vec<f32>,
    /// Per layer: β of its second norm plus the next layer's attention.
    shift: Vec<Vec<f32>>,
    lobes: Vec<Lobe>,
    /// In units of radiance: exposure included.
    lights: Lights,
    /// The lights as what is asked for a direction.
    emitters: Vec<Emitter>,
    log_exposure: f32,
}

/// A conditioned latent as plain numbers, for evaluators other than this module: a shader, for instance. Its lights are
/// [`Field::lights`]. h is the decoder's hidden size; the vectors may be longer, padded with zeros.
#[derive(Clone, Copy, Debug)]
pub struct FoldedLatent<'a> {
    /// x and y of the N latent vectors.
    pub vectors: &'a [[f32; 2]],
    /// Bias of the input projection plus the first layer's attention.
    pub input_bias: &'a [f32],
    /// For every layer β of its second norm plus the next layer's attention.
    pub shifts: &'a [Vec<f32>],
    /// Added to the network's output.
    pub lobes: &'a [Lobe],
    /// Added to the network's output.
    pub log_exposure: f32,
}

impl Model {
    /// The decoder of this model, packed for evaluation (about a millisecond). Keep it for many latents.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if the network is not the paper's; see
    /// [`check_folds`](crate::model::DecoderConfig::check_folds).
    pub fn decoder(&self) -> Result<Decoder> {
        self.config().decoder.check_folds()?;
        Ok(Decoder { weights: Arc::new(Weights::new(self)) })
    }
}

impl Decoder {
    /// N, the number of latent vectors.
    pub fn latent_vectors(&self) -> usize {
        self.weights.latent_vectors
    }

    /// Folds a latent. Takes microseconds.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the latent has another number of vectors, belongs to another model, holds a number
    /// that is not finite, or a coordinate beyond [`MAX_COORDINATE`].
    pub fn condition(&self, latent: &Latent) -> Result<Field> {
        let weights = &self.weights;
        let (n, m) = (weights.latent_vectors, latent.vectors.len());
        if n != m {
            return Err(Error::invalid(format!("the latent has {m} vectors, the model needs {n}")));
        }
        if let Some(model) = latent.model.as_ref().filter(|model| **model != weights.model) {
            let ours = &weights.model;
            return Err(Error::invalid(format!(
                "the latent belongs to model {model}, this is {ours}; load that model, or encode or fit again"
            )));
        }
        latent.check_finite()?;
        let large = |v: &[f32; 3]| v.iter().any(|c| c.abs() > MAX_COORDINATE);
        if let Some(i) = latent.vectors.iter().position(large) {
            let v = latent.vectors[i];
            return Err(Error::invalid(format!("latent vector {i} is {v:?}, beyond {MAX_COORDINATE}")));
        }
        let attention = condition::attention(weights, latent);
        let plus = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a + b).collect::<Vec<f32>>();
        let mut input_bias = plus(&weights.input_bias, &attention[0]);
        input_bias.resize(weights.mlp.padded(), 0.0);
        let next = attention[1..].iter().map(Some).chain([None]);
        let shift = weights.attention.iter().zip(next);
        let shift = shift.map(|(layer, next)| match next {
            Some(attention) => plus(&layer.beta2, attention),
            None => layer.beta2.clone(),
        });
        let lights = latent.lights.scaled(latent.log_exposure.exp());
        let folded = Folded {
            lobes: latent.lobes.clone(),
            emitters: emitters(&lights),
            lights,
            vectors: latent.vectors.iter().map(|[x, y, _]| [*x, *y]).collect(),
            no_bias: vec![0.0; weights.mlp.padded()],
            input_bias,
            shift: shift.collect(),
            log_exposure: latent.log_exposure,
        };
        Ok(Field { weights: Arc::clone(weights), folded: Arc::new(folded) })
    }
}

impl Field {
    /// What conditioning left of the latent.
    pub fn folded(&self) -> FoldedLatent<'_> {
        let Folded { vectors, input_bias, shift, lobes, log_exposure, .. } = &*self.folded;
        FoldedLatent { vectors, input_bias, shifts: shift, lobes, log_exposure: *log_exposure }
    }

    /// The same scene rotated by `radians` about z, counter-clockwise seen from above. Exact: it rotates the latent,
    /// not the picture.
    #[must_use]
    pub fn rotated(&self, radians: f64) -> Self {
        let (sin, cos) = radians.sin_cos();
        let rotate = |[x, y]: &[f32; 2]| {
            let (x, y) = (f64::from(*x), f64::from(*y));
            [(x * cos - y * sin) as f32, (x * sin + y * cos) as f32]
        };
        let mut folded = Folded::clone(&self.folded);
        folded.vectors = folded.vectors.iter().map(rotate).collect();
        folded.lobes = folded.lobes.iter().map(|lobe| lobe.rotated(radians)).collect();
        folded.set_lights(folded.lights.rotated(radians));
        Self { weights: Arc::clone(&self.weights), folded: Arc::new(folded) }
    }

    /// The same scene `stops` brighter: radiance times 2^stops.
    #[must_use]
    pub fn brightened(&self, stops: f32) -> Self {
        let mut folded = Folded::clone(&self.folded);
        folded.log_exposure += stops * std::f32::consts::LN_2;
        folded.set_lights(folded.lights.scaled(stops.exp2()));
        Self { weights: Arc::clone(&self.weights), folded: Arc::new(folded) }
    }

    /// The same field with these lights instead of its own, in units of radiance.
    #[must_use]
    pub fn with_lights(&self, lights: Lights) -> Self {
        let mut folded = Folded::clone(&self.folded);
        folded.set_lights(lights);
        Self { weights: Arc::clone(&self.weights), folded: Arc::new(folded) }
    }
}

impl Folded {
    fn set_lights(&mut self, lights: Lights) {
        self.emitters = emitters(&lights);
        self.lights = lights;
    }
}

fn emitters(lights: &Lights) -> Vec<Emitter> {
    lights.iter().filter_map(Emitter::new).collect()
}

#[cfg(test)]
mod tests;
