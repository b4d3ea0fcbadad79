//! The range of every number in a configuration. Beyond these an update is not finite, or memory that no machine has is
//! asked for, after the work instead of before.

use super::{GroupConfig, TrainConfig};
use crate::{Error, Result};
use veni_fit::schedule::{LearningRate, WeightSchedule};

/// A setting's name, its value, and the least and largest that it may have.
type Bound = (String, f64, f64, f64);

/// Most updates of a run: ten thousand years at a thousand a second are fewer.
const MOST_STEPS: f64 = 1e14;
/// Largest learning rate: Adam moves every weight by about this much in an update, and weights are of the order of 0.1.
const MOST_RATE: f64 = 10.0;
/// Largest weight of a loss: losses are of the order of 1, and gradients are clipped or squared in f32.
const MOST_WEIGHT: f64 = 1e6;
/// Most panoramas in a batch, and most that are generated.
const MOST_BATCH: f64 = 65_536.0;
const MOST_PANORAMAS: f64 = 1e8;
/// Most columns of a training panorama.
const MOST_WIDTH: f64 = 8192.0;
/// Most directions of a step of an auto-decoder.
const MOST_RAYS: f64 = (1 << 26) as f64;
/// Most scales of MAGE: each halves the image.
const MOST_SCALES: f64 = 16.0;

impl TrainConfig {
    /// Checks every number against its bounds.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the setting, its value and the bounds.
    pub(super) fn check_bounds(&self) -> Result<()> {
        let mut all = vec![
            bound("steps", self.steps as f64, 0.0, MOST_STEPS),
            bound("batch", self.batch as f64, 1.0, MOST_BATCH),
            bound("accumulate", self.accumulate as f64, 1.0, MOST_BATCH),
            bound("data.width", self.data.width as f64, 2.0, MOST_WIDTH),
            bound("data.height", self.data.height as f64, 2.0, MOST_WIDTH / 2.0),
            bound("data.val_share", self.data.val_share, 0.0, 1.0),
            bound("data.synthetic", self.data.synthetic as f64, 0.0, MOST_PANORAMAS),
            bound("data.synthetic_share", self.data.synthetic_share.unwrap_or(0.0), 0.0, 1.0),
            bound("loss.mage_scales", self.loss.mage_scales as f64, 1.0, MOST_SCALES),
            bound("report.train_subset", self.report.train_subset as f64, 0.0, MOST_PANORAMAS),
            bound("report.prior_copies", self.report.prior_copies as f64, 0.0, 1e4),
        ];
        for (name, weight) in self.loss_weights() {
            weights(&mut all, &format!("loss.{name}"), weight);
        }
        for (name, group) in self.groups() {
            group_bounds(&mut all, if name == "latents" { "latents.optimiser" } else { name }, group);
        }
        if let Some(latents) = &self.latents {
            let fit = &latents.validation;
            rates(&mut all, "latents.validation.learning_rate", &fit.learning_rate);
            all.extend([
                bound("latents.rays", latents.rays as f64, 1.0, MOST_RAYS),
                bound("latents.validation.steps", fit.steps as f64, 0.0, 1e9),
                bound("latents.validation.epsilon", fit.epsilon, f64::MIN_POSITIVE, 1.0),
                bound("latents.validation.prior", fit.prior, 0.0, MOST_WEIGHT),
                bound(
                    "latents.validation_panoramas",
                    latents.validation_panoramas as f64,
                    0.0,
                    MOST_PANORAMAS,
                ),
                bound("latents.validation_factor", latents.validation_factor as f64, 1.0, MOST_WIDTH),
            ]);
        }
        // a NaN is in no range
        if let Some((name, value, least, most)) =
            all.into_iter().find(|(_, value, least, most)| !(*least..=*most).contains(value))
        {
            return Err(Error::invalid(format!("{name} = {value}: must lie in {least}..={most}")));
        }
        if self.loss_weights().iter().all(|(_, weight)| weight.is_off()) {
            return Err(Error::invalid(
                "loss: every weight is 0, so that nothing would be learned; raise one",
            ));
        }
        Ok(())
    }

