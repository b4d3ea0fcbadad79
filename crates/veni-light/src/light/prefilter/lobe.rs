//! The GGX lobe of prefiltered maps, seen along its own normal (V = N).
//!
//! A level holds ∫ L(d) K(n·d) dω / ∫ K dω with K = D(h) N·L: for t = n·d, (n·h)² = (1 + t)/2 and
//! K(t) = t / ((1 + t)/2 · (α² − 1) + 1)² for t > 0. At α = 1 it is the cosine, and the level E/π.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::light::quadrature::gauss_legendre;

/// The lobe of roughness α = p² (p: the perceptual roughness of materials).
#[derive(Clone, Copy, Debug)]
pub(super) struct Lobe {
    alpha: f64,
    /// 1 / ∫ K dω.
    scale: f64,
}

impl Lobe {
    pub(super) fn new(alpha: f64) -> Self {
        let mut lobe = Self { alpha, scale: 1.0 };
        let whole: f64 = lobe.nodes(0).iter().map(|(t, w)| w * lobe.at(*t)).sum();
        lobe.scale = 1.0 / whole;
        lobe
    }

    /// The density K / ∫ K dω at the cosine t of the angle to the normal.
    #[inline]
    pub(super) fn at(&self, t: f64) -> f64 {
        if t <= 0.0 {
            return 0.0;
        }
        let d = 0.5 * (1.0 + t) * (self.alpha * self.alpha - 1.0) + 1.0;
        self.scale * t / (d * d)
    }

    /// Its zonal spectrum g_l = ∫ K P_l dω / ∫ K dω for l = 0 … `degree` at most: as many degrees as hold all but
    /// `tolerance`² of Σ (2l + 1) g_l², the power of what it makes of a point.
    pub(super) fn gains(&self, degree: usize, tolerance: f64) -> Vec<f64> {
        // most lobes need far fewer than allowed: 6/α is beyond 1e-4 of every one
        let degree = degree.min((10.0 / self.alpha).ceil() as usize + 96);
        let mut gains = vec![0.0; degree + 1];
        for (t, weight) in self.nodes(degree) {
            let value = weight * self.at(t);
            let (mut p, mut before) = (1.0, 0.0);
            for (l, gain) in gains.iter_mut().enumerate() {
                *gain += value * p;
                let l = l as f64;
                (p, before) = (((2.0 * l + 1.0) * t * p - l * before) / (l + 1.0), p);
            }
        }
        let power = |l: usize| (2 * l + 1) as f64 * gains[l] * gains[l];
        let all: f64 = (0..=degree).map(power).sum();
        let (mut lost, mut keep) = (0.0, degree);
        while keep > 0 && lost + power(keep) <= tolerance * tolerance * all {
            lost += power(keep);
            keep -= 1;
        }
        gains.truncate(keep + 1);
        gains
    }

    /// Quadrature over the hemisphere around the normal, (cosine, solid angle): panels as narrow as the lobe and as waves of
    /// `degree` ask for.
    fn nodes(&self, degree: usize) -> Vec<(f64, f64)> {
        let rule = gauss_legendre(16);
        let mut nodes = Vec::new();
        let mut from = 0.0;
        while from < FRAC_PI_2 {
            let wide = 0.5 * (from * from + 4.0 * self.alpha * self.alpha).sqrt();
            let to = (from + wide.min(8.0 / (degree + 1) as f64)).min(FRAC_PI_2);
            let half = 0.5 * (to - from);
            nodes.extend(rule.iter().map(|(x, w)| {
                let polar = from + half * (1.0 + x);
                (polar.cos(), 2.0 * PI * half * w * polar.sin())
            }));
            from = to;
        }
        nodes
    }

    /// The mean of the density over a disc of angular radius `radius` whose centre is `angle` from the normal.
    pub(super) fn over_disc(&self, angle: f64, radius: f64, rule: &DiscRule) -> f64 {
        let ((sin, cos), cap) = (angle.sin_cos(), 2.0 * (0.5 * radius).sin().powi(2));
        rule.nodes
            .iter()
            .map(|&(u, phi, w)| {
                // uniform in solid angle: 1 − cos of the distance to the centre
                let drop = cap * u;
                let tilt = (drop * (2.0 - drop)).sqrt();
                w * self.at(cos * (1.0 - drop) + sin * tilt * phi)
            })
            .sum()
    }
}

