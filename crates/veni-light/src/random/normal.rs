//! Normal deviates whose bits do not depend on the platform's mathematics library.

use super::Stream;

/// Standard normal deviates by Marsaglia's polar method, two at a time. Only IEEE-exact operations are used
/// (the logarithm is ours), so a seed means the same sky on every machine.
pub(super) fn pair(rng: &mut Stream) -> [f64; 2] {
    loop {
        let [u, v] = [rng.signed(), rng.signed()];
        let square = u * u + v * v;
        if square > 0.0 && square < 1.0 {
            let factor = (-2.0 * ln(square) / square).sqrt();
            return [u * factor, v * factor];
        }
    }
}

/// Natural logarithm of a normal positive number: x = m·2ᵉ with m in [√½, √2), ln m = 2 artanh((m−1)/(m+1)).
fn ln(x: f64) -> f64 {
    let bits = x.to_bits();
    let mut exponent = (bits >> 52) as i64 - 1023;
    let mut m = f64::from_bits(bits & ((1 << 52) - 1) | 1023 << 52);
    if m > std::f64::consts::SQRT_2 {
        m *= 0.5;
        exponent += 1;
    }
    let s = (m - 1.0) / (m + 1.0);
    let square = s * s;
    // s² ≤ 0.0295, so twelve terms leave less than 1e-18
    let series = (0..12).rev().fold(0.0, |sum, k| sum * square + 1.0 / f64::from(2 * k + 1));
    exponent as f64 * std::f64::consts::LN_2 + 2.0 * s * series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_is_accurate() {
        for i in 1..10_000 {
            for x in [f64::from(i) * 1e-4, (-f64::from(i) / 50.0).exp2()] {
                assert!((ln(x) - x.ln()).abs() <= 4e-16 * x.ln().abs().max(1.0), "{x}: {} {}", ln(x), x.ln());
            }
        }
    }

    #[test]
    fn moments_are_those_of_a_normal() {
        let rng = &mut Stream::from_seed(3);
        let values: Vec<f64> = (0..100_000).flat_map(|_| pair(rng)).collect();
        let moment = |k: i32| values.iter().map(|v| v.powi(k)).sum::<f64>() / values.len() as f64;
        // four standard errors: the variance of xᵏ is E x²ᵏ − (E xᵏ)²
        for (k, expected, variance) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)] {
            let error: f64 = moment(k) - expected;
            assert!(error.abs() < 4.0 * (f64::sqrt(variance) / 447.0), "moment {k}: {}", moment(k));
        }
        let cross = values.as_chunks::<2>().0.iter().map(|[a, b]| a * b).sum::<f64>() / 1e5;
        assert!(cross.abs() < 4.0 / 316.0, "{cross}");
    }
}
