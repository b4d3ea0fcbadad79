//! How much air lies on straight paths, as a table that all scenes share.

use std::sync::OnceLock;

use super::{GROUND, MIE_HEIGHT, RAYLEIGH_HEIGHT, TOP};

/// Distances through molecules, aerosol and ozone in kilometres of their density at sea level (ozone: at its peak).
pub(super) type Columns = [f32; 3];

/// Densities relative to those that the coefficients are for.
pub(super) fn densities(height: f32) -> Columns {
    let ozone = (1.0 - (height - 25.0).abs() / 15.0).max(0.0);
    [(-height / RAYLEIGH_HEIGHT).exp(), (-height / MIE_HEIGHT).exp(), ozone]
}

const HEIGHTS: usize = 40;
const ANGLES: usize = 128;

/// Columns from `height` to the top of the atmosphere at zenith cosine `mu` (not below the horizon). They do not
/// depend on the scene, so one table serves all; its axes are those of Bruneton & Neyret.
pub(super) fn columns(height: f64, mu: f64) -> Columns {
    static TABLE: OnceLock<Vec<Columns>> = OnceLock::new();
    let table = TABLE.get_or_init(tabulate);
    let r = GROUND + height.clamp(0.0, TOP - GROUND);
    let widest = (TOP * TOP - GROUND * GROUND).sqrt();
    let rho = (r * r - GROUND * GROUND).max(0.0).sqrt();
    let distance = -r * mu + (r * r * (mu * mu - 1.0) + TOP * TOP).max(0.0).sqrt();
    let (near, far) = (TOP - r, rho + widest);
    let u = ((distance - near) / (far - near)).clamp(0.0, 1.0) * (ANGLES - 1) as f64;
    let v = rho / widest * (HEIGHTS - 1) as f64;
    let (i, j) = ((u as usize).min(ANGLES - 2), (v as usize).min(HEIGHTS - 2));
    let (s, t) = ((u - i as f64) as f32, (v - j as f64) as f32);
    let (a, b) = (&table[j * ANGLES + i..], &table[(j + 1) * ANGLES + i..]);
    std::array::from_fn(|k| {
        (1.0 - t) * (a[0][k] + s * (a[1][k] - a[0][k])) + t * (b[0][k] + s * (b[1][k] - b[0][k]))
    })
}

fn tabulate() -> Vec<Columns> {
    const STEPS: usize = 400;
    let widest = (TOP * TOP - GROUND * GROUND).sqrt();
    let mut table = Vec::with_capacity(HEIGHTS * ANGLES);
    for j in 0..HEIGHTS {
        let rho = widest * j as f64 / (HEIGHTS - 1) as f64;
        let r = (rho * rho + GROUND * GROUND).sqrt();
        let (near, far) = (TOP - r, rho + widest);
        for i in 0..ANGLES {
            let distance = near + (far - near) * i as f64 / (ANGLES - 1) as f64;
            let mu = if distance < 1e-9 {
                1.0
            } else {
                ((widest * widest - rho * rho - distance * distance) / (2.0 * r * distance)).clamp(-1.0, 1.0)
            };
            let mut sum = [0f64; 3];
            for k in 0..STEPS {
                let edge = |k: usize| distance * (k as f64 / STEPS as f64).powi(2);
                let t = 0.5 * (edge(k) + edge(k + 1));
                let h = ((r * r + 2.0 * r * mu * t + t * t).sqrt() - GROUND).max(0.0);
                let length = edge(k + 1) - edge(k);
                sum.iter_mut().zip(densities(h as f32)).for_each(|(s, d)| *s += length * f64::from(d));
            }
            table.push(sum.map(|s| s as f32));
        }
    }
    table
}
