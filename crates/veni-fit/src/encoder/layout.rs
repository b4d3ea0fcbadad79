//! What depends on the grid of an image and not on the image, kept for the next one.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use veni_light::Result;
use veni_light::sphere::{Equirect, Gather};

use super::Encoder;

/// Directions of the encoder's own stripes, and where to look them up.
#[derive(Debug, Default)]
pub(super) struct Layout {
    directions: OnceLock<Directions>,
    /// Of the last grid.
    gather: Mutex<Option<Arc<Gather>>>,
}

/// The encoder's own directions.
#[derive(Debug)]
pub(super) struct Directions {
    /// `[stripe, sample]`.
    pub(super) directions: Vec<[f32; 3]>,
    /// Their part of the tokens.
    pub(super) folded: Vec<f32>,
}

impl Layout {
    pub(super) fn directions(&self, encoder: &Encoder) -> Result<&Directions> {
        if let Some(directions) = self.directions.get() {
            return Ok(directions);
        }
        let stripes = encoder.stripes()?;
        let samples = encoder.config.samples.unwrap_or(1);
        encoder.check_size(stripes.stripes() * stripes.samples() / samples)?;
        let directions = stripes.directions();
        let folded = encoder.project_in.fold(&directions, encoder.coordinates);
        Ok(self.directions.get_or_init(|| Directions { directions, folded }))
    }

    pub(super) fn gather(&self, encoder: &Encoder, grid: Equirect) -> Result<Arc<Gather>> {
        // a poisoned lock guards a table that is whole or absent
        let mut kept = self.gather.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(gather) = kept.as_ref().filter(|gather| gather.grid() == grid) {
            return Ok(Arc::clone(gather));
        }
        let gather = Arc::new(encoder.stripes()?.gather(grid));
        *kept = Some(Arc::clone(&gather));
        Ok(gather)
    }
}
