//! Augmentations that make one panorama of two.

use veni_light::sphere::Equirect;

/// Replaces the lower hemisphere of `image` by that of `ground`, blended over ± `half_width` radians about
/// the horizon with a smooth step (in log radiance).
pub fn recombine(grid: Equirect, image: &mut [f32], ground: &[f32], half_width: f64) {
    let stride = 3 * grid.width;
    let rows = image.chunks_exact_mut(stride).zip(ground.chunks_exact(stride));
    for (j, (sky, ground)) in rows.enumerate() {
        let below = grid.polar(j) - std::f64::consts::FRAC_PI_2;
        let t = smooth_step(below, half_width);
        sky.iter_mut().zip(ground).for_each(|(s, g)| *s += t * (g - *s));
    }
}

/// Replaces the side of `image` towards azimuth `bearing` by that of `second`. With e the horizontal axis at
/// that bearing, the share of `second` rises smoothly with ⟨d, e⟩ from 0 to 1 around `offset`, over `blend`
/// times the range −1 to 1 (in log radiance). A function of the direction alone, it has no seam at the poles.
pub fn join(grid: Equirect, image: &mut [f32], second: &[f32], bearing: f64, offset: f64, blend: f64) {
    let cosines: Vec<_> = (0..grid.width).map(|i| (grid.azimuth(i) - bearing).cos()).collect();
    let stride = 3 * grid.width;
    let rows = image.chunks_exact_mut(stride).zip(second.chunks_exact(stride));
    for (j, (row, second)) in rows.enumerate() {
        let sin = grid.polar(j).sin();
        let pixels = row.chunks_exact_mut(3).zip(second.chunks_exact(3));
        for ((pixel, second), cosine) in pixels.zip(&cosines) {
            let t = smooth_step(sin * cosine - offset, blend);
            pixel.iter_mut().zip(second).for_each(|(v, s)| *v += t * (s - *v));
        }
    }
}

/// (1 − share) of `image` plus `share` of `second`, in linear radiance: light adds up.
pub fn mix(image: &mut [f32], second: &[f32], share: f64) {
    if share <= 0.0 {
        return;
    }
    let (own, other) = ((-share).ln_1p() as f32, share.ln() as f32);
    for (a, b) in image.iter_mut().zip(second) {
        let (x, y) = (*a + own, *b + other);
        // log(eˣ + eʸ) without overflow; x = −∞ at share 1 is fine
        *a = x.max(y) + (-(x - y).abs()).exp().ln_1p();
    }
}

/// 0 below −half_width, 1 above it, 3t² − 2t³ between; a step if the width is 0.
fn smooth_step(x: f64, half_width: f64) -> f32 {
    if half_width <= 0.0 {
        return f32::from(x > 0.0);
    }
    let t = (0.5 + 0.5 * x / half_width).clamp(0.0, 1.0);
    (t * t * (3.0 - 2.0 * t)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::augment::tests::{GRID, image};

    #[test]
    fn joining_takes_sides_from_their_owners() {
        let (a, b) = (image(9), image(10));
        let mut out = a.clone();
        // towards +x, the middle of the image
        join(GRID, &mut out, &b, 0.0, 0.0, 0.0);
        for p in 0..GRID.len() {
            let front = (4..12).contains(&(p % GRID.width));
            let owner = if front { &b } else { &a };
            assert!((0..3).all(|c| (out[3 * p + c] - owner[3 * p + c]).abs() < 1e-6), "pixel {p}");
        }
        let mut all = a.clone();
        join(GRID, &mut all, &b, 0.3, -2.0, 0.5);
        assert!(all.iter().zip(&b).all(|(x, y)| (x - y).abs() < 1e-6));
    }

    #[test]
    fn recombination_takes_sky_and_ground_from_their_owners() {
        let (a, b) = (image(4), image(5));
        let mut out = a.clone();
        recombine(GRID, &mut out, &b, 0.0);
        let half = 3 * GRID.len() / 2;
        assert_eq!(out[..half], a[..half]);
        // a + 1·(b − a) rounds once
        assert!(out[half..].iter().zip(&b[half..]).all(|(x, y)| (x - y).abs() < 1e-6));
    }

    #[test]
    fn mixing_adds_linear_light() {
        let (a, b) = (image(6), image(7));
        let mut out = a.clone();
        mix(&mut out, &b, 0.3);
        for ((m, a), b) in out.iter().zip(&a).zip(&b) {
            let expected = 0.7 * a.exp() + 0.3 * b.exp();
            assert!((m.exp() - expected).abs() < 1e-5 * expected);
        }
        mix(&mut out, &b, 1.0);
        assert!(out.iter().zip(&b).all(|(x, y)| (x - y).abs() < 1e-6));
    }
}
