//! What an SO(2) layer multiplies by its weights.
//!
//! With x_i ∈ R² the equivariant and z_i ∈ R^c the invariant coordinates of channel i: the products t_k,i x_i with
//! t_i = (1, z_i), and the numbers s_i = (z_i, |x_i|); both k-major.

use super::linear::Feature;

/// Rows t_k,i x_i of one of the axes x, y: `[token, (c+1) · channels]`.
pub(super) fn equivariant_terms(x: Feature<'_>, axis: usize, out: &mut Vec<f32>) {
    let Feature { data, coordinates, channels, width } = x;
    out.clear();
    for token in data.chunks_exact(coordinates * width) {
        let vector = &token[axis * width..][..channels];
        out.extend_from_slice(vector);
        for z in token.chunks_exact(width).skip(2) {
            out.extend(z.iter().zip(vector).map(|(z, x)| z * x));
        }
    }
}

/// Rows s_k,i: `[token, (c+1) · channels]`.
pub(super) fn invariant_terms(x: Feature<'_>, out: &mut Vec<f32>) {
    let Feature { data, coordinates, channels, width } = x;
    out.clear();
    for token in data.chunks_exact(coordinates * width) {
        for z in token.chunks_exact(width).skip(2) {
            out.extend_from_slice(&z[..channels]);
        }
        let (x, y) = (&token[..channels], &token[width..][..channels]);
        out.extend(x.iter().zip(y).map(|(x, y)| (x * x + y * y).sqrt()));
    }
}
