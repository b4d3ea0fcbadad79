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
        let zero = simd.splat_f32s(0.0);
        let (mut sa, mut sb, mut sc, mut sd) = ([zero; 3], [zero; 3], [zero; 3], [zero; 3]);
        let rows = a.iter().zip(b).zip(c).zip(d);
        for ((((a, b), c), d), ((x0, x1), x2)) in rows.zip(x[0].iter().zip(x[1]).zip(x[2])) {
            sa = multiply_add(simd, *a, [*x0, *x1, *x2], sa);
            sb = multiply_add(simd, *b, [*x0, *x1, *x2], sb);
            sc = multiply_add(simd, *c, [*x0, *x1, *x2], sc);
            sd = multiply_add(simd, *d, [*x0, *x1, *x2], sd);
        }
        let mut out = [[0.0; 3]; ROWS];
        for (out, sums) in out.iter_mut().zip([sa, sb, sc, sd]) {
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
        let [fa, fb, fc, fd] = *self.factor;
        let (fa, fb) = (splat(simd, fa), splat(simd, fb));
        let (fc, fd) = (splat(simd, fc), splat(simd, fd));
        let rows = a.iter().zip(b).zip(c).zip(d);
        for ((((a, b), c), d), ((y0, y1), y2)) in rows.zip(y0.iter_mut().zip(y1).zip(y2)) {
            let mut y = [*y0, *y1, *y2];
            y = multiply_add(simd, *a, fa, y);
            y = multiply_add(simd, *b, fb, y);
            y = multiply_add(simd, *c, fc, y);
            y = multiply_add(simd, *d, fd, y);
            [*y0, *y1, *y2] = y;
        }
    }
}

// Written out, and without closures: what is compiled outside the caller's SIMD features is not inlined into them.

/// w x + y for three channels.
#[inline(always)]
fn multiply_add<S: Simd>(simd: S, w: S::f32s, x: [S::f32s; 3], y: [S::f32s; 3]) -> [S::f32s; 3] {
    [simd.mul_add_f32s(w, x[0], y[0]), simd.mul_add_f32s(w, x[1], y[1]), simd.mul_add_f32s(w, x[2], y[2])]
}

#[inline(always)]
fn splat<S: Simd>(simd: S, x: [f32; 3]) -> [S::f32s; 3] {
    [simd.splat_f32s(x[0]), simd.splat_f32s(x[1]), simd.splat_f32s(x[2])]
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
