//! `encode.wgsl`

use super::Twin;

/// (sin 2πt, cos 2πt).
pub fn veni_sin_cos(t: f64) -> [f64; 2] {
    let (sin, cos) = (std::f64::consts::TAU * (t - t.round())).sin_cos();
    [sin, cos]
}

/// Features sin 1, sin 4, cos 1, cos 4 and value of directional input `index`, for the native unit direction d.
pub fn veni_encode(twin: &Twin, latent: usize, index: usize, d: [f32; 3]) -> [f64; 5] {
    let n = twin.sizes.latents;
    let [x, y, z] = d.map(f64::from);
    let value = match index.checked_sub(n) {
        None => {
            let at = twin.row() * (twin.sizes.layers + 1) + 4 * index;
            let v = &twin.latent(latent)[at..][..4];
            let part = |i: usize| f64::from(v[i]) + f64::from(v[i + 2]);
            part(0) * x + part(1) * y
        }
        Some(0) => z,
        Some(_) => x.hypot(y),
    };
    let ([sin1, cos1], [sin4, cos4]) = (veni_sin_cos(value), veni_sin_cos(4.0 * value));
    [sin1, sin4, cos1, cos4, value]
}
