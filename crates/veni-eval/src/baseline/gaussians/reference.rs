//! Spherical Gaussians as the reference's baseline computes them, for their numbers only. MODEL (53).
//!
//! The lobes sit on a grid of the *upper* hemisphere and may move by one and a half cells. Their option
//! `row_col_gaussian_dims` is unpacked as (columns, rows). Directions are of the camera frame
//! ([`sphere::reference`](veni_light::sphere::reference)), θ = arccos d_z, φ = atan2(d_x, d_y).

use std::f64::consts::PI;

/// Numbers per lobe: ln of the red, green and blue weight, polar and azimuthal shift, ln λ.
pub const NUMBERS: usize = 6;

/// The lobes of a grid of `rows` × `columns` on the upper hemisphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LobeGrid {
    /// Along the polar angle; the *second* of `row_col_gaussian_dims`.
    pub rows: usize,
    /// Along the azimuth; the *first* of `row_col_gaussian_dims`.
    pub columns: usize,
}

/// A lobe with its derivatives.
struct Lobe {
    polar: f64,
    azimuth: f64,
    sharpness: f64,
    polar_derivative: f64,
    azimuth_derivative: f64,
}

impl LobeGrid {
    /// From the reference's option `row_col_gaussian_dims`, in its order.
    #[doc(hidden)]
    pub fn from_row_col_gaussian_dims([columns, rows]: [usize; 2]) -> Self {
        Self { rows, columns }
    }

    /// Number of lobes.
    pub fn len(self) -> usize {
        self.rows * self.columns
    }

    /// Whether there is none.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// The reference implementation's start: all 0 but ln λ = ln(π/rows).
    pub fn start(self) -> Vec<f64> {
        [0.0, 0.0, 0.0, 0.0, 0.0, (PI / self.rows as f64).ln()].repeat(self.len())
    }

    /// Lobe `g` of the grid: θ = (j+½)π/2R + 1.5 (π/2R) tanh p₃, φ = ((i+½)/C − ½)2π + 1.5 (2π/C) tanh p₄, λ = e^{p₅}.
    fn lobe(self, g: usize, p: &[f64]) -> Lobe {
        let (i, j) = (g % self.columns, g / self.columns);
        let (height, width) = (0.5 * PI / self.rows as f64, 2.0 * PI / self.columns as f64);
        let (polar, azimuth) = (p[3].tanh(), p[4].tanh());
        Lobe {
            polar: (j as f64 + 0.5) * height + 1.5 * height * polar,
            azimuth: (i as f64 + 0.5) * width - PI + 1.5 * width * azimuth,
            sharpness: p[5].exp(),
            polar_derivative: 1.5 * height * (1.0 - polar * polar),
            azimuth_derivative: 1.5 * width * (1.0 - azimuth * azimuth),
        }
    }

    /// Log radiance ln Σ_g e^{w_g} e^{λ_g(cos γ_g − 1)} at directions of the camera frame.
    ///
    /// # Panics
    /// If there are not six parameters per lobe.
    pub fn log_radiance(self, directions: &[[f32; 3]], parameters: &[f64]) -> Vec<[f64; 3]> {
        let mut out = Vec::with_capacity(directions.len());
        self.visit(directions, parameters, |_, sum, _| out.push(sum.map(f64::ln)));
        out
    }

    /// The gradient of Σ_d Σ_c `probe`·[`log_radiance`](Self::log_radiance) in the parameters.
    ///
    /// # Panics
    /// If there are not six parameters per lobe and one probe per direction.
    pub fn gradient(self, directions: &[[f32; 3]], parameters: &[f64], probe: &[[f64; 3]]) -> Vec<f64> {
        assert_eq!(directions.len(), probe.len(), "one probe per direction");
        let mut out = vec![0.0; parameters.len()];
        self.visit(directions, parameters, |d, sum, terms| {
            for (out, term) in out.chunks_exact_mut(NUMBERS).zip(terms) {
                let mut pull = 0.0;
                for c in 0..3 {
                    let share = probe[d][c] * term.value[c] / sum[c];
                    out[c] += share;
                    pull += share;
                }
                out.iter_mut().skip(3).zip(term.derivatives).for_each(|(o, s)| *o += pull * s);
            }
        });
        out
    }

    /// Calls `each` with the index of a direction, Σ_g there, and every lobe's term.
    fn visit(
        self,
        directions: &[[f32; 3]],
        parameters: &[f64],
        mut each: impl FnMut(usize, [f64; 3], &[Term]),
    ) {
        assert_eq!(parameters.len(), NUMBERS * self.len(), "parameters of {} lobes", self.len());
        let numbers = || parameters.chunks_exact(NUMBERS).enumerate();
        for (index, d) in directions.iter().enumerate() {
            let [x, y, z] = d.map(f64::from);
            let (polar, azimuth) = (z.clamp(-1.0, 1.0).acos(), x.atan2(y));
            let term = |(g, p): (usize, &[f64])| Term::new(&self.lobe(g, p), p, polar, azimuth);
            let terms: Vec<_> = numbers().map(term).collect();
            let sum = terms.iter().fold([0.0; 3], |s, t| [0, 1, 2].map(|c| s[c] + t.value[c]));
            each(index, sum, &terms);
        }
    }
}

/// What a lobe adds at one direction, and ∂/∂(p₃, p₄, p₅) of its logarithm.
struct Term {
    value: [f64; 3],
    derivatives: [f64; 3],
}

impl Term {
    fn new(lobe: &Lobe, p: &[f64], polar: f64, azimuth: f64) -> Self {
        let ((st, ct), (sl, cl)) = (polar.sin_cos(), lobe.polar.sin_cos());
        let (sin, cos) = (azimuth - lobe.azimuth).sin_cos();
        let height = lobe.sharpness * (st * sl * cos + ct * cl - 1.0);
        Self {
            value: [0, 1, 2].map(|c| (p[c] + height).exp()),
            derivatives: [
                lobe.sharpness * (st * cl * cos - ct * sl) * lobe.polar_derivative,
                lobe.sharpness * st * sl * sin * lobe.azimuth_derivative,
                height,
            ],
        }
    }
}
