//! The directions and samplers of the reference implementation, for their weights and their numbers only; veni itself
//! uses [`Stripes`](super::Stripes) and [`Equirect`].
//!
//! Two frames besides the native one occur there. The *camera* frame d belongs to the decoder: the image centre
//! looks to −y, image right to +x (a mirrored world). The *encoder* frame is e = diag(1, −1, −1) d.
//! Native directions are n = (−d_y, −d_x, d_z) = (e_y, −e_x, −e_z).

use std::f32::consts::PI;

use super::Equirect;
use super::gather::Pair;

/// A camera direction in the native frame. The map is a reflection and its own inverse, so it also takes native
/// directions to the camera frame, and the reference's latent vectors to native ones and back.
#[doc(hidden)]
#[inline]
pub fn camera_to_native([x, y, z]: [f32; 3]) -> [f32; 3] {
    [-y, -x, z]
}

/// An encoder direction in the native frame.
#[inline]
pub fn encoder_to_native([x, y, z]: [f32; 3]) -> [f32; 3] {
    [y, -x, -z]
}

/// The decoder's directions for an image, camera frame, row-major: with s = 2(i+½)/W − 1 and θ = π(j+½)/H,
/// d = (sin πs sin θ, −cos πs sin θ, cos θ), normalised once more. In single precision, step by step as the
/// reference implementation does: a latent fit with large steps amplifies the last bit of a direction ten-thousandfold.
/// (What remains is the last bit of the sine itself, in one row or column of ten.)
pub fn decoder_directions(grid: Equirect) -> Vec<[f32; 3]> {
    let (w, h) = (grid.width as f32, grid.height as f32);
    let columns: Vec<_> =
        (0..grid.width).map(|i| (PI * ((i as f32 + 0.5 - 0.5 * w) / (0.5 * w))).sin_cos()).collect();
    let mut out = Vec::with_capacity(grid.len());
    for j in 0..grid.height {
        let (sin_t, cos_t) = (PI * (0.5 + (j as f32 + 0.5 - 0.5 * h) / h)).sin_cos();
        out.extend(columns.iter().map(|(sin, cos)| {
            let [x, y, z] = [sin * sin_t, -(cos * sin_t), cos_t];
            let length = z.mul_add(z, y.mul_add(y, x * x)).sqrt();
            [x / length, y / length, z / length]
        }));
    }
    out
}

/// The encoder's line sampling, encoder frame, [T, P] row-major: meridians t = linspace(−1, 1, w), heights
/// z = −linspace(−1, 1, h), both ends included, h = √(T·P/2), w = 2h; e = (sin ϑ cos πt, sin ϑ sin πt, cos ϑ) with
/// ϑ = arccos z. Single precision throughout: what is read at the poles hangs on the signs of zeros.
///
/// # Panics
/// If T·P/2 is not a square (see [`Stripes::new`](super::Stripes::new)).
pub fn line_directions(stripes: usize, samples: usize) -> Vec<[f32; 3]> {
    let heights = (stripes * samples / 2).isqrt();
    assert_eq!(2 * heights * heights, stripes * samples, "{stripes} × {samples} line samples");
    let mut out = Vec::with_capacity(stripes * samples);
    for t in linspace(2 * heights) {
        let (sin_p, cos_p) = (PI * t).sin_cos();
        out.extend(linspace(heights).map(|l| {
            let (sin_t, cos_t) = (-l).acos().sin_cos();
            [sin_t * cos_p, sin_t * sin_p, cos_t]
        }));
    }
    out
}

/// n numbers from −1 to 1, both included, symmetric.
fn linspace(n: usize) -> impl Iterator<Item = f32> {
    let step = 2.0 / (n.max(2) - 1) as f32;
    (0..n).map(move |i| if i < n / 2 { -1.0 + step * i as f32 } else { 1.0 - step * (n - 1 - i) as f32 })
}

/// Image coordinates (u, v), each in [−1, 1], at which an encoder direction reads: u = atan2(x, y)/π,
/// v = asin(z/|e|)/(π/2).
pub fn image_uv([x, y, z]: [f32; 3]) -> [f32; 2] {
    let length = (x * x + y * y + z * z).sqrt();
    [x.atan2(y) / PI, (z / length).asin() / (0.5 * PI)]
}

/// Bilinear lookup at (u, v) as PyTorch's `grid_sample` does it with reflection padding and unaligned corners:
/// pixel coordinates ((u+1)W − 1)/2 and ((v+1)H − 1)/2 are reflected about the image's edges, then held inside.
/// The seam is not wrapped.
///
/// # Panics
/// If the image does not have W·H pixels.
#[doc(hidden)]
pub fn grid_sample(image: &[[f32; 3]], grid: Equirect, uv: [f32; 2]) -> [f32; 3] {
    assert_eq!(
        image.len(),
        grid.len(),
        "an image of {} pixels on {} × {}",
        image.len(),
        grid.width,
        grid.height
    );
    let (columns, rows) = pairs(uv, grid);
    let row = |j: usize| {
        let (a, b) =
            (image[rows.at[j] * grid.width + columns.at[0]], image[rows.at[j] * grid.width + columns.at[1]]);
        [0, 1, 2].map(|c| a[c] * columns.weight[0] + b[c] * columns.weight[1])
    };
    let (top, bottom) = (row(0), row(1));
    [0, 1, 2].map(|c| top[c] * rows.weight[0] + bottom[c] * rows.weight[1])
}

