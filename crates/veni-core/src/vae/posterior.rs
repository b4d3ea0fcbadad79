//! What the encoder says about a panorama: a Gaussian over latents. MODEL (15).

use burn::tensor::Tensor;

/// N independent isotropic Gaussians in R³, one per latent vector.
#[derive(Clone, Debug)]
pub struct Posterior {
    /// μ, `[batch, N, 3]`.
    pub mean: Tensor<3>,
    /// l = ln σ², `[batch, N, 1]`, the same in x, y and z; `None` where no variance is predicted.
    pub log_variance: Option<Tensor<3>>,
}

impl Posterior {
    /// Z = μ + exp(l/2) ε; without a variance, μ.
    ///
    /// # Shapes
    /// - `noise`: ε ~ N(0, 1), `[batch, N, 3]`
    /// - output: `[batch, N, 3]`
    pub fn sample(&self, noise: Tensor<3>) -> Tensor<3> {
        match &self.log_variance {
            Some(log_variance) => self.mean.clone() + (log_variance.clone() * 0.5).exp() * noise,
            None => self.mean.clone(),
        }
    }

    /// The Kullback-Leibler divergence from N(0, 1), per image, averaged over the N latent vectors:
    /// ½ (|μ|² + 3 eˡ − 3 l − 3). `None` without a variance.
    ///
    /// # Shapes
    /// - output: `[batch]`
    pub fn kld(&self) -> Option<Tensor<1>> {
        let log_variance = self.log_variance.clone()?;
        let square = (self.mean.clone() * self.mean.clone()).sum_dim(2);
        let spread = (log_variance.clone().exp() - log_variance - 1.0) * 3.0;
        Some(((square + spread) * 0.5).mean_dim(1).reshape([-1]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    #[test]
    fn sampling_and_divergence() {
        let device = Device::flex();
        let mean = Tensor::<3>::from_floats([[[1.0, 2.0, 2.0], [0.0, 0.0, 0.0]]], &device);
        let log_variance = Tensor::<3>::from_floats([[[0.0], [4f32.ln()]]], &device);
        let noise = Tensor::<3>::from_floats([[[1.0, 0.0, -1.0], [1.0, 2.0, 3.0]]], &device);
        let posterior = Posterior { mean: mean.clone(), log_variance: Some(log_variance) };
        let sample: Vec<f32> = posterior.sample(noise.clone()).try_into_vec_as().unwrap();
        for (got, expected) in sample.iter().zip([2.0, 2.0, 1.0, 2.0, 4.0, 6.0]) {
            assert!((got - expected).abs() < 1e-6, "{sample:?}");
        }
        // ½·9 and ½·(12 − 3 ln 4 − 3), averaged
        let expected = (4.5 + 0.5 * (9.0 - 3.0 * 4f32.ln())) / 2.0;
        let kld = posterior.kld().unwrap().into_scalar::<f32>();
        assert!((kld - expected).abs() < 1e-5, "{kld}");

        let certain = Posterior { mean: mean.clone(), log_variance: None };
        assert!(certain.kld().is_none());
        assert_eq!((certain.sample(noise) - mean).abs().max().into_scalar::<f32>(), 0.0);
    }
}
