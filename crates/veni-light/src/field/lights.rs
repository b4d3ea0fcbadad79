//! A field's compact lights. MODEL (71).

use super::Field;
use crate::compact::Lights;

impl Field {
    /// The compact lights, exposure included: what [`Field::radiance`] adds to the network's.
    pub fn lights(&self) -> &Lights {
        &self.folded.lights
    }

    /// The same field without its lights.
    #[must_use]
    pub fn without_lights(&self) -> Self {
        self.with_lights(Lights::default())
    }
}
