//! Learning-rate and loss-weight schedules. Their files name no module: recognised by their step inputs.

use crate::case::{Case, Data};
use crate::{Outcome, Outcome::Compared};
use burn::tensor::Device;
use serde_json::Value;
use veni::train::schedule::{LearningRate, Ramp, WeightSchedule};

/// See [`Family`](crate::Family). No tensors: the device plays no part.
pub(crate) fn run(case: &Case, _device: &Device) -> Option<Outcome> {
    if !case.module().is_empty() {
        return None;
    }
    if case.expects("in.steps") && case.config.get("linear").or(case.config.get("sigmoid")).is_some() {
        weights(case);
    } else if case.expects("in.steps_cosine") || case.expects("in.steps_exp") {
        learning_rates(case);
    } else {
        return None;
    }
    Some(Compared)
}

fn number(options: &Value, key: &str) -> Option<f64> {
    options.get(key).and_then(Value::as_f64)
}

fn need(options: &Value, key: &str) -> f64 {
    number(options, key).unwrap_or_else(|| panic!("no number `{key}` in {options}"))
}

fn compare(case: &Case, output: &str, steps: &Data, at: impl Fn(u64) -> f64) {
    let values = steps.values.iter().map(|&s| at(s as u64) as f32).collect();
    case.compare(output, &Data::new(steps.shape.clone(), values));
}

fn weights(case: &Case) {
    let steps = case.data("in.steps");
    if let Some(o) = case.config.get("linear") {
        let schedule = WeightSchedule::Linear {
            start_step: need(o, "start_step") as u64,
            end_step: need(o, "end_step") as u64,
            start_weight: need(o, "start_weight"),
            end_weight: need(o, "end_weight"),
        };
        compare(case, "out.linear", steps, |t| schedule.at(t));
    }
    if let Some(o) = case.config.get("sigmoid") {
        let weight = number(o, "weight").unwrap_or(1.0);
        let schedule =
            WeightSchedule::Sigmoid { centre: need(o, "x_shift"), width: need(o, "x_mult"), weight };
        compare(case, "out.sigmoid", steps, |t| schedule.at(t));
    }
}

fn learning_rates(case: &Case) {
    for output in case.tensors.keys().filter(|n| n.starts_with("out.")) {
        let name = &output["out.".len()..];
        // An entry may serve several parameter groups, or be "as <other> with ramp <shape>".
        let group = name.rsplit_once('_').and_then(|(head, _)| case.config.get(head));
        let Some(mut options) = case.config.get(name).or(group) else { continue };
        let mut ramp = options.get("ramp").and_then(Value::as_str);
        if let Some(text) = options.as_str() {
            let words: Vec<_> = text.split(' ').collect();
            let ["as", other, "with", "ramp", shape] = words[..] else { continue };
            (options, ramp) = (&case.config[other], Some(shape));
        }
        let (steps, schedule) = if name.starts_with("cosine") {
            let rates = &options["lr"];
            let index = usize::from(name.ends_with("field"));
            let rate = rates.as_f64().or_else(|| rates.get(index)?.as_f64()).expect("a rate");
            let schedule = LearningRate::Cosine {
                rate,
                warm_up: need(options, "warm_up_end") as u64,
                steps: need(options, "max_steps") as u64,
                floor: need(options, "alpha"),
                periodic: true,
            };
            (case.data("in.steps_cosine"), schedule)
        } else {
            let schedule = LearningRate::Exponential {
                rate: need(options, "lr"),
                last: need(options, "lr_final"),
                steps: need(options, "max_steps") as u64,
                warm_up: number(options, "warmup_steps").unwrap_or(0.0) as u64,
                before: number(options, "lr_pre_warmup").unwrap_or(0.0),
                ramp: if ramp == Some("linear") { Ramp::Linear } else { Ramp::Cosine },
            };
            (case.data("in.steps_exp"), schedule)
        };
        compare(case, output, steps, |t| schedule.at(t));
    }
}
