//! Gauss–Legendre quadrature.

use std::f64::consts::PI;

/// Nodes in (−1, 1), the largest first, and weights (which sum to 2) that integrate polynomials of degree 2n − 1 exactly.
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            // Newton's method from the usual estimate; P_n and its derivative by the recurrence
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (mut p, mut before) = (1.0, 0.0);
                for k in 1..=n {
                    let k = k as f64;
                    (p, before) = (((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k, p);
                }
                slope = n as f64 * (x * p - before) / (x * x - 1.0);
                let step = p / slope;
                x -= step;
                if step.abs() < 1e-15 {
                    break;
                }
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_of_degree_2n_minus_1_are_exact() {
        for n in 1..20 {
            let rule = gauss_legendre(n);
            for degree in 0..2 * n {
                let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(degree as i32)).sum();
                let exact = if degree % 2 == 0 { 2.0 / (degree as f64 + 1.0) } else { 0.0 };
                assert!((sum - exact).abs() < 1e-13, "{n} nodes, x^{degree}: {sum}");
            }
            // one degree more is not
            let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(2 * n as i32)).sum();
            assert!((sum - 2.0 / (2.0 * n as f64 + 1.0)).abs() > 1e-14, "{n} nodes");
        }
    }
}
