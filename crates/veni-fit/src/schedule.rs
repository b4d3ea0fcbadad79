//! How a learning rate, or the weight of a loss, changes over the steps.

use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A learning rate over the steps t = 0, 1, 2, ...
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind", deny_unknown_fields)]
pub enum LearningRate {
    /// Always `rate`.
    Constant {
        /// The rate.
        rate: f64,
    },
    /// `rate`·t/`warm_up` below `warm_up` (so 0 in the first step); from there to `steps` half a cosine
    /// from `rate` down to `floor`·`rate`. Beyond `steps` it stays there, or with `periodic` (the reference's
    /// program, whose cosine is not cut off) rises again.
    Cosine {
        /// The highest rate.
        rate: f64,
        /// Steps of linear warm-up.
        warm_up: u64,
        /// The step at which the floor is reached.
        steps: u64,
        /// The final fraction of `rate`.
        floor: f64,
        /// Whether the cosine goes on after `steps`.
        #[serde(default)]
        periodic: bool,
    },
    /// From `before` up to `rate` in `warm_up` steps, then exponentially down to `last` at `steps`:
    /// exp((1 − u) ln `rate` + u ln `last`), u = (t − `warm_up`)/(`steps` − `warm_up`), constant after.
    Exponential {
        /// The highest rate.
        rate: f64,
        /// The final rate.
        last: f64,
        /// The step at which `last` is reached.
        steps: u64,
        /// Steps of warm-up; 0 for none.
        #[serde(default)]
        warm_up: u64,
        /// The rate in step 0 when there is a warm-up.
        #[serde(default)]
        before: f64,
        /// Shape of the warm-up.
        #[serde(default)]
        ramp: Ramp,
    },
}

/// Shape of a warm-up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ramp {
    /// A quarter of a sine: steep first, flat at the end.
    #[default]
    Cosine,
    /// A straight line.
    Linear,
}

impl LearningRate {
    /// The rate in step `step`.
    pub fn at(&self, step: u64) -> f64 {
        match *self {
            Self::Constant { rate } => rate,
            Self::Cosine { rate, warm_up, steps, floor, periodic } => {
                if step < warm_up {
                    return rate * step as f64 / warm_up as f64;
                }
                let u = fraction(step, warm_up, steps);
                let u = if periodic { u } else { u.min(1.0) };
                rate * (floor + (1.0 - floor) * 0.5 * (1.0 + (PI * u).cos()))
            }
            Self::Exponential { rate, last, steps, warm_up, before, ramp } => {
                if step < warm_up {
                    let u = step as f64 / warm_up as f64;
                    let u = match ramp {
                        Ramp::Cosine => (0.5 * PI * u).sin(),
                        Ramp::Linear => u,
                    };
                    return before + (rate - before) * u;
                }
                let u = fraction(step, warm_up, steps).min(1.0);
                (rate.ln() * (1.0 - u) + last.ln() * u).exp()
            }
        }
    }
}

/// How far `step` is between `from` and `to`; 1 where nothing lies between them.
fn fraction(step: u64, from: u64, to: u64) -> f64 {
    if to > from { step.saturating_sub(from) as f64 / (to - from) as f64 } else { 1.0 }
}

/// The weight of a loss over the steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", untagged, deny_unknown_fields)]
pub enum WeightSchedule {
    /// Always the same; in a file just the number.
    Constant(f64),
    /// Along a line from `start_weight` at `start_step` to `end_weight` at `end_step`; constant outside.
    Linear {
        /// Where the line begins.
        start_step: u64,
        /// Where it ends.
        end_step: u64,
        /// The weight until `start_step`.
        start_weight: f64,
        /// The weight from `end_step` on.
        end_weight: f64,
    },
    /// `weight`/(1 + exp(−(t − `centre`)/`width`)).
    Sigmoid {
        /// The step of half the weight.
        centre: f64,
        /// Steps over which the exponent changes by one.
        width: f64,
        /// The final weight.
        weight: f64,
    },
}

impl WeightSchedule {
    /// The weight in step `step`.
    pub fn at(&self, step: u64) -> f64 {
        match *self {
            Self::Constant(weight) => weight,
            Self::Linear { start_step, end_step, start_weight, end_weight } => {
                let u = if step <= start_step { 0.0 } else { fraction(step, start_step, end_step).min(1.0) };
                start_weight + (end_weight - start_weight) * u
            }
            Self::Sigmoid { centre, width, weight } => {
                weight / (1.0 + (-(step as f64 - centre) / width).exp())
            }
        }
    }

    /// Whether it is 0 for ever, so that the loss need not be computed.
    pub fn is_off(&self) -> bool {
        match *self {
            Self::Constant(weight) | Self::Sigmoid { weight, .. } => weight == 0.0,
            Self::Linear { start_weight, end_weight, .. } => start_weight == 0.0 && end_weight == 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cosine_warms_up_falls_and_stays() {
        let rate = LearningRate::Cosine { rate: 2.0, warm_up: 10, steps: 110, floor: 0.1, periodic: false };
        assert_eq!(rate.at(0), 0.0);
        assert_eq!(rate.at(5), 1.0);
        assert_eq!(rate.at(10), 2.0);
        assert!((rate.at(60) - 1.1).abs() < 1e-12);
        assert!((rate.at(110) - 0.2).abs() < 1e-12 && rate.at(150) == rate.at(110));
        let LearningRate::Cosine { rate, warm_up, steps, floor, .. } = rate else { unreachable!() };
        let periodic = LearningRate::Cosine { rate, warm_up, steps, floor, periodic: true };
        assert!((periodic.at(210) - 2.0).abs() < 1e-12, "rises again");
    }

    #[test]
    fn exponential_halves_evenly() {
        let rate = LearningRate::Exponential {
            rate: 1.0,
            last: 0.25,
            steps: 20,
            warm_up: 0,
            before: 0.0,
            ramp: Ramp::Cosine,
        };
        assert!((rate.at(10) - 0.5).abs() < 1e-12 && (rate.at(99) - 0.25).abs() < 1e-12);
    }

    #[test]
    fn degenerate_spans_do_not_divide_by_zero() {
        let line = WeightSchedule::Linear { start_step: 5, end_step: 5, start_weight: 1.0, end_weight: 2.0 };
        assert_eq!((line.at(5), line.at(6)), (1.0, 2.0));
        let rate = LearningRate::Cosine { rate: 1.0, warm_up: 3, steps: 3, floor: 0.5, periodic: false };
        assert!((rate.at(3) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_weight_in_a_file_is_a_number_or_a_table() {
        let read = |text: &str| serde_json::from_str::<WeightSchedule>(text);
        assert_eq!(read("0.5").unwrap(), WeightSchedule::Constant(0.5));
        let sigmoid = read(r#"{"centre": 20, "width": 7, "weight": 1}"#).unwrap();
        assert!((sigmoid.at(20) - 0.5).abs() < 1e-12);
        assert!(read(r#"{"centre": 20, "wdith": 7, "weight": 1}"#).is_err());
    }
}
