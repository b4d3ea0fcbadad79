//! How likely a code is under a prior. MODEL (36).

use super::Prior;
use crate::cholesky;

impl Prior {
    /// −ln p of the vectors up to a constant, |L⁻¹c|² + ½ |K⁻¹(z − μ)|² in the notation of [`Prior`], and its
    /// derivatives with respect to x, y, z of each. For [`Prior::standard`] it is ½ Σ |vector|².
    ///
    /// # Panics
    /// If there are not N vectors.
    pub fn energy(&self, vectors: &[[f32; 3]]) -> (f64, Vec<[f64; 3]>) {
        let n = self.latent_vectors();
        let (mut c, mut centred) = self.centred(vectors);
        let (xy, z) = self.factors();
        cholesky::forward(&xy, n, &mut c);
        cholesky::forward(&z, n, &mut centred);
        let energy = c.iter().map(|[[a, b]]| a * a + b * b).sum::<f64>()
            + 0.5 * centred.iter().map(|[g]| g * g).sum::<f64>();
        cholesky::backward(&xy, n, &mut c);
        cholesky::backward(&z, n, &mut centred);
        let both = c.into_iter().zip(centred);
        (energy, both.map(|([[x, y]], [z])| [2.0 * x, 2.0 * y, z]).collect())
    }
}

#[cfg(test)]
mod tests {
    use crate::latent::{Latent, Prior};

    fn codes() -> Vec<Latent> {
        let one = |seed| {
            let mut latent = Latent::from_seed(&Prior::standard(4), seed);
            // vectors that rotate together, and z away from 0
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
    fn gradients_agree_with_differences_and_rotations_change_nothing() {
        let prior = Prior::fit(&codes(), None).unwrap();
        let latent = Latent::from_seed(&Prior::standard(4), 9);
        let (energy, gradient) = prior.energy(&latent.vectors);
        let (rotated, _) = prior.energy(&latent.rotated(1.1).vectors);
        assert!((energy - rotated).abs() < 1e-4 * energy);
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