    /// The weights of the losses by their names.
    fn loss_weights(&self) -> [(&'static str, &WeightSchedule); 9] {
        let loss = &self.loss;
        [
            ("mage", &loss.mage),
            ("scale_invariant", &loss.scale_invariant),
            ("exposure", &loss.exposure),
            ("cosine", &loss.cosine),
            ("kld", &loss.kld),
            ("log_mse", &loss.log_mse),
            ("hdr_mse", &loss.hdr_mse),
            ("ldr_mse", &loss.ldr_mse),
            ("irradiance", &loss.irradiance),
        ]
    }
}

fn bound(name: &str, value: f64, least: f64, most: f64) -> Bound {
    (name.to_owned(), value, least, most)
}

fn weights(all: &mut Vec<Bound>, name: &str, weight: &WeightSchedule) {
    match *weight {
        WeightSchedule::Constant(weight) => all.push(bound(name, weight, 0.0, MOST_WEIGHT)),
        WeightSchedule::Linear { start_weight, end_weight, .. } => all.extend([
            bound(&format!("{name}.start_weight"), start_weight, 0.0, MOST_WEIGHT),
            bound(&format!("{name}.end_weight"), end_weight, 0.0, MOST_WEIGHT),
        ]),
        WeightSchedule::Sigmoid { centre, width, weight } => all.extend([
            bound(&format!("{name}.centre"), centre, -MOST_STEPS, MOST_STEPS),
            bound(&format!("{name}.width"), width, f64::MIN_POSITIVE, MOST_STEPS),
            bound(&format!("{name}.weight"), weight, 0.0, MOST_WEIGHT),
        ]),
    }
}

fn rates(all: &mut Vec<Bound>, name: &str, rate: &LearningRate) {
    let one = |key: &str, value| bound(&format!("{name}.{key}"), value, 0.0, MOST_RATE);
    match *rate {
        LearningRate::Constant { rate } => all.push(one("rate", rate)),
        LearningRate::Cosine { rate, floor, .. } => {
            all.extend([one("rate", rate), bound(&format!("{name}.floor"), floor, 0.0, 1.0)]);
        }
        LearningRate::Exponential { rate, last, before, .. } => {
            all.extend([one("rate", rate), one("last", last), one("before", before)]);
        }
    }
}

fn group_bounds(all: &mut Vec<Bound>, name: &str, group: &GroupConfig) {
    rates(all, &format!("{name}.learning_rate"), &group.learning_rate);
    let adam = &group.adam;
    let below_one = 1.0 - f64::EPSILON;
    all.extend([
        bound(&format!("{name}.adam.beta1"), adam.beta1, 0.0, below_one),
        bound(&format!("{name}.adam.beta2"), adam.beta2, 0.0, below_one),
        bound(&format!("{name}.adam.epsilon"), adam.epsilon, f64::MIN_POSITIVE, 1.0),
        bound(&format!("{name}.adam.weight_decay"), adam.weight_decay, 0.0, 100.0),
        bound(&format!("{name}.adam.clip"), adam.clip.unwrap_or(1.0), f64::MIN_POSITIVE, MOST_WEIGHT),
    ]);
}

#[cfg(test)]
mod tests {
    use crate::train::presets::Preset;

    #[test]
    fn every_setting_has_bounds_that_are_named() {
        let auto_encoder = [
            "batch=1000000000000",
            "steps=200000000000000",
            "accumulate=0",
            "data.width=1000000",
            "data.height=1",
            "data.val_share=-0.1",
            "data.synthetic=1000000000",
            "decoder.learning_rate.rate=1e300",
            "encoder.learning_rate.rate=-1e-3",
            "encoder.learning_rate.rate=nan",
            "decoder.learning_rate.floor=2",
            "decoder.adam.beta1=1",
            "decoder.adam.beta2=-0.5",
            "decoder.adam.epsilon=0",
            "decoder.adam.weight_decay=inf",
            "decoder.adam.clip=0",
            "loss.kld=-1",
            "loss.mage=1e9",
            "loss.ldr_mse=nan",
            "loss.mage_scales=0",
            "report.prior_copies=1000000",
            "ema_decay=1",
        ];
        let auto_decoder = [
            "latents.rays=10000000000",
            "latents.optimiser.learning_rate.rate=1e4",
            "latents.validation.learning_rate.rate=inf",
            "latents.validation.prior=-1",
            "latents.validation_factor=0",
        ];
        let small = [Preset::Small.config(9), Preset::Small.auto_decoder(9)];
        for (config, sets) in small.iter().zip([&auto_encoder[..], &auto_decoder[..]]) {
            config.check().unwrap();
            for set in sets {
                let (name, value) = set.split_once('=').unwrap();
                let message = config.with_overrides(&[set]).unwrap().check().unwrap_err().to_string();
                let value = value.trim_end_matches("e300").trim_end_matches("e9").trim_end_matches("e-3");
                assert!(message.contains(name), "{set}: {message}");
                assert!(message.to_lowercase().contains(&value[..1]), "{set}: {message}");
                assert!(message.contains("..") || message.contains("between"), "{set}: no bounds: {message}");
            }
        }
        let off = [
            "mage",
            "scale_invariant",
            "exposure",
            "cosine",
            "kld",
            "log_mse",
            "hdr_mse",
            "ldr_mse",
            "irradiance",
        ];
        let off: Vec<_> = off.iter().map(|name| format!("loss.{name}=0")).collect();
        let message = small[0].with_overrides(&off).unwrap().check().unwrap_err().to_string();
        assert!(message.contains("every weight is 0"), "{message}");
    }
}