/// The columns and rows that [`grid_sample`] mixes.
pub(super) fn pairs([u, v]: [f32; 2], grid: Equirect) -> (Pair, Pair) {
    (reflected(u, grid.width), reflected(v, grid.height))
}

fn reflected(coordinate: f32, n: usize) -> Pair {
    let size = n as f32;
    let from_edge = (((coordinate + 1.0) * size - 1.0) / 2.0 + 0.5).abs();
    let (flips, rest) = ((from_edge / size).floor(), from_edge % size);
    let inside = if flips % 2.0 == 0.0 { rest - 0.5 } else { size - rest - 0.5 };
    let at = inside.clamp(0.0, size - 1.0);
    let low = at.floor();
    Pair::new(low as usize, (low as usize + 1).min(n - 1), f64::from(at - low))
}

/// The Fibonacci (golden-angle) lattice on the unit disk: point i at radius √((i+½)/n) and angle i·π(3 − √5).
pub fn fibonacci_disk(n: usize) -> Vec<[f32; 2]> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..n)
        .map(|i| {
            let (sin, cos) = (i as f64 * golden).sin_cos();
            let radius = ((i as f64 + 0.5) / n as f64).sqrt();
            [(radius * cos) as f32, (radius * sin) as f32]
        })
        .collect()
}

/// The golden spiral on the sphere: z = 1 − 2(i+½)/n, azimuth π(1 + √5)(i+½), the latter in single precision,
/// whose rounding shows from a hundred points on.
pub fn fibonacci_sphere(n: usize) -> Vec<[f32; 3]> {
    let turn = (std::f64::consts::PI * (1.0 + 5f64.sqrt())) as f32;
    (0..n)
        .map(|i| {
            let (sin, cos) = f64::from(turn * (i as f32 + 0.5)).sin_cos();
            let z = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
            let radius = (1.0 - z * z).sqrt();
            [(radius * cos) as f32, (radius * sin) as f32, z as f32]
        })
        .collect()
}

/// Patches of a [`fibonacci_disk`] on planes that touch the sphere, [patches, samples] row-major, not normalised.
/// The centre of a patch is c = (s_y, s_z, −s_x) of a [`fibonacci_sphere`] point s; its disk has the radius
/// tan(fov/2) and is spanned by e₁ = c × z normalised and e₂ = e₁ × c.
#[doc(hidden)]
pub fn double_fibonacci(patches: usize, samples: usize, fov_degrees: f64) -> Vec<[f32; 3]> {
    let radius = (0.5 * fov_degrees.to_radians()).tan();
    let disk = fibonacci_disk(samples);
    let mut out = Vec::with_capacity(patches * samples);
    for [sx, sy, sz] in fibonacci_sphere(patches) {
        let c = [sy, sz, -sx].map(f64::from);
        let length = c[0].hypot(c[1]).max(f64::MIN_POSITIVE);
        let e1 = [c[1] / length, -c[0] / length, 0.0];
        let e2 = [e1[1] * c[2], -e1[0] * c[2], e1[0] * c[1] - e1[1] * c[0]];
        out.extend(disk.iter().map(|&[a, b]| {
            let (a, b) = (radius * f64::from(a), radius * f64::from(b));
            [0, 1, 2].map(|k| (c[k] + a * e1[k] + b * e2[k]) as f32)
        }));
    }
    out
}

/// The reference implementation's rotation by pitch about x and yaw about z, rows first:
/// [[cos y, sin y, 0], [−sin y, cos y, 0], [0, 0, 1]] · [[1, 0, 0], [0, cos p, sin p], [0, −sin p, cos p]].
#[doc(hidden)]
pub fn pitch_yaw(pitch: f32, yaw: f32) -> [[f32; 3]; 3] {
    let ((sp, cp), (sy, cy)) = (pitch.sin_cos(), yaw.sin_cos());
    [[cy, sy * cp, sy * sp], [-sy, cy * cp, cy * sp], [0.0, -sp, cp]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_three_frames_name_one_direction() {
        let native = [0.3, -0.5, 0.8];
        let d = camera_to_native(native);
        let e = [d[0], -d[1], -d[2]];
        assert_eq!(camera_to_native(d), native);
        assert_eq!(encoder_to_native(e), native);
        // image centre: native +x, camera −y
        assert_eq!(camera_to_native([1.0, 0.0, 0.0]), [0.0, -1.0, 0.0]);
    }

    #[test]
    fn an_encoder_direction_reads_the_pixel_that_its_native_direction_names() {
        let grid = Equirect::new(64, 32);
        let image: Vec<[f32; 3]> = (0..grid.len()).map(|k| [(k % 64) as f32, (k / 64) as f32, 0.0]).collect();
        for (k, n) in grid.directions().into_iter().enumerate() {
            let e = [-n[1], n[0], -n[2]];
            let seen = grid_sample(&image, grid, image_uv(e));
            assert!((seen[0] - image[k][0]).abs() + (seen[1] - image[k][1]).abs() < 1e-3, "{n:?}: {seen:?}");
        }
    }
}
