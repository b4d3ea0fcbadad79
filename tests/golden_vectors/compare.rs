//! The tolerance rule: |ours − golden| ≤ max(10 · f32_err, 1e-6 + 1e-5 · max_abs).

use super::case::Data;
use serde_json::Value;
use std::collections::BTreeMap;

/// How far an f32 implementation may be off for one tensor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerance {
    /// Largest deviation of the reference's f32 run from the same computation in f64.
    pub(crate) f32_err: f64,
    /// Largest magnitude; where the file has none, that of the tensor itself.
    pub(crate) max_abs: Option<f64>,
}

impl Tolerance {
    /// For a tensor without an entry in the file: its own magnitude, no measured error.
    pub(crate) const UNKNOWN: Self = Self { f32_err: 0.0, max_abs: None };

    /// The rule, and at least this absolute deviation.
    pub(crate) fn at_least(self, deviation: f64) -> Self {
        Self { f32_err: self.f32_err.max(0.1 * deviation), ..self }
    }

    fn absolute(self, golden: &Data) -> f64 {
        let own = || golden.values.iter().fold(0.0, |m: f64, v| m.max(f64::from(v.abs())));
        (10.0 * self.f32_err).max(1e-6 + 1e-5 * self.max_abs.unwrap_or_else(own))
    }
}

/// The metadata entry `tol`: tensor name → {f32_err, max_abs}.
pub(crate) fn tolerances(entry: &Value) -> Result<BTreeMap<String, Tolerance>, String> {
    let Some(map) = entry.as_object() else { return Ok(BTreeMap::new()) };
    let number = |name: &str, value: &Value, key: &str| {
        value
            .get(key)
            .and_then(Value::as_f64)
            .ok_or(format!("metadata `tol`: `{name}` has no number `{key}`"))
    };
    map.iter()
        .map(|(name, v)| {
            let max_abs = v.get("max_abs").and_then(Value::as_f64);
            let tolerance = Tolerance { f32_err: number(name, v, "f32_err")?, max_abs };
            Ok((name.clone(), tolerance))
        })
        .collect()
}

/// Element by element: the worst deviation as a multiple of the tolerance. The error counts the failing
/// elements and shows the worst.
pub(crate) fn check(ours: &Data, golden: &Data, tolerance: Tolerance) -> Result<f64, String> {
    if ours.values.len() != golden.values.len() {
        return Err(format!("ours has shape {:?}, golden {:?}", ours.shape, golden.shape));
    }
    let limit = tolerance.absolute(golden);
    let (mut failing, mut worst) = (0, (0, -1.0));
    for (i, (a, b)) in ours.values.iter().zip(&golden.values).enumerate() {
        let difference = if a == b { 0.0 } else { (f64::from(*a) - f64::from(*b)).abs() };
        // NaN is as far off as can be.
        let difference = if difference.is_nan() { f64::INFINITY } else { difference };
        failing += usize::from(difference > limit);
        if difference > worst.1 {
            worst = (i, difference);
        }
    }
    let (i, difference) = worst;
    if failing == 0 {
        return Ok(difference.max(0.0) / limit);
    }
    Err(format!(
        "{failing} of {} elements fail; worst at {:?}: ours {:e}, golden {:e}, deviation {difference:.3e} = {:.1} × the tolerance {limit:.3e}",
        golden.values.len(),
        unravel(i, &golden.shape),
        ours.values[i],
        golden.values[i],
        difference / limit,
    ))
}

/// The multi-index of a row-major position.
fn unravel(mut position: usize, shape: &[usize]) -> Vec<usize> {
    let mut index = vec![0; shape.len()];
    for (i, &size) in index.iter_mut().zip(shape).rev() {
        (*i, position) = (position % size, position / size);
    }
    index
}
