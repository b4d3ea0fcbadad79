//! Cholesky's factors of small dense matrices, real or complex, in f64, and the systems of equations that they solve.
//!
//! Matrices are row-major `[n, n]`; a number is an `f64` or a [`Complex`]. One [`factor`], then as many [`forward`],
//! [`backward`] or [`substitute`] as there are right sides.

/// A complex number: real and imaginary part.
pub type Complex = [f64; 2];

/// A pivot below this share of its diagonal element says that the columns are dependent.
const RANK: f64 = 1e-10;

/// A matrix element: `f64` or [`Complex`].
pub trait Scalar: Copy + number::Number {}
impl Scalar for f64 {}
impl Scalar for Complex {}

/// G = L Lᴴ in place, L lower triangular with a real positive diagonal, for a Hermitian (for real numbers: symmetric) G
/// `[n, n]`; only the lower triangle is read and written. `None` if G is not positive definite, or so nearly that its
/// columns cannot be told from dependent ones; G is then half overwritten.
///
/// # Panics
/// If there are fewer than n² numbers.
pub fn factor<T: Scalar>(gram: &mut [T], n: usize) -> Option<()> {
    for i in 0..n {
        let (above, row) = gram.split_at_mut(i * n);
        for j in 0..i {
            let other = &above[j * n..][..=j];
            row[j] = row[j].minus(dot(&row[..j], &other[..j])).over(other[j].real());
        }
        let pivot = row[i].minus(dot(&row[..i], &row[..i])).real();
        if pivot.is_nan() || pivot <= RANK * row[i].real() {
            return None;
        }
        row[i] = T::of_real(pivot.sqrt());
    }
    Some(())
}

/// L⁻¹ x in place, for K right sides at once, x `[n][K]`.
///
/// # Panics
/// If the factor or x is shorter than n asks for.
pub fn forward<T: Scalar, const K: usize>(factor: &[T], n: usize, x: &mut [[T; K]]) {
    for i in 0..n {
        let rest: [T; K] = (0..i).fold(x[i], |rest, j| less(rest, factor[i * n + j], x[j]));
        x[i] = rest.map(|v| v.over(factor[i * n + i].real()));
    }
}

/// L⁻ᴴ x in place, for K right sides at once, x `[n][K]`.
///
/// # Panics
/// If the factor or x is shorter than n asks for.
pub fn backward<T: Scalar, const K: usize>(factor: &[T], n: usize, x: &mut [[T; K]]) {
    for i in (0..n).rev() {
        let rest: [T; K] = (i + 1..n).fold(x[i], |rest, j| less(rest, factor[j * n + i].conjugate(), x[j]));
        x[i] = rest.map(|v| v.over(factor[i * n + i].real()));
    }
}

/// The solution of L Lᴴ y = x in place, for K right sides at once, x `[n][K]`.
///
/// # Panics
/// If the factor or x is shorter than n asks for.
pub fn substitute<T: Scalar, const K: usize>(factor: &[T], n: usize, x: &mut [[T; K]]) {
    forward(factor, n, x);
    backward(factor, n, x);
}

fn less<T: Scalar, const K: usize>(a: [T; K], k: T, b: [T; K]) -> [T; K] {
    std::array::from_fn(|c| a[c].minus(k.times(b[c])))
}

/// Σ a b̄ in four interleaved sums, so that additions need not wait for each other.
fn dot<T: Scalar>(a: &[T], b: &[T]) -> T {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let zero = T::of_real(0.0);
    let mut sums = [zero; 4];
    for (a, b) in a.iter().zip(b) {
        for k in 0..4 {
            sums[k] = sums[k].plus(a[k].times(b[k].conjugate()));
        }
    }
    let rest = a_rest.iter().zip(b_rest).map(|(a, b)| a.times(b.conjugate())).fold(zero, T::plus);
    sums.into_iter().fold(zero, T::plus).plus(rest)
}

/// The arithmetic that real and complex numbers share.
mod number {
    use super::Complex;

    pub trait Number {
        fn of_real(value: f64) -> Self;
        fn real(self) -> f64;
        fn conjugate(self) -> Self;
        fn plus(self, other: Self) -> Self;
        fn minus(self, other: Self) -> Self;
        fn times(self, other: Self) -> Self;
        fn over(self, divisor: f64) -> Self;
    }

