//! Band factors of lights: their harmonics are these times those of a point. LIGHT (10), LIGHT (21), MODEL (72).

use crate::compact::{CompactLight, Glow};

/// Beyond so many widths of a glow's spectrum nothing comes back: e^{−40}.
const BEYOND: f64 = 40.0;

/// b_l for l = 0 … `degree`, by which c_lm = E b_l Y_lm(u) of the light of a code (MODEL (72)) with irradiance E in the direction u:
/// of a disc (P_{l−1}(c) − P_{l+1}(c)) / ((2l + 1)(1 − c)), c = cos r; of a glow I_{l+½}(κ)/I_½(κ).
pub fn light_bands(light: &CompactLight, degree: usize) -> Vec<f64> {
    match Glow::new(light) {
        Some(glow) => of_glow(degree, glow.concentration()),
        None => of_disc(degree, f64::from(light.radius)),
    }
}

/// Band factors of a disc of this radius and energy 1.
pub(super) fn of_disc(order: usize, radius: f64) -> Vec<f64> {
    let s = (0.5 * radius).sin();
    let open = 2.0 * s * s;
    if open < 1e-12 {
        return vec![1.0; order + 1];
    }
    let c = radius.cos();
    // P_{l−1} − P_{l+1} by P_l − 1, so that small discs keep their digits: p_l = P_l − 1
    let mut p = vec![0.0, -open];
    for l in 1..=order {
        let k = l as f64;
        let next = ((2.0 * k + 1.0) * (c * p[l] - open) - k * p[l - 1]) / (k + 1.0);
        p.push(next);
    }
    let band = |l: usize| if l == 0 { 1.0 } else { (p[l - 1] - p[l + 1]) / ((2 * l + 1) as f64 * open) };
    (0..=order).map(band).collect()
}

/// The same of a von Mises–Fisher density: products of r_l = I_{l+½}/I_{l−½} = 1/((2l + 1)/κ + r_{l+1}), downwards from where r is
/// as good as 0.
fn of_glow(order: usize, kappa: f64) -> Vec<f64> {
    let start = ((order * order) as f64 + BEYOND * kappa).sqrt() as usize + BEYOND as usize;
    let (mut ratio, mut ratios) = (0.0, vec![0.0; order + 1]);
    for l in (1..=start).rev() {
        ratio = 1.0 / ((2 * l + 1) as f64 / kappa + ratio);
        if let Some(kept) = ratios.get_mut(l) {
            *kept = ratio;
        }
    }
    ratios[0] = 1.0;
    let product = |band: &mut f64, ratio: &f64| {
        *band *= ratio;
        Some(*band)
    };
    ratios.iter().scan(1.0, product).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::gauss_legendre;

    /// ∫ f P_l dω by quadrature in the chord, for densities that are functions of it.
    fn integrals(order: usize, reach: f64, density: impl Fn(f64) -> f64) -> Vec<f64> {
        let (mut out, mut whole) = (vec![0.0; order + 1], 0.0);
        for (x, w) in gauss_legendre(400) {
            // 1 − cos, from 0 to reach
            let drop = 0.5 * reach * (1.0 + x);
            let value = w * density(drop);
            whole += value;
            let (mut p, mut before) = (1.0, 0.0);
            for (l, out) in out.iter_mut().enumerate() {
                *out += value * p;
                let k = l as f64;
                (p, before) = (((2.0 * k + 1.0) * (1.0 - drop) * p - k * before) / (k + 1.0), p);
            }
        }
        out.iter().map(|v| v / whole).collect()
    }

    #[test]
    fn bands_are_the_integrals_of_legendre_polynomials() {
        for radius in [0.004_65f32, 0.02, 0.03, 0.1, 0.6, 2.0] {
            let light = CompactLight::new([0.0, 0.0, 1.0], [1.0; 3], radius);
            let expected = match Glow::new(&light) {
                Some(glow) => {
                    let kappa = glow.concentration();
                    integrals(200, (60.0 / kappa).min(2.0), |drop| (-kappa * drop).exp())
                }
                None => integrals(200, 2.0 * (0.5 * f64::from(radius)).sin().powi(2), |_| 1.0),
            };
            for (l, (a, b)) in light_bands(&light, 200).into_iter().zip(expected).enumerate() {
                assert!((a - b).abs() < 1e-9, "{radius}, {l}: {a} for {b}");
            }
        }
    }

    /// A glow has the first band of its disc: so were its widths chosen.
    #[test]
    fn the_first_band_is_the_discs() {
        for radius in [0.03f32, 0.1, 0.6] {
            let light = CompactLight::new([0.0, 0.0, 1.0], [1.0; 3], radius);
            let (glow, disc) = (light_bands(&light, 1)[1], of_disc(1, f64::from(radius))[1]);
            assert!((glow - disc).abs() < 1e-12, "{radius}: {glow} {disc}");
        }
    }
}
