//! What is allowed to be fitted to the target before images are compared. MODEL (58, 59).

/// What the prediction may be adjusted by before it is scored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Alignment {
    /// Nothing.
    None,
    /// One exposure factor on radiance: the honest choice for a model that is scale-free.
    #[default]
    Exposure,
    /// The reference implementation's `estimate_scale`: one factor on *log* radiance. It is an exponent on radiance, that is
    /// a contrast, and no exposure; for comparison with published numbers only.
    LogFactor,
}

impl Alignment {
    /// The prediction, aligned: log radiance in f64.
    pub fn apply(self, prediction: &[f32], target: &[f32], height: usize) -> Vec<f64> {
        let (factor, offset) = match self {
            Self::None => (1.0, 0.0),
            Self::Exposure => (1.0, exposure_offset(prediction, target, height)),
            Self::LogFactor => (log_factor(prediction, target), 0.0),
        };
        prediction.iter().map(|p| f64::from(*p) * factor + offset).collect()
    }
}

/// k = Σ I P/Σ P² over log values: the least-squares factor of the log prediction. 1 for an all-zero one.
///
/// # Panics
/// If the lengths differ.
pub fn log_factor(prediction: &[f32], target: &[f32]) -> f64 {
    assert_eq!(prediction.len(), target.len(), "two images of different size");
    let (mut cross, mut square) = (0.0, 0.0);
    for (p, i) in prediction.iter().zip(target) {
        let (p, i) = (f64::from(*p), f64::from(*i));
        cross += p * i;
        square += p * p;
    }
    if square > 0.0 { cross / square } else { 1.0 }
}

/// The log of the exposure factor that brings the prediction closest to the target in log radiance: the
/// average of I − P over the sphere (rows weighted by solid angle).
///
/// # Panics
/// If the lengths differ or are not a multiple of `height`.
pub fn exposure_offset(prediction: &[f32], target: &[f32], height: usize) -> f64 {
    assert_eq!(prediction.len(), target.len(), "two images of different size");
    assert!(
        height > 0 && prediction.len().is_multiple_of(height),
        "{} values in {height} rows",
        prediction.len()
    );
    let row = prediction.len() / height;
    if row == 0 {
        return 0.0;
    }
    let (mut sum, mut total) = (0.0, 0.0);
    for (j, (p, i)) in prediction.chunks(row).zip(target.chunks(row)).enumerate() {
        let weight = (std::f64::consts::PI * (j as f64 + 0.5) / height as f64).sin();
        sum += weight * p.iter().zip(i).map(|(p, i)| f64::from(*i) - f64::from(*p)).sum::<f64>();
        total += weight * row as f64;
    }
    sum / total
}
