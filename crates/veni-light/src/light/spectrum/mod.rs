//! The spherical-harmonic spectrum of an environment map, up to degrees in the hundreds.
//!
//! f(θ, φ) = Σ_l Σ_{0 ≤ m ≤ l} P̄_lm(cos θ) (a_lm cos mφ + b_lm sin mφ), where P̄_lm are the associated Legendre functions
//! without the phase (−1)^m, normalised so that the functions are orthonormal over the sphere. The map is taken as what it
//! is, constant within each pixel; the integrals over pixels are exact along φ and by Gauss quadrature along θ.
//!
//! A convolution with a kernel of the angle alone multiplies degree l by one number (Funk and Hecke), and a rotation about z
//! rotates (a_lm, b_lm) by mα.

mod analysis;
mod legendre;
mod rings;
mod synthesis;

pub(super) use rings::Rings;

use super::EnvironmentMap;

/// Coefficients of an RGB function for all degrees up to a largest.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    degree: usize,
    /// For m = 0 … L, in each l = m … L: a (R, G, B), then b.
    coefficients: Vec<Coefficient>,
}

/// a_lm and b_lm, R, G, B each.
type Coefficient = [f64; 6];

/// The largest degree that is computed. Far beyond it, sin^m θ leaves the range of f64.
pub const MAX_DEGREE: usize = 1023;

impl Spectrum {
    /// All degrees up to `degree` of a map. Work grows with rows × `degree`²; maps of many more pixels than `degree` resolves
    /// are averaged first.
    ///
    /// # Panics
    /// If `degree` exceeds [`MAX_DEGREE`].
    pub fn of(map: EnvironmentMap<'_>, degree: usize) -> Self {
        assert!(degree <= MAX_DEGREE, "degree {degree} is beyond {MAX_DEGREE}");
        Self { degree, coefficients: analysis::analyse(map, degree) }
    }

    /// The largest degree L.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// (a_lm, b_lm), each R, G, B; b_l0 is 0.
    ///
    /// # Panics
    /// Unless m ≤ l ≤ [`Spectrum::degree`].
    pub fn coefficient(&self, l: usize, m: usize) -> [[f64; 3]; 2] {
        assert!(m <= l && l <= self.degree, "coefficient ({l}, {m}) of degree {}", self.degree);
        let [a, b, c, d, e, f] = self.coefficients[first(self.degree, m) + l - m];
        [[a, b, c], [d, e, f]]
    }

    /// The mean over the sphere.
    pub fn mean(&self) -> [f64; 3] {
        self.coefficient(0, 0)[0].map(|c| c / (4.0 * std::f64::consts::PI).sqrt())
    }

    /// The spectrum of the function rotated by `angle` radians about z, counter-clockwise seen from above. Exact.
    #[must_use]
    pub fn rotated_about_z(&self, angle: f64) -> Self {
        let mut rotated = self.clone();
        for m in 1..=self.degree {
            let (s, c) = (m as f64 * angle).sin_cos();
            let at = first(self.degree, m);
            for [r, g, b, sr, sg, sb] in &mut rotated.coefficients[at..=at + self.degree - m] {
                for (x, y) in [(r, sr), (g, sg), (b, sb)] {
                    (*x, *y) = (*x * c - *y * s, *x * s + *y * c);
                }
            }
        }
        rotated
    }

    /// The function convolved with a kernel whose spectrum is `gains` (one per degree; those beyond are 0), sampled so densely
    /// that it can be interpolated.
    pub(super) fn convolved(&self, gains: &[f64]) -> Rings {
        synthesis::synthesise(self, gains)
    }

    /// Coefficients of one order.
    fn order(&self, m: usize) -> &[Coefficient] {
        &self.coefficients[first(self.degree, m)..][..=self.degree - m]
    }
}

