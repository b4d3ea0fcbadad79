//! The Jacobian of log radiance by the latent, ∂P/∂(Z, s), block by block and colour by colour: what the kernels beside this
//! file sum over directions. MODEL (41).

use pulp::Simd;

use super::lobes::LobeRows;
use super::pass::{BackwardVisitor, Pass};
use crate::field::Folded;
use crate::field::block::{Row, VECTORS, product};
use crate::field::mlp::{Matrix, PANEL};
use crate::field::weights::{Affine, Weights};

/// The fused value–output projection of one layer's attention, [3N, h]: a row for a₁, a₂ and z of every vector.
#[derive(Debug)]
pub(in crate::field) struct ValueOutput(Vec<f32>);

impl ValueOutput {
    pub(in crate::field) fn new(value: &Affine, out: &Affine) -> Self {
        let (inner, h) = (value.bias.len(), out.bias.len());
        let rows = value.weight.chunks_exact(inner).flat_map(|row| {
            let mut sum = vec![0.0; h];
            for (v, out) in row.iter().zip(out.weight.chunks_exact(h)) {
                sum.iter_mut().zip(out).for_each(|(sum, w)| *sum += v * w);
            }
            sum
        });
        Self(rows.collect())
    }
}

/// From the gradient with respect to what a layer's attention adds to that with respect to the vectors' radii and heights.
///
/// The invariants a₁, a₂ of a vector depend on r² = x² + y² alone: their gradients with respect to x and y are those by a
/// number ρ, times x and y.
pub(super) struct Chain<'a> {
    /// x, y of the vectors.
    vectors: &'a [[f32; 2]],
    /// One per layer: [h, 2N], ρ of all vectors, then z of all.
    layers: Vec<Matrix>,
}

impl<'a> Chain<'a> {
    pub(super) fn new(weights: &Weights, folded: &'a Folded) -> Self {
        let (h, vectors) = (weights.mlp.hidden, folded.vectors.as_slice());
        let derivatives: Vec<[f32; 2]> = vectors
            .iter()
            .map(|[x, y]| weights.invariant.derivative(f64::from(*x).hypot(f64::from(*y))).map(|s| s as f32))
            .collect();
        let n = vectors.len();
        let layer = |ValueOutput(value_output): &ValueOutput| {
            let mut matrix = vec![0.0; 2 * n * h];
            for (j, (rows, [p, q])) in value_output.chunks_exact(3 * h).zip(&derivatives).enumerate() {
                let (a, b, z) = (&rows[..h], &rows[h..2 * h], &rows[2 * h..]);
                for i in 0..h {
                    matrix[2 * n * i + j] = p * a[i] + q * b[i];
                    matrix[2 * n * i + n + j] = z[i];
                }
            }
            Matrix::new(&matrix, 2 * n)
        };
        Self { vectors, layers: weights.value_output().iter().map(layer).collect() }
    }

    /// 2N rounded up to whole panels.
    pub(super) fn padded(&self) -> usize {
        (2 * self.vectors.len()).next_multiple_of(PANEL)
    }
}

/// The rows of the Jacobian of one colour, for a block.
pub(super) struct Rows<'a, S: Simd> {
    chain: &'a Chain<'a>,
    lobes: &'a [LobeRows],
    zeros: Vec<f32>,
    /// A row for each coordinate.
    jacobian: &'a mut [Row<S>],
    /// By ρ and z of all vectors.
    polar: &'a mut [Row<S>],
}

impl<'a, S: Simd> Rows<'a, S> {
    /// In `jacobian`, a row for each coordinate, those of `lobes` after the exposure, and `polar`, [`Chain::padded`] rows.
    #[inline(always)]
    pub(super) fn new(
        simd: S,
        chain: &'a Chain<'a>,
        lobes: &'a [LobeRows],
        jacobian: &'a mut [Row<S>],
        polar: &'a mut [Row<S>],
    ) -> Self {
        // the log exposure adds to every log radiance alike
        jacobian[3 * chain.vectors.len()] = [simd.splat_f32s(1.0); VECTORS];
        Self { chain, lobes, zeros: vec![0.0; chain.padded()], jacobian, polar }
    }

    /// ∂P_c/∂(latent) in the directions that went forward last, P_c their log radiance of colour `c`: a row for each
    /// coordinate, then the exposure, then the lobes.
    #[inline(always)]
    pub(super) fn of_colour(&mut self, simd: S, pass: &mut Pass<'_, S>, c: usize) -> &[Row<S>] {
        let zero = simd.splat_f32s(0.0);
        pass.adjoint.as_flattened_mut().fill(zero);
        pass.adjoint[c] = [simd.splat_f32s(1.0); VECTORS];
        self.polar.as_flattened_mut().fill(zero);
        pass.backward(simd, self);
        self.finish(simd);
        let first = 3 * self.chain.vectors.len() + 1;
        LobeRows::fill(self.lobes, simd, pass.direction, c, &mut self.jacobian[first..]);
        self.jacobian
    }

    /// Adds what came through the attention.
    #[inline(always)]
    fn finish(&mut self, simd: S) {
        let (radii, heights) = self.polar.split_at(self.chain.vectors.len());
        let coordinates = self.jacobian.as_chunks_mut::<3>().0.iter_mut().zip(self.chain.vectors);
        for (([by_x, by_y, by_z], [x, y]), (radius, height)) in coordinates.zip(radii.iter().zip(heights)) {
            let (x, y) = (simd.splat_f32s(*x), simd.splat_f32s(*y));
            for v in 0..VECTORS {
                by_x[v] = simd.mul_add_e_f32s(radius[v], x, by_x[v]);
                by_y[v] = simd.mul_add_e_f32s(radius[v], y, by_y[v]);
            }
            *by_z = *height;
        }
    }
}

impl<S: Simd> BackwardVisitor<S> for Rows<'_, S> {
    #[inline(always)]
    fn added(&mut self, simd: S, at: usize, gradient: &[Row<S>]) {
        // nothing of the latent is added after the last layer
        if let Some(matrix) = self.chain.layers.get(at) {
            product::<S, true, false>(simd, matrix, &self.zeros, gradient, self.polar);
        }
    }

    #[inline(always)]
    fn product(&mut self, simd: S, j: usize, v: usize, gradient: S::f32s, direction: [S::f32s; 2]) {
        for (row, direction) in self.jacobian[3 * j..].iter_mut().zip(direction) {
            row[v] = simd.mul_f32s(gradient, direction);
        }
    }
}
