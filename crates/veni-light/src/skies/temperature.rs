//! Correlated colour temperature. MODEL (76).

use crate::vector::dot;

/// Linear Rec. 709 (D65) to CIE 1931 X, Y, Z (IEC 61966-2-1).
const XYZ: [[f64; 3]; 3] =
    [[0.4123908, 0.3575843, 0.1804808], [0.2126390, 0.7151687, 0.0721923], [0.0193308, 0.1191948, 0.9505322]];
/// A formula in the inverse slope n = (x − x₀)/(y − y₀) of the line from where the lines of equal temperature about meet.
struct Epicentre {
    x: f64,
    y: f64,
}

/// C. S. McCamy, Color Research and Application 17 (1992): a cubic, for up to 6000 K.
const WARM: Epicentre = Epicentre { x: 0.3320, y: 0.1858 };
const CUBIC: [f64; 4] = [-449.0, 3525.0, -6823.3, 5520.33];
/// Javier Hernández-Andrés, Raymond L. Lee and Javier Romero, Applied Optics 38 (1999): A + Σ A_k e^{−n/t_k}, from 3000 K on.
const COLD: Epicentre = Epicentre { x: 0.3366, y: 0.1735 };
const CONSTANT: f64 = -949.863_15;
const EXPONENTIALS: [[f64; 2]; 3] = [[6_253.803_38, 0.921_59], [28.705_99, 0.200_39], [4e-5, 0.071_25]];
/// From here on the second formula holds.
const CHANGE: f64 = 6000.0;
/// Below and above there is no telling black bodies apart, kelvin.
const RANGE: [f64; 2] = [1500.0, 50_000.0];
/// Largest inverse slope that the cubic is taken at: beyond it falls.
const STEEPEST: f64 = 1.2;

/// Chromaticity x, y (CIE 1931) of a colour in linear Rec. 709; None of what is dark.
pub fn chromaticity(rgb: [f64; 3]) -> Option<[f64; 2]> {
    let [x, y, z] = XYZ.map(|row| dot(row, rgb));
    let sum = x + y + z;
    (sum > 0.0 && sum.is_finite()).then(|| [x / sum, y / sum])
}

/// Correlated colour temperature of a colour in linear Rec. 709, kelvin; None for what is too red, too blue, too green or dark.
/// Within 1.5 % of black bodies from 2000 to 15 000 K.
pub fn temperature(rgb: [f64; 3]) -> Option<f64> {
    let [x, y] = chromaticity(rgb)?;
    let slope = |at: Epicentre| (y > at.y).then_some((x - at.x) / (y - at.y));
    let warm = slope(WARM).filter(|n| *n < STEEPEST).map(|n| CUBIC.iter().fold(0.0, |t, c| t * n + c));
    let kelvin = match warm {
        Some(kelvin) if kelvin < CHANGE => kelvin,
        None if x > y => return None,
        _ => {
            let n = slope(COLD)?;
            EXPONENTIALS.iter().fold(CONSTANT, |sum, [a, t]| sum + a * (-n / t).exp())
        }
    };
    (RANGE[0]..=RANGE[1]).contains(&kelvin).then_some(kelvin)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Colour of a black body by Planck's law and an analytic fit of the CIE 1931 colour matching functions (Wyman, Sloan and Shirley
    /// 2013).
    fn black_body(kelvin: f64) -> [f64; 3] {
        let lobe = |nm: f64, [height, mean, low, high]: [f64; 4]| {
            let t = (nm - mean) * if nm < mean { low } else { high };
            height * (-0.5 * t * t).exp()
        };
        let mut xyz = [0.0; 3];
        for nm in 360..=830 {
            let nm = f64::from(nm);
            let planck = nm.powi(-5) / ((1.438_777e7 / (nm * kelvin)).exp() - 1.0);
            let matching = [
                lobe(nm, [1.056, 599.8, 1.0 / 37.9, 1.0 / 31.0])
                    + lobe(nm, [0.362, 442.0, 1.0 / 16.0, 1.0 / 26.7])
                    + lobe(nm, [-0.065, 501.1, 1.0 / 20.4, 1.0 / 26.2]),
                lobe(nm, [0.821, 568.8, 1.0 / 46.9, 1.0 / 40.5])
                    + lobe(nm, [0.286, 530.9, 1.0 / 16.3, 1.0 / 31.1]),
                lobe(nm, [1.217, 437.0, 1.0 / 11.8, 1.0 / 36.0])
                    + lobe(nm, [0.681, 459.0, 1.0 / 26.0, 1.0 / 13.8]),
            ];
            xyz = [0, 1, 2].map(|c| xyz[c] + planck * matching[c]);
        }
        // the inverse of the matrix above (IEC 61966-2-1)
        let rgb = [
            [3.2409699, -1.5373832, -0.4986108],
            [-0.9692436, 1.8759675, 0.0415551],
            [0.0556301, -0.2039770, 1.0569715],
        ];
        rgb.map(|row| row.iter().zip(xyz).map(|(m, v)| m * v).sum())
    }

    #[test]
    fn black_bodies_have_their_temperature() {
        for kelvin in [2000.0, 2856.0, 4000.0, 5000.0, 6500.0, 9000.0, 12_000.0, 15_000.0] {
            let ours = temperature(black_body(kelvin)).unwrap();
            // the fit of the matching functions is no better than the formulas
            assert!((ours / kelvin - 1.0).abs() < 0.015, "{kelvin}: {ours}");
        }
        // the white point, D65
        let [x, y] = chromaticity([1.0; 3]).unwrap();
        assert!((x - 0.3127).abs() < 5e-5 && (y - 0.3290).abs() < 5e-5, "{x} {y}");
        assert_eq!(chromaticity([0.0; 3]), None);
        assert!((temperature([1.0; 3]).unwrap() - 6504.0).abs() < 20.0);
        assert_eq!(temperature([0.0; 3]), None);
        assert_eq!(temperature([1.0, 0.0, 0.0]), None);
        assert_eq!(temperature([f64::NAN; 3]), None);
        // without bound on the blue side
        assert_eq!(temperature([0.1, 0.2, 1.0]), None);
    }
}