    impl Number for f64 {
        fn of_real(value: f64) -> Self {
            value
        }
        fn real(self) -> f64 {
            self
        }
        fn conjugate(self) -> Self {
            self
        }
        fn plus(self, other: Self) -> Self {
            self + other
        }
        fn minus(self, other: Self) -> Self {
            self - other
        }
        fn times(self, other: Self) -> Self {
            self * other
        }
        fn over(self, divisor: f64) -> Self {
            self / divisor
        }
    }

    impl Number for Complex {
        fn of_real(value: f64) -> Self {
            [value, 0.0]
        }
        fn real(self) -> f64 {
            self[0]
        }
        fn conjugate(self) -> Self {
            [self[0], -self[1]]
        }
        fn plus(self, other: Self) -> Self {
            [self[0] + other[0], self[1] + other[1]]
        }
        fn minus(self, other: Self) -> Self {
            [self[0] - other[0], self[1] - other[1]]
        }
        fn times(self, [r, s]: Self) -> Self {
            let [p, q] = self;
            [p * r - q * s, p * s + q * r]
        }
        fn over(self, divisor: f64) -> Self {
            self.map(|v| v / divisor)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PINNED: [u64; 2] = [0xb001_4f56_5118_02d6, 0x9c78_d4ae_8895_886b];

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

    /// The fits' numbers depend on how these sums are rounded.
    #[test]
    fn the_real_factor_is_rounded_as_ever() {
        let n = 11;
        let b = |i: usize, k: usize| f64::from(u32::try_from((7 * i + 11 * k) % 13).unwrap()) / 3.0 - 2.0;
        let mut gram: Vec<f64> =
            (0..n * n).map(|at| (0..n).map(|k| b(at / n, k) * b(at % n, k)).sum::<f64>()).collect();
        (0..n).for_each(|i| gram[i * (n + 1)] += 0.1);
        factor(&mut gram, n).unwrap();
        let mut x: Vec<[f64; 1]> = (0..n).map(|i| [b(i, 3)]).collect();
        substitute(&gram, n, &mut x);
        let mixed = |all: &[f64]| all.iter().fold(0u64, |mix, v| mix.rotate_left(7) ^ v.to_bits());
        let lower: Vec<f64> = (0..n).flat_map(|i| gram[i * n..=i * n + i].to_vec()).collect();
        assert_eq!([mixed(&lower), mixed(x.as_flattened())], PINNED);
    }

    #[test]
    fn a_complex_factor_gives_the_matrix_back_and_solves() {
        for n in [1, 2, 5, 12] {
            let b = |i: usize, k: usize| [((3 * i + 5 * k) as f64).sin(), ((2 * i + 7 * k) as f64).cos()];
            let product = |a: Complex, [r, s]: Complex| [a[0] * r - a[1] * s, a[0] * s + a[1] * r];
            let sum = |terms: &mut dyn Iterator<Item = Complex>| {
                terms.fold([0.0; 2], |t, v| [t[0] + v[0], t[1] + v[1]])
            };
            let g = |i: usize, j: usize| {
                let [re, im] = sum(&mut (0..n).map(|k| product(b(i, k), [b(j, k)[0], -b(j, k)[1]])));
                [re + f64::from(u8::from(i == j)), im]
            };
            let mut gram: Vec<Complex> = (0..n * n).map(|k| g(k / n, k % n)).collect();
            let truth: Vec<Complex> = (0..n).map(|i| [i as f64 - 1.5, (i as f64).cos()]).collect();
            let mut x: Vec<[Complex; 1]> =
                (0..n).map(|i| [sum(&mut (0..n).map(|j| product(g(i, j), truth[j])))]).collect();
            factor(&mut gram, n).unwrap();
            for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
                let l = |i: usize, k: usize| gram[i * n + k];
                let back = sum(&mut (0..=j).map(|k| product(l(i, k), [l(j, k)[0], -l(j, k)[1]])));
                assert!((0..2).all(|c| (back[c] - g(i, j)[c]).abs() < 1e-12), "{n}: {i}, {j}");
            }
            assert!((0..n).all(|i| gram[i * (n + 1)][1] == 0.0 && gram[i * (n + 1)][0] > 0.0));
            substitute(&gram, n, &mut x);
            let pairs = x.as_flattened().as_flattened().iter().zip(truth.as_flattened());
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-10), "{n}");
        }
    }
}
