//! Image metrics and rank correlation.

use crate::{Outcome, case::Case};
use burn::tensor::Device;
use veni::eval::metrics::{pearson, spearman};

/// See [`Family`](crate::Family). No gradients and no tensors: the device plays no part.
pub(crate) fn run(case: &Case, _device: &Device) -> Option<Outcome> {
    if case.module().starts_with("Spearman rank correlation") {
        correlation(case);
        return Some(Outcome::Compared);
    }
    None
}

/// `out.<kind>_<ab>`: the inputs are named by one letter each.
fn correlation(case: &Case) {
    for name in case.tensors.keys().filter(|n| n.starts_with("out.")) {
        let (kind, pair) = name["out.".len()..].rsplit_once('_').expect("a name like spearman_ab");
        let [a, b] = [&pair[..1], &pair[1..]]
            .map(|n| case.data(&format!("in.{n}")).values.iter().map(|&v| f64::from(v)).collect::<Vec<_>>());
        let ours = match kind {
            "spearman" => spearman(&a, &b),
            "pearson" => pearson(&a, &b),
            _ => continue,
        };
        case.compare_scalar(name, ours.expect("a defined correlation"));
    }
}
