//! Peak signal-to-noise ratio. MODEL (60).

/// 20 log₁₀(range) − 10 log₁₀(MSE) in dB, range = max(target, 0) − min(target, 0). Infinite where the two
/// are equal.
///
/// # Panics
/// If the lengths differ.
pub fn psnr(prediction: &[f64], target: &[f64]) -> f64 {
    assert_eq!(prediction.len(), target.len(), "two images of different size");
    let (mut low, mut high, mut square) = (0.0f64, 0.0f64, 0.0);
    for (p, i) in prediction.iter().zip(target) {
        (low, high) = (low.min(*i), high.max(*i));
        square += (p - i) * (p - i);
    }
    20.0 * (high - low).log10() - 10.0 * (square / target.len() as f64).log10()
}
