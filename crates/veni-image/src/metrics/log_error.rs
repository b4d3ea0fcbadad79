//! Mean squared differences.

/// mean((a − b)²) over all values alike: the papers' measure between images of log radiance, and between latents.
///
/// # Panics
/// If the lengths differ.
pub fn log_error(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len(), "two images of different size");
    let square = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).powi(2);
    a.iter().zip(b).map(square).sum::<f64>() / a.len() as f64
}

/// The same with each row of `[height, width, 3]` weighted by the sine of its polar angle, that is by solid angle.
///
/// # Panics
/// If the lengths differ or are not a multiple of `height`.
pub fn weighted_log_error(a: &[f32], b: &[f32], height: usize) -> f64 {
    assert!(height > 0 && a.len().is_multiple_of(height), "{} values in {height} rows", a.len());
    let row = a.len() / height;
    let (mut sum, mut total) = (0.0, 0.0);
    for (j, (a, b)) in a.chunks(row).zip(b.chunks(row)).enumerate() {
        let weight = (std::f64::consts::PI * (j as f64 + 0.5) / height as f64).sin();
        sum += weight * log_error(a, b);
        total += weight;
    }
    sum / total
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_count_by_their_solid_angle() {
        let (a, b) = ([1.0, 0.0, 0.0, 0.0f32], [0.0; 4]);
        assert_eq!(log_error(&a, &b), 0.25);
        let sine = |k: f64| (k * std::f64::consts::PI / 8.0).sin();
        let expected = sine(1.0) / (sine(1.0) + sine(3.0) + sine(5.0) + sine(7.0));
        assert!((weighted_log_error(&a, &b, 4) - expected).abs() < 1e-12);
    }
}
