//! Associated Legendre functions P̄_lm(cos θ) of one order for eight latitudes at a time.
//!
//! P̄_mm = N_m sin^m θ and, with rising degree, P̄_lm = a_lm cos θ P̄_{l−1,m} − c_lm P̄_{l−2,m}. In f64; where sin^m θ leaves its
//! range, the function is far below rounding for every degree in use and is taken as 0.

use std::f64::consts::PI;

/// Latitudes that are computed together.
pub(super) const LANES: usize = 8;
/// A number for each of them.
pub(super) type Lanes = [f64; LANES];

/// What the recurrence of one order needs.
#[derive(Clone, Debug)]
pub(super) struct Order {
    m: usize,
    /// ln N_m.
    start: f64,
    /// (a, c) for l = m + 1 … L.
    pub(super) factors: Vec<[f64; 2]>,
}

/// Eight latitudes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Latitudes {
    pub(super) cos: Lanes,
    ln_sin: Lanes,
    max_sin: f64,
}

impl Latitudes {
    pub(super) fn new(polar: Lanes) -> Self {
        let sin = polar.map(f64::sin);
        Self {
            cos: polar.map(f64::cos),
            ln_sin: sin.map(f64::ln),
            max_sin: sin.into_iter().fold(0.0, f64::max),
        }
    }
}

/// All orders up to `degree`.
pub(super) fn orders(degree: usize) -> Vec<Order> {
    let mut start = -0.5 * (4.0 * PI).ln();
    (0..=degree)
        .map(|m| {
            if m > 0 {
                start += 0.5 * ((2 * m + 1) as f64 / (2 * m) as f64).ln();
            }
            if m == 1 {
                start += 0.5 * 2f64.ln();
            }
            let square = |k: usize| (k * k) as f64;
            let a = |l: usize| ((4.0 * square(l) - 1.0) / (square(l) - square(m))).sqrt();
            let factors = (m + 1..=degree)
                .map(|l| if l == m + 1 { [a(l), 0.0] } else { [a(l), a(l) / a(l - 1)] })
                .collect();
            Order { m, start, factors }
        })
        .collect()
}

impl Order {
    /// P̄_mm at these latitudes.
    #[inline(always)]
    pub(super) fn first(&self, at: &Latitudes) -> Lanes {
        // e^−700 is about the least normal f64
        at.ln_sin.map(|ln| {
            let exponent = if self.m == 0 { self.start } else { self.start + self.m as f64 * ln };
            if exponent > -700.0 { exponent.exp() } else { 0.0 }
        })
    }

    /// Whether all P̄_lm with l ≤ `degree` are below rounding there: for m > l sin θ they fall off like an Airy function.
    #[inline(always)]
    pub(super) fn negligible(&self, at: &Latitudes, degree: usize) -> bool {
        let turning = degree as f64 * at.max_sin;
        self.m as f64 > turning + 10.0 * turning.cbrt() + 10.0
    }

    /// The next degree from this one and the one before.
    #[inline(always)]
    pub(super) fn step([a, c]: [f64; 2], cos: &Lanes, current: &mut Lanes, before: &mut Lanes) {
        for k in 0..LANES {
            let next = a * cos[k] * current[k] - c * before[k];
            (before[k], current[k]) = (current[k], next);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_are_orthonormal() {
        let degree = 40;
        let rule = crate::light::quadrature::gauss_legendre(48);
        let orders = orders(degree);
        for m in [0, 1, 2, 17, 40] {
            let mut gram = vec![vec![0.0; degree + 1 - m]; degree + 1 - m];
            for nodes in rule.chunks(LANES) {
                let at = Latitudes::new(std::array::from_fn(|k| nodes[k].0.acos()));
                let order = &orders[m];
                let (mut p, mut before) = (order.first(&at), [0.0; LANES]);
                let mut values = vec![p];
                for factors in &order.factors {
                    Order::step(*factors, &at.cos, &mut p, &mut before);
                    values.push(p);
                }
                for (i, a) in values.iter().enumerate() {
                    for (j, b) in values.iter().enumerate() {
                        gram[i][j] += (0..LANES).map(|k| nodes[k].1 * a[k] * b[k]).sum::<f64>();
                    }
                }
            }
            // ∫ cos² mφ dφ is π, 2π for m = 0
            let around = if m == 0 { 2.0 * PI } else { PI };
            for (i, row) in gram.iter().enumerate() {
                for (j, v) in row.iter().enumerate() {
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((v * around - expected).abs() < 1e-11, "m = {m}: ({i}, {j}) {v}");
                }
            }
        }
    }

    /// What is skipped is below 1e-10 of the largest value.
    #[test]
    fn what_is_skipped_is_nothing() {
        let degree = 511;
        let orders = orders(degree);
        for polar in [0.001, 0.02, 0.1, 0.3, 0.8, 1.2] {
            let at = Latitudes::new([polar; LANES]);
            let Some(skipped) = orders.iter().find(|order| order.negligible(&at, degree)) else {
                assert!(polar > 1.0, "nothing is skipped at θ = {polar}");
                continue;
            };
            assert!(skipped.m > 10);
            let (mut p, mut before, mut largest) = (skipped.first(&at), [0.0; LANES], 0f64);
            for factors in &skipped.factors {
                largest = largest.max(p[0].abs());
                Order::step(*factors, &at.cos, &mut p, &mut before);
            }
            assert!(largest < 1e-10, "θ = {polar}, m = {}: {largest}", skipped.m);
            if polar < 0.1 {
                continue;
            }
            // a third of that order is not negligible
            let kept = &orders[skipped.m / 3];
            let (mut p, mut before, mut largest) = (kept.first(&at), [0.0; LANES], 0f64);
            for factors in &kept.factors {
                largest = largest.max(p[0].abs());
                Order::step(*factors, &at.cos, &mut p, &mut before);
            }
            assert!(largest > 1e-3, "θ = {polar}, m = {}: {largest}", kept.m);
        }
    }
}
