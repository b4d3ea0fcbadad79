//! Small symmetric systems of equations, dense and in f64.

/// A pivot below this share of its diagonal element says that the columns are dependent.
const RANK: f64 = 1e-10;

/// G = R Rᵀ in place, R lower triangular, for G `[n, n]` row-major; only the lower triangle is read and written.
/// `None` if G is not positive definite.
pub fn factor(gram: &mut [f64], n: usize) -> Option<()> {
    for i in 0..n {
        let (above, row) = gram.split_at_mut(i * n);
        for j in 0..i {
            let other = &above[j * n..][..=j];
            row[j] = (row[j] - dot(&row[..j], &other[..j])) / other[j];
        }
        let pivot = row[i] - dot(&row[..i], &row[..i]);
        if pivot.is_nan() || pivot <= RANK * row[i] {
            return None;
        }
        row[i] = pivot.sqrt();
    }
    Some(())
}

/// R Rᵀ x = b in place, for K right sides at once.
pub fn substitute<const K: usize>(factor: &[f64], n: usize, x: &mut [[f64; K]]) {
    let less = |a: [f64; K], k: f64, b: [f64; K]| std::array::from_fn(|c| a[c] - k * b[c]);
    for i in 0..n {
        let rest: [f64; K] = (0..i).fold(x[i], |rest, j| less(rest, factor[i * n + j], x[j]));
        x[i] = rest.map(|v| v / factor[i * n + i]);
    }
    for i in (0..n).rev() {
        let rest: [f64; K] = (i + 1..n).fold(x[i], |rest, j| less(rest, factor[j * n + i], x[j]));
        x[i] = rest.map(|v| v / factor[i * n + i]);
    }
}

/// In four interleaved sums, so that additions need not wait for each other.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_solves_and_an_indefinite_matrix_is_refused() {
        for n in [1, 2, 5, 12] {
            // G = B Bᵀ + I of an uneven B
            let b = |i: usize, k: usize| ((3 * i + 5 * k) as f64).sin();
            let g = |i: usize, j: usize| {
                (0..n).map(|k| b(i, k) * b(j, k)).sum::<f64>() + f64::from(u8::from(i == j))
            };
            let gram: Vec<f64> = (0..n * n).map(|k| g(k / n, k % n)).collect();
            let truth: Vec<[f64; 2]> = (0..n).map(|i| [i as f64 - 1.5, (i as f64).cos()]).collect();
            let mut x: Vec<[f64; 2]> =
                (0..n).map(|i| [0, 1].map(|c| (0..n).map(|j| gram[i * n + j] * truth[j][c]).sum())).collect();
            let mut factored = gram.clone();
            factor(&mut factored, n).unwrap();
            substitute(&factored, n, &mut x);
            let pairs = x.as_flattened().iter().zip(truth.as_flattened());
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-10), "{n}");
            let mut indefinite = gram;
            indefinite[n * n - 1] = -1.0;
            assert!(factor(&mut indefinite, n).is_none(), "{n}");
        }
    }
}
