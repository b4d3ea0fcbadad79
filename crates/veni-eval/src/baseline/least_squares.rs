//! Linear least squares by normal equations: G x = b with the Gram matrix G = Σ ω f fᵀ of the basis functions
//! f on the pixels that there are. Nothing is assumed to be orthonormal. MODEL (48, 50).

use veni_light::cholesky;

/// Coefficients x `[columns][3]` that minimise Σ_p ω_p |Σ_k f_pk x_k − t_p|² + ridge·|x|², for a `basis`
/// `[pixels, columns]`. `None` if the pixels do not determine them.
///
/// # Panics
/// If the sizes disagree.
pub(super) fn solve(
    basis: &[f64],
    columns: usize,
    weights: &[f64],
    targets: &[[f64; 3]],
    ridge: f64,
) -> Option<Vec<[f64; 3]>> {
    assert!(basis.len() == columns * weights.len() && weights.len() == targets.len(), "one row per pixel");
    let mut gram = vec![0.0; columns * columns];
    let mut right = vec![[0.0; 3]; columns];
    for ((row, w), t) in basis.chunks_exact(columns).zip(weights).zip(targets) {
        for (i, f) in row.iter().enumerate() {
            let f = w * f;
            gram[i * columns..][..=i].iter_mut().zip(row).for_each(|(g, other)| *g += f * other);
            right[i].iter_mut().zip(t).for_each(|(r, t)| *r += f * t);
        }
    }
    (0..columns).for_each(|i| gram[i * columns + i] += ridge);
    cholesky::factor(&mut gram, columns)?;
    cholesky::substitute(&gram, columns, &mut right);
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_residual_is_orthogonal_to_every_column() {
        // a skewed basis 1, t, t², t³ with uneven weights
        let at = |p: usize| 0.1 * p as f64 - 0.7;
        let basis: Vec<f64> = (0..20).flat_map(|p| (0..4).map(move |k| at(p).powi(k))).collect();
        let weights: Vec<f64> = (0..20).map(|p| 0.2 + (p % 3) as f64).collect();
        let targets: Vec<_> = (0..20).map(|p| [at(p).sin(), at(p).exp(), 1.0 - at(p).powi(3)]).collect();
        let x = solve(&basis, 4, &weights, &targets, 0.0).unwrap();
        for k in 0..4 {
            for c in 0..3 {
                let residual =
                    |p: usize| (0..4).map(|k| basis[4 * p + k] * x[k][c]).sum::<f64>() - targets[p][c];
                let dot: f64 = (0..20).map(|p| weights[p] * basis[4 * p + k] * residual(p)).sum();
                assert!(dot.abs() < 1e-10, "column {k}, channel {c}: {dot}");
            }
        }
        // a polynomial is found exactly
        assert!((x[0][2] - 1.0).abs() < 1e-9 && (x[3][2] + 1.0).abs() < 1e-9, "{x:?}");
    }

    #[test]
    fn dependent_columns_are_refused() {
        let basis = [1.0, 2.0, 2.0, 4.0, 3.0, 6.0];
        assert!(solve(&basis, 2, &[1.0; 3], &[[1.0; 3]; 3], 0.0).is_none());
        assert!(solve(&basis[..2], 2, &[1.0], &[[1.0; 3]], 0.0).is_none());
    }
}
