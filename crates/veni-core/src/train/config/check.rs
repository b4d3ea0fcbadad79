//! What types cannot say about a configuration.

use super::{DecoderBackend, LossGrid, TrainConfig};
use crate::{Error, Result};
use veni_data::AugmentConfig;
use veni_light::model::ModelKind;

impl TrainConfig {
    /// Checks what types cannot.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the key, its value and what is allowed.
    pub fn check(&self) -> Result<()> {
        self.model.validate()?;
        self.augment.check()?;
        self.check_bounds()?;
        self.check_system()?;
        self.check_size()?;
        let factor = self.loss_grid.factor();
        let (w, h) = (self.data.width, self.data.height);
        if factor == 0 || !w.is_multiple_of(factor) || !h.is_multiple_of(factor) {
            return Err(Error::invalid(format!(
                "loss_grid.factor = {factor} does not divide {w} × {h} pixels"
            )));
        }
        self.check_parts()?;
        if self.decoder_backend == DecoderBackend::KernelsBfloat16 {
            self.model.decoder.check_folds().map_err(|_| {
                Error::invalid(
                    "decoder_backend = kernels-bfloat16: kernels compute the paper's decoder only (attention, vn, so2); take \
                     decoder_backend = tensors",
                )
            })?;
        }
        if !(0.0..1.0).contains(&self.ema_decay) {
            return Err(Error::invalid(format!("ema_decay = {}: must lie in 0..1", self.ema_decay)));
        }
        for (name, group) in self.groups() {
            let ends = [0, self.steps / 2, self.steps].map(|step| group.learning_rate.at(step));
            if let Some(rate) = ends.into_iter().find(|rate| !(*rate >= 0.0 && rate.is_finite())) {
                return Err(Error::invalid(format!(
                    "{name}.learning_rate = {rate}: must be finite and at least 0"
                )));
            }
        }
        self.check_stages()
    }

    /// In how many parts a batch is computed.
    fn check_parts(&self) -> Result<()> {
        let (batch, accumulate, devices) = (self.batch, self.accumulate, &self.devices);
        if accumulate == 0 || accumulate > batch {
            return Err(Error::invalid(format!(
                "accumulate = {accumulate}: must lie in 1..={batch} (batch)"
            )));
        }
        if accumulate * devices.count() > batch {
            let parts = if accumulate > 1 { format!(" in {accumulate} parts each") } else { String::new() };
            return Err(Error::invalid(format!(
                "devices = {devices}: batch = {batch} cannot be shared among {}{parts}; raise batch, or name fewer",
                devices.count()
            )));
        }
        Ok(())
    }

    /// What the two systems need, and must not have.
    fn check_system(&self) -> Result<()> {
        let missing = |what: &str, system: &str| Err(Error::invalid(format!("{what} is missing: {system}")));
        let foreign = |what: &str, system: &str| Err(Error::invalid(format!("{what}: {system} has none")));
        match self.model.kind {
            ModelKind::Veni => {
                let system = "an auto-encoder (model.kind = veni) is trained";
                match (&self.model.encoder, &self.encoder, &self.latents) {
                    (None, _, _) => missing("model.encoder", system),
                    (_, None, _) => missing("encoder", system),
                    (_, _, Some(_)) => foreign("latents", "an auto-encoder (model.kind = veni)"),
                    (Some(_), Some(_), None) => Ok(()),
                }
            }
            ModelKind::Reni => {
                let system = "an auto-decoder (model.kind = reni)";
                match (&self.model.encoder, &self.encoder, &self.latents) {
                    (Some(_), _, _) => return foreign("model.encoder", system),
                    (_, Some(_), _) => return foreign("encoder", system),
                    (_, _, None) => return missing("latents", &format!("{system} is trained")),
                    (None, None, Some(latents)) => latents.check(self.batch)?,
                }
                if self.accumulate > 1 {
                    return Err(Error::invalid(format!(
                        "accumulate = {}: the losses of an auto-decoder are taken over its whole batch; to save memory \
                         lower latents.rays",
                        self.accumulate
                    )));
                }
                if self.devices.count() > 1 {
                    return Err(Error::invalid(format!(
                        "devices = {}: the losses of an auto-decoder are taken over its whole batch, which cannot be \
                         shared; name one",
                        self.devices
                    )));
                }
                if !self.loss.mage.is_off() {
                    return foreign("loss.mage", "a set of rays, which an auto-decoder is trained on,");
                }
                if !self.loss.irradiance.is_off() {
                    return foreign("loss.irradiance", "a set of rays, which an auto-decoder is trained on,");
                }
                if !matches!(self.loss_grid, LossGrid::Full {}) {
                    return foreign(
                        "loss_grid",
                        "an auto-decoder, which is trained on rays (leave it full),",
                    );
                }
                if self.augment != AugmentConfig::default() {
                    let system = "an auto-decoder, whose latents belong to the panoramas as they are,";
                    return foreign("augment", system);
                }
                Ok(())
            }
        }
    }
}
