//! Products of weights, computed once.

use super::matrix::{Matrix, PackedRows, Product, Rows, padded};

/// A · B of row-major matrices `[rows, inner]` and `[inner, inner]`.
pub(super) fn product(a: &[f32], b: &[f32], rows: usize, inner: usize) -> Vec<f32> {
    let (weight, stride) = (Matrix::new(b, inner), padded(inner));
    let mut packed = PackedRows::default();
    packed.pack(Rows { data: a, stride: inner, count: rows }, inner);
    let mut out = vec![0.0; rows * stride];
    Product { x: &packed, weight: &weight, panels: 0..weight.panels(), y: &mut out, stride, add: false }
        .run();
    out.chunks_exact(stride).flat_map(|row| &row[..inner]).copied().collect()
}
