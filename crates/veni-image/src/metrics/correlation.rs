//! Linear and rank correlation.

/// Pearson's linear correlation, r = Σ(a−ā)(b−b̄) / √(Σ(a−ā)² Σ(b−b̄)²). `None` where it is undefined:
/// fewer than two values, a constant sequence, or a value that is not finite.
///
/// # Panics
/// If the sequences differ in length.
pub fn pearson(a: &[f64], b: &[f64]) -> Option<f64> {
    assert_eq!(a.len(), b.len(), "correlation of {} with {} values", a.len(), b.len());
    if a.len() < 2 {
        return None;
    }
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        let (x, y) = (x - mean_a, y - mean_b);
        ab += x * y;
        aa += x * x;
        bb += y * y;
    }
    let r = ab / (aa.sqrt() * bb.sqrt());
    r.is_finite().then(|| r.clamp(-1.0, 1.0))
}

/// Spearman's rank correlation: Pearson's of the [`ranks`], so that ties count as their average rank.
/// `None` where it is undefined (see [`pearson`]).
///
/// # Panics
/// If the sequences differ in length.
pub fn spearman(a: &[f64], b: &[f64]) -> Option<f64> {
    let finite = |v: &[f64]| v.iter().all(|x| !x.is_nan());
    if !finite(a) || !finite(b) {
        return None;
    }
    pearson(&ranks(a), &ranks(b))
}

/// Ranks from 1; equal values share the average of the ranks they occupy.
pub fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
    let mut ranks = vec![0.0; values.len()];
    let mut before = 0;
    for group in order.chunk_by(|&i, &j| values[i] == values[j]) {
        for &i in group {
            ranks[i] = before as f64 + 0.5 * (group.len() + 1) as f64;
        }
        before += group.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_share_their_average_rank() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, -2.0, 3.0]), [4.0, 2.0, 4.0, 1.0, 4.0]);
        // −0 equals 0, whatever the sort puts first.
        assert_eq!(ranks(&[0.0, -0.0, 1.0]), [1.5, 1.5, 3.0]);
    }

    #[test]
    fn rank_correlation_sees_monotone_curves_as_lines() {
        let a: Vec<f64> = (0..20).map(f64::from).collect();
        let b: Vec<f64> = a.iter().map(|x| (0.4 * x).exp()).collect();
        assert!((spearman(&a, &b).unwrap() - 1.0).abs() < 1e-12);
        assert!(pearson(&a, &b).unwrap() < 0.9);
        let reversed: Vec<f64> = b.iter().rev().copied().collect();
        assert!((spearman(&a, &reversed).unwrap() + 1.0).abs() < 1e-12);
    }

    #[test]
    fn undefined_is_none() {
        assert_eq!(pearson(&[1.0], &[2.0]), None);
        assert_eq!(pearson(&[1.0, 1.0], &[2.0, 3.0]), None);
        assert_eq!(spearman(&[1.0, f64::NAN], &[2.0, 3.0]), None);
    }
}
