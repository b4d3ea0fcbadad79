//! The two passes over rows of the transfer matrix, vectorised. Four rows at once, so that light and gradient are
//! read once for four rows.

use pulp::{Arch, Simd, WithSimd};

/// Rows are padded with zeros to a multiple of this many lights, which every vector width divides.
pub(super) const LANES: usize = 16;

/// Rows of one call.
pub(super) const ROWS: usize = 4;

/// Rows of the matrix, all of one length, which is a multiple of [`LANES`].
pub(super) type Rows<'a> = [&'a [f32]; ROWS];

/// For each row r and channel c: Σ_l row_{r,l} x_{c,l}.
pub(super) fn dot(arch: Arch, rows: Rows<'_>, x: &[Vec<f32>; 3]) -> [[f32; 3]; ROWS] {
    arch.dispatch(Dot { rows, x })
}

/// y_{c,l} += Σ_r row_{r,l} factor_{r,c}.
pub(super) fn add(arch: Arch, rows: Rows<'_>, factor: &[[f32; 3]; ROWS], y: &mut [Vec<f32>; 3]) {
    arch.dispatch(Add { rows, factor, y });
}

struct Dot<'a> {
    rows: Rows<'a>,
    x: &'a [Vec<f32>; 3],
}

impl WithSimd for Dot<'_> {
    type Output = [[f32; 3]; ROWS];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let [a, b, c, d] = self.rows;
        let (a, b) = (S::as_simd_f32s(a).0, S::as_simd_f32s(b).0);
        let (c, d) = (S::as_simd_f32s(c).0, S::as_simd_f32s(d).0);
        let x = [S::as_simd_f32s(&self.x[0]).0, S::as_simd_f32s(&self.x[1]).0, S::as_simd_f32s(&self.x[2]).0];
        let mut sums = [[simd.splat_f32s(0.0); 3]; ROWS];
        let rows = a.iter().zip(b).zip(c).zip(d);
        for ((((a, b), c), d), ((x0, x1), x2)) in rows.zip(x[0].iter().zip(x[1]).zip(x[2])) {
            for (sums, row) in sums.iter_mut().zip([a, b, c, d]) {
                sums[0] = simd.mul_add_f32s(*row, *x0, sums[0]);
                sums[1] = simd.mul_add_f32s(*row, *x1, sums[1]);
                sums[2] = simd.mul_add_f32s(*row, *x2, sums[2]);
            }
        }
        let mut out = [[0.0; 3]; ROWS];
        for (out, sums) in out.iter_mut().zip(sums) {
            for (out, sum) in out.iter_mut().zip(sums) {
                *out = simd.reduce_sum_f32s(sum);
            }
        }
        out
    }
}

struct Add<'a> {
    rows: Rows<'a>,
    factor: &'a [[f32; 3]; ROWS],
    y: &'a mut [Vec<f32>; 3],
}

impl WithSimd for Add<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let [a, b, c, d] = self.rows;
        let (a, b) = (S::as_simd_f32s(a).0, S::as_simd_f32s(b).0);
        let (c, d) = (S::as_simd_f32s(c).0, S::as_simd_f32s(d).0);
        let [y0, y1, y2] = self.y;
        let (y0, y1) = (S::as_mut_simd_f32s(y0).0, S::as_mut_simd_f32s(y1).0);
        let y2 = S::as_mut_simd_f32s(y2).0;
        let mut factor = [[simd.splat_f32s(0.0); 3]; ROWS];
        for (lanes, values) in factor.iter_mut().zip(self.factor) {
            for (lanes, value) in lanes.iter_mut().zip(values) {
                *lanes = simd.splat_f32s(*value);
            }
        }
        let rows = a.iter().zip(b).zip(c).zip(d);
        for ((((a, b), c), d), ((y0, y1), y2)) in rows.zip(y0.iter_mut().zip(y1).zip(y2)) {
            for (row, factor) in [a, b, c, d].into_iter().zip(&factor) {
                *y0 = simd.mul_add_f32s(*row, factor[0], *y0);
                *y1 = simd.mul_add_f32s(*row, factor[1], *y1);
                *y2 = simd.mul_add_f32s(*row, factor[2], *y2);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_passes_are_what_their_loops_say() {
        let n = 5 * LANES;
        let values = |k: usize| (0..n).map(|i| ((i * 7 + k * 13) % 31) as f32 - 15.0).collect::<Vec<_>>();
        let rows = [0, 1, 2, 3].map(values);
        let x = [4, 5, 6].map(values);
        let views = [0, 1, 2, 3].map(|r| &rows[r][..]);
        // small integers: every order of summation is exact
        let sum = |r: usize, c: usize| rows[r].iter().zip(&x[c]).map(|(a, b)| a * b).sum::<f32>();
        assert_eq!(dot(Arch::new(), views, &x), [0, 1, 2, 3].map(|r| [0, 1, 2].map(|c| sum(r, c))));
        let factor = [[2.0, -3.0, 0.5], [1.0, 1.0, 0.0], [0.0, 4.0, -1.0], [5.0, 0.0, 2.0]];
        let mut y = x.clone();
        add(Arch::new(), views, &factor, &mut y);
        for c in 0..3 {
            for l in 0..n {
                let expected = x[c][l] + (0..4).map(|r| rows[r][l] * factor[r][c]).sum::<f32>();
                assert_eq!(y[c][l], expected);
            }
        }
    }
}
