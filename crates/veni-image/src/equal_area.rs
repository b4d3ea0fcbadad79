//! A panorama as an equal-area square: every pixel has the same solid angle, no row is crowded.
//!
//! With u, v in [−1, 1] from the left and the top, d = 1 − (|u| + |v|) and r = 1 − |d|: z = sign(d) (1 − r²) and φ = ((|v| − |u|)/r + 1) π/4
//! in the quadrant of (u, v). The centre is +z, the right edge +x, the bottom edge +y, the corners −z.

use std::f64::consts::{FRAC_PI_4, PI};

use veni_light::light::EnvironmentMap;
use veni_light::sphere::Equirect;

/// The direction at a place of the square, u and v in [−1, 1].
#[cfg(test)]
fn direction(u: f64, v: f64) -> [f64; 3] {
    let d = 1.0 - (u.abs() + v.abs());
    let r = 1.0 - d.abs();
    let phi = if r == 0.0 { 0.0 } else { ((v.abs() - u.abs()) / r + 1.0) * FRAC_PI_4 };
    let z = (1.0 - r * r).copysign(d);
    let radius = r * (2.0 - r * r).sqrt();
    [(radius * phi.cos()).copysign(u), (radius * phi.sin()).copysign(v), z]
}

/// The place of a direction in the square.
fn place([x, y, z]: [f64; 3]) -> [f64; 2] {
    let r = (1.0 - z.abs()).max(0.0).sqrt();
    let turn = y.abs().atan2(x.abs()) / FRAC_PI_4; // 0 to 2
    let (mut u, mut v) = (r * (1.0 - 0.5 * turn), r * 0.5 * turn);
    if z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    [u.copysign(x), v.copysign(y)]
}

/// The map on `side` × `side` pixels of equal solid angle. Every pixel of the map hands its energy on, in parts: light is conserved
/// exactly.
pub(crate) fn square(map: EnvironmentMap<'_>, side: usize) -> Vec<[f32; 3]> {
    let grid = map.grid();
    let mut energy = vec![[0f64; 3]; side * side];
    let mut area = vec![0f64; side * side];
    let n = (4.0 * side as f64 / grid.width as f64).ceil().max(2.0) as usize;
    let fine = Equirect::new(grid.width * n, grid.height * n);
    let phases: Vec<(f64, f64)> = (0..fine.width).map(|i| fine.azimuth(i).sin_cos()).collect();
    let cell = |t: f64| ((0.5 * (t + 1.0) * side as f64) as usize).min(side - 1);
    for row in 0..fine.height {
        let (sin, cos) = fine.polar(row).sin_cos();
        let w = fine.solid_angle(row);
        for (column, (s, c)) in phases.iter().enumerate() {
            let [u, v] = place([sin * c, sin * s, cos]);
            let at = cell(v) * side + cell(u);
            let pixel = map.pixels()[row / n * grid.width + column / n];
            energy[at] = [0, 1, 2].map(|k| energy[at][k] + w * f64::from(pixel[k]));
            area[at] += w;
        }
    }
    let whole = 4.0 * PI / (side * side) as f64;
    // the parts that a pixel got cover it almost, not exactly: dividing by them keeps a constant map constant, and what that
    // changes of the energy is made up for in one factor
    let mean = |k: usize| energy.iter().map(|e| e[k]).sum::<f64>();
    let divided = |k: usize| energy.iter().zip(&area).map(|(e, a)| e[k] / a.max(1e-30) * whole).sum::<f64>();
    let factor = [0, 1, 2].map(|k| if divided(k) > 0.0 { mean(k) / divided(k) } else { 1.0 });
    energy
        .iter()
        .zip(&area)
        .map(|(e, a)| [0, 1, 2].map(|k| (e[k] / a.max(1e-30) * factor[k]) as f32))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_places_invert_and_landmarks_are_where_they_should_be() {
        for (u, v, d) in
            [(0., 0., [0., 0., 1.]), (1., 0., [1., 0., 0.]), (0., 1., [0., 1., 0.]), (1., 1., [0., 0., -1.])]
        {
            let found = direction(u, v);
            assert!(found.iter().zip(d).all(|(a, b)| (a - b).abs() < 1e-12), "({u}, {v}): {found:?}");
        }
        for i in 0..40 {
            for j in 0..40 {
                let (u, v) = ((i as f64 + 0.5) / 20.0 - 1.0, (j as f64 + 0.5) / 20.0 - 1.0);
                let d = direction(u, v);
                assert!((d.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-12);
                let [a, b] = place(d);
                assert!((a - u).abs() < 1e-9 && (b - v).abs() < 1e-9, "({u}, {v}) became ({a}, {b})");
            }
        }
    }

    #[test]
    fn areas_are_equal() {
        // second moments of evenly spaced places are those of the sphere
        let (n, mut sum) = (400, [0.0; 3]);
        for i in 0..n * n {
            let at = |k: usize| (k as f64 + 0.5) / n as f64 * 2.0 - 1.0;
            let d = direction(at(i % n), at(i / n));
            sum = [0, 1, 2].map(|k| sum[k] + d[k] * d[k] / (n * n) as f64);
        }
        assert!(sum.iter().all(|s| (s - 1.0 / 3.0).abs() < 1e-5), "{sum:?}");
    }

    #[test]
    fn light_is_conserved() {
        let grid = Equirect::new(128, 64);
        let mut pixels: Vec<[f32; 3]> =
            grid.directions().into_iter().map(|[x, y, z]| [1.0 + x, 1.0 + y, 1.0 + z]).collect();
        pixels[20 * 128 + 7] = [5e4, 4e4, 3e4];
        let map = EnvironmentMap::new(grid, &pixels).unwrap();
        let square = square(map, 90);
        for k in 0..3 {
            let sum: f64 = square.iter().map(|p| f64::from(p[k]) * 4.0 * PI / 8100.0).sum();
            assert!((sum / map.integral()[k] - 1.0).abs() < 1e-6, "{sum}");
        }
        // +x is the middle of the right edge
        let [r, g, b] = square[45 * 90 + 89];
        assert!((r - 2.0).abs() < 0.05 && (g - 1.0).abs() < 0.05 && (b - 1.0).abs() < 0.05, "{r} {g} {b}");
    }
}