/// Where the coefficients of order m begin.
fn first(degree: usize, m: usize) -> usize {
    m * (2 * degree + 3 - m) / 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::Equirect;

    /// A map whose pixels hold the mean of `f` over them, by 2 × 2 samples.
    fn map_of(grid: Equirect, f: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<[f32; 3]> {
        let n = 2;
        let fine = Equirect::new(grid.width * n, grid.height * n);
        (0..grid.len())
            .map(|k| {
                let (mut sum, mut weight) = ([0.0; 3], 0.0);
                for s in 0..n * n {
                    let (column, row) = (k % grid.width * n + s % n, k / grid.width * n + s / n);
                    let (w, d) = (fine.solid_angle(row), fine.direction(column, row).map(f64::from));
                    let v = f(d);
                    sum = [0, 1, 2].map(|c| sum[c] + w * v[c]);
                    weight += w;
                }
                sum.map(|s| (s / weight) as f32)
            })
            .collect()
    }

    /// LIGHT: a clamped cosine has L00 = π·0.282095, L1 = ⅔π·0.488603 along its axis, on every axis.
    #[test]
    fn a_clamped_cosine_has_its_known_numbers() {
        let grid = Equirect::new(1024, 512);
        for axis in [[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]] {
            let pixels = map_of(grid, |d| [d.iter().zip(axis).map(|(a, b)| a * b).sum::<f64>().max(0.0); 3]);
            let s = Spectrum::of(EnvironmentMap::new(grid, &pixels).unwrap(), 4);
            let [[l00, ..], _] = s.coefficient(0, 0);
            assert!((l00 - 0.886227).abs() < 1e-4, "{axis:?}: {l00}");
            let ([[z, ..], _], [[x, ..], [y, ..]]) = (s.coefficient(1, 0), s.coefficient(1, 1));
            for (found, direction) in [x, y, z].into_iter().zip(axis) {
                assert!((found - 1.023327 * direction).abs() < 1e-4, "{axis:?}: {found}");
            }
            if axis[2] != 0.0 {
                // band 2 of E/π is 5/128 · (3z² − 1): a_20 · A_2/π · 0.315392
                let [[c20, ..], _] = s.coefficient(2, 0);
                assert!((c20 * 0.25 * 0.315392 - 0.0390625).abs() < 1e-4, "{c20}");
            }
        }
    }

    #[test]
    fn a_constant_has_one_coefficient_whatever_the_grid() {
        for (w, h) in [(8, 4), (64, 32), (50, 25), (100, 37)] {
            let grid = Equirect::new(w, h);
            let pixels = vec![[1.0, 2.0, 0.5]; grid.len()];
            let s = Spectrum::of(EnvironmentMap::new(grid, &pixels).unwrap(), 40);
            for m in 0..=40 {
                for l in m..=40 {
                    let expected =
                        if l == 0 { [1.0, 2.0, 0.5].map(|v| v * 12.566370614f64.sqrt()) } else { [0.0; 3] };
                    let [a, b] = s.coefficient(l, m);
                    for c in 0..3 {
                        assert!(
                            (a[c] - expected[c]).abs() < 1e-5 && b[c].abs() < 1e-5,
                            "{w} × {h}, ({l}, {m}): {a:?}"
                        );
                    }
                }
            }
        }
    }

    /// A von Mises–Fisher lobe has band ratios coth κ − 1/κ and so on, in any direction.
    #[test]
    fn a_lobe_has_its_known_bands() {
        let (grid, kappa) = (Equirect::new(2048, 1024), 20.0f64);
        let axis = [0.48, -0.6, 0.64];
        let pixels = map_of(grid, |d| {
            let t: f64 = d.iter().zip(axis).map(|(a, b)| a * b).sum();
            [(kappa * (t - 1.0)).exp(); 3]
        });
        // so many degrees that the map is not averaged first
        let s = Spectrum::of(EnvironmentMap::new(grid, &pixels).unwrap(), 300);
        let power = |l: usize| -> f64 {
            let sum: f64 = (0..=l)
                .map(|m| s.coefficient(l, m).as_flattened()[0].powi(2) + s.coefficient(l, m)[1][0].powi(2))
                .sum();
            (sum / (2 * l + 1) as f64).sqrt()
        };
        let mut ratio = 1.0 / kappa.tanh() - 1.0 / kappa;
        let mut expected = power(0);
        for l in 1..=12 {
            expected *= ratio;
            assert!(
                (power(l) / power(0) - expected / power(0)).abs() < 1e-5,
                "{l}: {} for {expected}",
                power(l)
            );
            // I_{l+3/2} / I_{l+1/2} by the recurrence of modified Bessel functions
            ratio = 1.0 / ratio - (2 * l + 1) as f64 / kappa;
        }
    }

    #[test]
    fn a_rotation_is_a_rotation_of_the_pixels() {
        let grid = Equirect::new(96, 48);
        let pixels: Vec<[f32; 3]> =
            (0..grid.len()).map(|k| [0, 1, 2].map(|c| ((k * (7 + c) * 31) % 97) as f32)).collect();
        // what was at column i is seen at i − 5 after a counter-clockwise rotation by 5 columns
        let rotated: Vec<[f32; 3]> =
            (0..grid.len()).map(|k| pixels[k / 96 * 96 + (k % 96 + 5) % 96]).collect();
        let of = |pixels: &[[f32; 3]]| Spectrum::of(EnvironmentMap::new(grid, pixels).unwrap(), 60);
        let (a, b) = (of(&pixels).rotated_about_z(std::f64::consts::TAU * 5.0 / 96.0), of(&rotated));
        for (x, y) in a.coefficients.as_flattened().iter().zip(b.coefficients.as_flattened()) {
            assert!((x - y).abs() < 1e-4, "{x} and {y}");
        }
        assert_ne!(of(&pixels), b);
    }
}
