//! What a configuration asks for as a whole: settings that are each within bounds can be too much together.

use super::TrainConfig;
use crate::{Error, Result};
use veni_fit::encoder::encoder_schema;
use veni_image::memory;
use veni_light::limits::MAX_MODEL_BYTES;
use veni_light::model::{ModelKind, decoder_schema};

/// Values of a pixel that are in memory at least: three channels each of the panorama, of the prediction and of its gradient.
const VALUES_PER_PIXEL: u64 = 9;

impl TrainConfig {
    /// Checks weights and pixels before anything is allocated.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the settings if no model file could hold the weights, or a batch does not fit into memory.
    pub(super) fn check_size(&self) -> Result<()> {
        let mut shapes = decoder_schema(&self.model);
        if self.model.kind == ModelKind::Veni {
            shapes.extend(encoder_schema(&self.model)?);
        }
        let count = |shape: &[usize]| shape.iter().fold(1_u64, |n, side| n.saturating_mul(*side as u64));
        let weights = shapes.iter().fold(0_u64, |sum, (_, shape)| sum.saturating_add(count(shape)));
        let bytes = weights.saturating_mul(size_of::<f32>() as u64);
        if bytes > MAX_MODEL_BYTES {
            return Err(Error::invalid(format!(
                "model: its {weights} weights take {} MiB, and a model file holds {} MiB at most; lower the sizes of model.encoder \
                 and model.decoder",
                bytes >> 20,
                MAX_MODEL_BYTES >> 20
            )));
        }
        if self.model.kind == ModelKind::Veni {
            // of a batch in parts one is in memory at a time
            let batch = self.batch.div_ceil(self.accumulate.max(1));
            let (width, height) = (self.data.width, self.data.height);
            let pixels = [batch, width, height].iter().fold(1_u64, |n, side| n.saturating_mul(*side as u64));
            memory::check(pixels.saturating_mul(VALUES_PER_PIXEL * size_of::<f32>() as u64)).map_err(
                |e| {
                    Error::invalid(format!(
                        "batch = {}, accumulate = {}, data.width = {width}, data.height = {height}: {e}",
                        self.batch, self.accumulate
                    ))
                },
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::train::config::TrainConfig;
    use crate::train::presets::Preset;

    #[test]
    fn what_is_too_much_together_is_refused_by_name() {
        let with = |change: &dyn Fn(&mut TrainConfig)| {
            let mut config = Preset::Tiny.config(9);
            change(&mut config);
            config.check().map_err(|e| e.to_string())
        };
        with(&|_| ()).unwrap();
        let deep = with(&|config| (config.model.decoder.hidden, config.model.decoder.layers) = (8192, 256));
        assert!(
            deep.as_ref().is_err_and(|e| e.contains("weights take") && e.contains("1024 MiB")),
            "{deep:?}"
        );
        let wide = with(&|config| {
            (config.batch, config.data.width, config.data.height) = (65_536, 8192, 4096);
        });
        if veni_image::memory::available().is_some() {
            assert!(wide.as_ref().is_err_and(|e| e.contains("batch = 65536")), "{wide:?}");
        }
    }
}
