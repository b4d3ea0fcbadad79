//! How likely a code is under a prior. MODEL (36).

use super::Prior;

impl Prior {
    /// −ln p of the vectors up to a constant, |L⁻¹c|² + ½ |K⁻¹(z − μ)|² in the notation of [`Prior`], and its
    /// derivatives with respect to x, y, z of each. For [`Prior::standard`] it is ½ Σ |vector|².
    ///
    /// # Panics
    /// If there are not N vectors.
    pub fn energy(&self, vectors: &[[f32; 3]]) -> (f64, Vec<[f64; 3]>) {
        let n = self.latent_vectors();
        assert_eq!(vectors.len(), n, "a prior of {n} vectors");
        let xy = |k: usize| [f64::from(self.xy_real[k]), f64::from(self.xy_imaginary[k])];
        let z = |k: usize| [f64::from(self.z[k]), 0.0];
        let c: Vec<_> = vectors.iter().map(|v| [f64::from(v[0]), f64::from(v[1])]).collect();
        let centred = vectors.iter().zip(&self.z_mean).map(|(v, m)| [f64::from(v[2]) - f64::from(*m), 0.0]);
        let w = forward(n, &xy, c);
        let g = forward(n, &z, centred.collect());
        let square = |v: &[[f64; 2]]| v.iter().map(|[a, b]| a * a + b * b).sum::<f64>();
        let energy = square(&w) + 0.5 * square(&g);
        let (by_xy, by_z) = (backward(n, &xy, w), backward(n, &z, g));
        let both = by_xy.into_iter().zip(by_z);
        (energy, both.map(|([x, y], [z, _])| [2.0 * x, 2.0 * y, z]).collect())
    }
}

/// L⁻¹ b for the lower triangle L, whose entries `at` gives row-major; complex numbers.
fn forward(n: usize, at: &dyn Fn(usize) -> [f64; 2], mut b: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    for i in 0..n {
        for j in 0..i {
            let ([r, s], [p, q]) = (at(i * n + j), b[j]);
            b[i] = [b[i][0] - (r * p - s * q), b[i][1] - (r * q + s * p)];
        }
        // a Cholesky factor's diagonal is real
        b[i] = b[i].map(|v| v / at(i * n + i)[0]);
    }
    b
}

/// L⁻ᴴ b.
fn backward(n: usize, at: &dyn Fn(usize) -> [f64; 2], mut b: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    for i in (0..n).rev() {
        for j in i + 1..n {
            let ([r, s], [p, q]) = (at(j * n + i), b[j]);
            b[i] = [b[i][0] - (r * p + s * q), b[i][1] - (r * q - s * p)];
        }
        b[i] = b[i].map(|v| v / at(i * n + i)[0]);
    }
    b
}

#[cfg(test)]
mod tests {
    use crate::latent::{Latent, Prior};

    fn codes() -> Vec<Latent> {
        let one = |seed| {
            let mut latent = Latent::from_seed(&Prior::standard(4), seed);
            // vectors that turn together, and z away from 0
            let first = latent.vectors[0];
            latent.vectors[1] =
                [0.5 * first[0] - 0.8 * first[1], 0.5 * first[1] + 0.8 * first[0], 2.0 + first[2]];
            latent
        };
        (0..40).map(one).collect()
    }

    #[test]
    fn standard_is_half_the_square() {
        let latent = Latent::from_seed(&Prior::standard(5), 1);
        let (energy, gradient) = Prior::standard(5).energy(&latent.vectors);
        let half = 0.5 * latent.vectors.as_flattened().iter().map(|v| f64::from(v * v)).sum::<f64>();
        assert!((energy - half).abs() < 1e-5 * half);
        let pairs = gradient.as_flattened().iter().zip(latent.vectors.as_flattened());
        assert!(pairs.into_iter().all(|(s, v)| (s - f64::from(*v)).abs() < 1e-5));
    }

    #[test]
    fn gradients_agree_with_differences_and_turning_changes_nothing() {
        let prior = Prior::fit(&codes(), None).unwrap();
        let latent = Latent::from_seed(&Prior::standard(4), 9);
        let (energy, gradient) = prior.energy(&latent.vectors);
        let (turned, _) = prior.energy(&latent.turned(1.1).vectors);
        assert!((energy - turned).abs() < 1e-4 * energy);
        for (k, derivative) in gradient.as_flattened().iter().enumerate() {
            let at = |step: f32| {
                let mut moved = latent.vectors.clone();
                moved.as_flattened_mut()[k] += step;
                prior.energy(&moved).0
            };
            let step = 1.0 / 64.0;
            // a quadratic: central differences are exact
            let expected = (at(step) - at(-step)) / (2.0 * f64::from(step));
            assert!(
                (derivative - expected).abs() < 1e-4 * (1.0 + expected.abs()),
                "{k}: {derivative} {expected}"
            );
        }
    }

    #[test]
    fn samples_have_the_energy_of_their_number_of_coordinates() {
        // −ln p of a Gaussian in 3N dimensions is on average 3N/2
        let prior = Prior::fit(&codes(), None).unwrap();
        let energy = |seed| prior.energy(&Latent::from_seed(&prior, seed).vectors).0;
        let mean = (0..400).map(energy).sum::<f64>() / 400.0;
        assert!((mean - 6.0).abs() < 0.4, "{mean}");
    }
}
