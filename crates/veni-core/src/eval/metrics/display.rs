//! From radiance to display values, as the papers' LDR metrics define them.

/// The value below which a fraction `q` of all values lies, linearly interpolated between neighbours.
///
/// # Panics
/// If there are no values or `q` is outside [0, 1].
pub fn quantile(values: &[f64], q: f64) -> f64 {
    assert!(!values.is_empty() && (0.0..=1.0).contains(&q), "the {q} quantile of {} values", values.len());
    let rank = q * (values.len() - 1) as f64;
    let (below, part) = (rank.floor() as usize, rank.fract());
    let mut work = values.to_vec();
    let (_, &mut low, above) = work.select_nth_unstable_by(below, f64::total_cmp);
    let high = above.iter().copied().reduce(f64::min).unwrap_or(low);
    low + (high - low) * part
}

/// The sRGB curve, also beyond 1; not clamped.
pub fn srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Radiance divided by its own 98 % quantile, sRGB curve, clamped to [0, 1].
///
/// # Panics
/// If there are no values.
pub fn display(radiance: &[f64]) -> Vec<f64> {
    let white = quantile(radiance, 0.98);
    radiance.iter().map(|x| srgb(x / white).clamp(0.0, 1.0)).collect()
}
