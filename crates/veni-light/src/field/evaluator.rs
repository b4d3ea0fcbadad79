//! A field with workspace of its own: for callers that ask for one direction after the other.

use super::aligned::Aligned;
use super::{Field, bake};

/// Evaluates a [`Field`] on the calling thread without allocating once it is warm: a ray tracer keeps one per thread. To the
/// bit what the field's own functions give.
///
/// ```
/// use veni_light::latent::{Latent, Prior};
/// use veni_light::model::{Model, ModelConfig};
///
/// let model = Model::filler(&ModelConfig::decode_only(9), 1)?;
/// let field = model.decoder()?.condition(&Latent::from_seed(&Prior::standard(9), 7))?;
/// let mut evaluator = field.evaluator();
/// assert_eq!(evaluator.radiance([0.6, 0.0, 0.8]), field.radiance([0.6, 0.0, 0.8]));
/// # Ok::<(), veni_light::Error>(())
/// ```
#[derive(Debug)]
pub struct Evaluator {
    field: Field,
    scratch: Aligned,
}

impl Field {
    /// An evaluator of this field.
    pub fn evaluator(&self) -> Evaluator {
        Evaluator { field: self.clone(), scratch: Aligned::default() }
    }
}

impl Evaluator {
    /// The field that is evaluated.
    pub fn field(&self) -> &Field {
        &self.field
    }

    /// Linear RGB radiance from unit direction `direction`.
    pub fn radiance(&mut self, direction: [f32; 3]) -> [f32; 3] {
        let mut out = [[0.0; 3]];
        self.field.run(&[direction], &mut out, false, &mut self.scratch);
        out[0]
    }

    /// Natural log of [`Evaluator::radiance`] without the lights.
    pub fn log_radiance(&mut self, direction: [f32; 3]) -> [f32; 3] {
        let mut out = [[0.0; 3]];
        self.field.run(&[direction], &mut out, true, &mut self.scratch);
        out[0]
    }

    /// Linear RGB radiance from many unit directions, one block after the other.
    ///
    /// # Panics
    /// If `out` is not as long as `directions`.
    pub fn radiance_batch(&mut self, directions: &[[f32; 3]], out: &mut [[f32; 3]]) {
        let (n, m) = (directions.len(), out.len());
        assert!(n == m, "{n} directions need memory for {n} radiances, not {m}");
        for (directions, out) in directions.chunks(bake::TASK).zip(out.chunks_mut(bake::TASK)) {
            self.field.run(directions, out, false, &mut self.scratch);
        }
    }
}
