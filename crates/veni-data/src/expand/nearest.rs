//! The nearest pixel outside a mask, by angle on the sphere.
//!
//! Candidates are handed on from neighbour to neighbour in sweeps over the image (P.-E. Danielsson, "Euclidean
//! distance mapping", 1980), but compared by the true angle, across the seam and across the poles.

use veni_light::sphere::Equirect;

/// No pixel outside the mask is known.
pub(super) const NOWHERE: u32 = u32::MAX;

/// More than are needed by any mask that was seen; each sweep goes down and up once.
const SWEEPS: usize = 6;

/// Angles between pixels of one grid.
pub(super) struct Angles {
    grid: Equirect,
    rows: Vec<(f64, f64)>,
    /// cos of the azimuth between columns that lie this far apart.
    cosines: Vec<f64>,
}

impl Angles {
    pub(super) fn new(grid: Equirect) -> Self {
        let step = 2.0 * std::f64::consts::PI / grid.width as f64;
        Self {
            grid,
            rows: (0..grid.height).map(|j| grid.polar(j).sin_cos()).collect(),
            cosines: (0..grid.width).map(|i| (step * i as f64).cos()).collect(),
        }
    }

    /// 1 − cos of the angle between two pixels, without cancellation for neighbours.
    fn gap(&self, a: u32, b: u32) -> f64 {
        let width = self.grid.width;
        let (a, b) = (a as usize, b as usize);
        let ((sin_a, cos_a), (sin_b, cos_b)) = (self.rows[a / width], self.rows[b / width]);
        let turn = self.cosines[(a % width).abs_diff(b % width)];
        // |a − b|² / 2 of the unit vectors
        let (dr, dz) = (sin_a - sin_b, cos_a - cos_b);
        0.5 * (dr * dr + dz * dz) + sin_a * sin_b * (1.0 - turn)
    }

    /// The angle between two pixel centres, radians.
    pub(super) fn between(&self, a: u32, b: u32) -> f64 {
        2.0 * (0.5 * self.gap(a, b)).sqrt().min(1.0).asin()
    }
}

/// For every pixel inside the mask the nearest one outside (itself for those outside), [`NOWHERE`] if all are inside.
pub(super) fn nearest_outside(angles: &Angles, inside: &[bool]) -> Vec<u32> {
    let Equirect { width, height } = angles.grid;
    let mut nearest: Vec<u32> =
        inside.iter().enumerate().map(|(k, inside)| if *inside { NOWHERE } else { k as u32 }).collect();
    let mut best: Vec<f64> = inside.iter().map(|inside| if *inside { f64::INFINITY } else { 0.0 }).collect();
    let mut changed = true;
    let mut offer = |nearest: &mut [u32], to: usize, from: usize| -> bool {
        let candidate = nearest[from];
        if candidate == NOWHERE || candidate == nearest[to] || best[to] == 0.0 {
            return false;
        }
        let gap = angles.gap(to as u32, candidate);
        let better = gap < best[to];
        if better {
            (best[to], nearest[to]) = (gap, candidate);
        }
        better
    };
    for _ in 0..SWEEPS {
        if !changed {
            break;
        }
        changed = false;
        for down in [true, false] {
            for step in 0..height {
                let row = if down { step } else { height - 1 - step };
                // the row before it in this direction; at a pole the same row, half a turn away
                let (before, turn) = match (down, step) {
                    (_, 0) => (row, width / 2),
                    (true, _) => (row - 1, 0),
                    (false, _) => (row + 1, 0),
                };
                for column in 0..width {
                    for side in [width - 1, 0, 1] {
                        let from = before * width + (column + turn + side) % width;
                        changed |= offer(&mut nearest, row * width + column, from);
                    }
                }
                // twice around in both directions, so that what crosses the seam goes all the way
                for k in 1..2 * width {
                    let (to, from) = (k % width, (k - 1) % width);
                    changed |= offer(&mut nearest, row * width + to, row * width + from);
                }
                for k in (0..2 * width - 1).rev() {
                    let (to, from) = (k % width, (k + 1) % width);
                    changed |= offer(&mut nearest, row * width + to, row * width + from);
                }
            }
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the search over all pixels, for a mask over the seam, one over a pole and scattered holes.
    #[test]
    fn as_near_as_a_full_search_finds() {
        let grid = Equirect::new(48, 24);
        let angles = Angles::new(grid);
        let cap = |centre: [f32; 3], cosine: f32| {
            let inside = move |d: [f32; 3]| d.iter().zip(centre).map(|(a, b)| a * b).sum::<f32>() > cosine;
            grid.directions().into_iter().map(inside).collect::<Vec<_>>()
        };
        let holes: Vec<bool> = (0..grid.len()).map(|k| k * k % 101 > 6).collect();
        for mask in [cap([-1.0, 0.0, 0.0], 0.5), cap([0.0, 0.0, 1.0], 0.3), cap([0.6, 0.0, -0.8], 0.0), holes]
        {
            let found = nearest_outside(&angles, &mask);
            let mut worst = 0f64;
            for k in 0..grid.len() as u32 {
                let all = (0..grid.len() as u32).filter(|o| !mask[*o as usize]);
                let truth = all.map(|o| angles.between(k, o)).fold(f64::INFINITY, f64::min);
                assert!(!mask[found[k as usize] as usize]);
                worst = worst.max(angles.between(k, found[k as usize]) - truth);
            }
            // handing on is not exact in rare corners; a tenth of a pixel is
            assert!(worst < 0.1 * std::f64::consts::PI / 24.0, "{worst} radians too far");
        }
        assert!(nearest_outside(&angles, &vec![true; grid.len()]).iter().all(|n| *n == NOWHERE));
    }

    #[test]
    fn angles_are_exact_for_neighbours_too() {
        let grid = Equirect::new(16384, 8192);
        let angles = Angles::new(grid);
        let pixel = (4096 * 16384 + 100) as u32;
        let down = angles.between(pixel, pixel + 16384);
        assert!((down / (std::f64::consts::PI / 8192.0) - 1.0).abs() < 1e-9, "{down}");
    }
}
