//! `spectrum.wgsl` and `veni_harmonics` of `level.wgsl`

use crate::shader::SpectrumTables;

/// Coefficients c_lm at l² + l + m of radiance on the tables' rings, ring after ring.
///
/// # Panics
/// If there are fewer values than directions.
pub fn veni_degrees(tables: &SpectrumTables, radiance: &[[f32; 3]]) -> Vec<[f64; 3]> {
    let SpectrumTables { degree, rings, columns, .. } = *tables;
    let mut out = vec![[0.0; 3]; tables.coefficients()];
    for ring in 0..rings {
        for m in 0..=degree {
            let mut waves = [[0.0; 3]; 2];
            for (i, value) in radiance[ring * columns..][..columns].iter().enumerate() {
                for (wave, phase) in waves.iter_mut().zip(tables.phases[m * i % columns]) {
                    *wave = [0, 1, 2].map(|c| wave[c] + f64::from(phase) * f64::from(value[c]));
                }
            }
            for l in m..=degree {
                let weight = f64::from(tables.legendre[(l * (l + 1) / 2 + m) * rings + ring]);
                for c in 0..3 {
                    out[l * l + l + m][c] += weight * waves[0][c];
                    if m > 0 {
                        out[l * l + l - m][c] += weight * waves[1][c];
                    }
                }
            }
        }
    }
    out
}

/// Σ g_l c_lm Y_lm in a native unit direction; degrees without a gain are left out.
pub fn veni_harmonics(
    tables: &SpectrumTables,
    gains: &[f64],
    coefficients: &[[f64; 3]],
    d: [f64; 3],
) -> [f64; 3] {
    let [x, y, z] = d;
    let (mut power, mut diagonal, mut sum) = ([1.0, 0.0], (0.25 / std::f64::consts::PI).sqrt(), [0.0; 3]);
    for m in 0..gains.len().min(tables.degree + 1) {
        let (mut q, mut before) = (diagonal, 0.0);
        for (l, gain) in gains.iter().enumerate().take(tables.degree + 1).skip(m) {
            if l > m {
                let [a, b] = tables.steps[l * (l + 1) / 2 + m].map(f64::from);
                (before, q) = (q, a * (z * q - b * before));
            }
            let [even, odd] = [coefficients[l * l + l + m], coefficients[l * l + l - m]];
            for c in 0..3 {
                sum[c] += gain
                    * q
                    * if m == 0 { even[c] } else { 2f64.sqrt() * (power[0] * even[c] + power[1] * odd[c]) };
            }
        }
        power = [power[0] * x - power[1] * y, power[0] * y + power[1] * x];
        diagonal *= -((2 * m + 3) as f64 / (2 * m + 2) as f64).sqrt();
    }
    sum
}