/// Quadrature over a disc: (share of the cap inside, cosine of the azimuth, weight).
#[derive(Clone, Debug)]
pub(super) struct DiscRule {
    nodes: Vec<(f64, f64, f64)>,
}

impl DiscRule {
    /// Enough nodes for a lobe of roughness `alpha`.
    pub(super) fn new(alpha: f64, radius: f64) -> Self {
        let ratio = radius / alpha;
        let n = match ratio {
            r if r < 1e-3 => 1,
            r if r < 0.5 => 3,
            r if r < 2.0 => 6,
            _ => 24,
        };
        let radial = gauss_legendre(n);
        let around = 2 * n;
        let nodes = radial
            .iter()
            .flat_map(|(x, w)| {
                (0..around).map(move |k| {
                    let phi = PI * (k as f64 + 0.5) / around as f64;
                    (0.5 * (1.0 + x), phi.cos(), 0.5 * w / around as f64)
                })
            })
            .collect();
        Self { nodes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_roughest_lobe_is_the_cosine() {
        let lobe = Lobe::new(1.0);
        assert!((lobe.at(0.3) - 0.3 / PI).abs() < 1e-12);
        // A_l / π: 1, 2/3, 1/4, 0, −.0417, 0, .015625
        let gains = lobe.gains(64, 1e-3);
        for (g, a) in gains.iter().zip([1.0, 2.0 / 3.0, 0.25, 0.0, -1.0 / 24.0, 0.0, 1.0 / 64.0]) {
            assert!((g - a).abs() < 1e-12, "{gains:?}");
        }
    }

    #[test]
    fn lobes_hold_one_whatever_their_width() {
        for alpha in [0.003, 0.01, 0.018, 0.086, 0.25, 1.0] {
            let lobe = Lobe::new(alpha);
            assert!((lobe.gains(700, 1e-4)[0] - 1.0).abs() < 1e-12);
            // brute force in the half vector's own measure: tan² θ_h = α² ξ / (1 − ξ)
            let n = 400_000;
            let (mut sum, mut first) = (0.0, 0.0);
            for k in 0..n {
                let xi = (f64::from(k) + 0.5) / f64::from(n) / (1.0 + alpha * alpha);
                let cos2 = (1.0 - xi) / (1.0 + (alpha * alpha - 1.0) * xi);
                let t = 2.0 * cos2 - 1.0;
                sum += t;
                first += t * t;
            }
            let g1 = lobe.gains(700, 1e-4)[1];
            assert!((first / sum - g1).abs() < 1e-6, "α = {alpha}: {} for {g1}", first / sum);
        }
    }

    /// LIGHT: degrees until |g_l| < 1e-3.
    #[test]
    fn narrow_lobes_need_many_degrees() {
        for (p, degrees) in [(0.75f64, 12), (0.5, 16), (0.375, 29), (0.293, 47), (0.225, 80), (0.134, 228)] {
            let gains = Lobe::new(p * p).gains(500, 1e-6);
            let last = gains.iter().rposition(|g| g.abs() > 1e-3).unwrap();
            assert!((last as f64 / degrees as f64 - 1.0).abs() < 0.15, "p = {p}: {last} for {degrees}");
        }
    }

    #[test]
    fn a_disc_averages_the_lobe() {
        let lobe = Lobe::new(0.05);
        for radius in [1e-5, 0.004651, 0.02, 0.09, 0.3] {
            let rule = DiscRule::new(0.05, radius);
            for angle in [0.0f64, 0.03, 0.1, 0.4] {
                let (mut sum, n) = (0.0, 600);
                for i in 0..n {
                    let drop = 2.0 * (0.5 * radius).sin().powi(2) * (f64::from(i) + 0.5) / f64::from(n);
                    for k in 0..n {
                        let phi = PI * (f64::from(k) + 0.5) / f64::from(n);
                        let tilt = (drop * (2.0 - drop)).sqrt() * phi.cos();
                        sum += lobe.at(angle.cos() * (1.0 - drop) + angle.sin() * tilt);
                    }
                }
                let exact = sum / f64::from(n * n);
                let found = lobe.over_disc(angle, radius, &rule);
                assert!(
                    (found - exact).abs() < 2e-3 * exact + 1e-6 * lobe.at(1.0),
                    "{radius}, {angle}: {found} for {exact}"
                );
            }
        }
    }
}
