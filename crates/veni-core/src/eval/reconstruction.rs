//! How well panoramas survive the latent: through the encoder, or with a latent optimised for each.

use serde::Serialize;

use crate::Result;
use crate::data::Dataset;
use crate::sphere::Equirect;
use crate::train::standin::metrics;
use crate::vae::Veni;

/// Metrics of one image or their mean over images (the article's protocol: log-domain scale, own 98 %
/// quantile, every pixel alike).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Scores {
    /// Peak signal-to-noise ratio of the tonemapped images, dB.
    pub ldr_psnr: f64,
    /// Peak signal-to-noise ratio of linear radiance, dB.
    pub hdr_psnr: f64,
    /// Structural similarity of the tonemapped images.
    pub ssim: f64,
}

/// Scores of a set of panoramas.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reconstruction {
    /// Name and scores of each panorama, in the set's order.
    pub images: Vec<(String, Scores)>,
    /// Their mean; all NaN for an empty set.
    pub mean: Scores,
}

impl Reconstruction {
    /// Compares decoded images (log radiance at exposure 0) with the panoramas they stand for.
    ///
    /// # Panics
    /// If there is not one image of the set's size per panorama.
    pub fn compare(dataset: &Dataset, decoded: &[Vec<f32>]) -> Self {
        assert_eq!(dataset.len(), decoded.len(), "one decoded image per panorama");
        let images: Vec<_> = (dataset.items().iter().zip(decoded))
            .map(|(item, decoded)| (item.name(), scores(dataset.grid(), decoded, &item.log_radiance)))
            .collect();
        let n = images.len() as f64;
        let mean = |f: &dyn Fn(&Scores) -> f64| images.iter().map(|(_, s)| f(s)).sum::<f64>() / n;
        let mean = Scores {
            ldr_psnr: mean(&|s| s.ldr_psnr),
            hdr_psnr: mean(&|s| s.hdr_psnr),
            ssim: mean(&|s| s.ssim),
        };
        Self { images, mean }
    }

    /// The auto-encoder pass: each panorama decoded from the mean of its posterior.
    ///
    /// # Errors
    /// As [`Veni::stripes`].
    pub fn autoencoder(veni: &Veni, dataset: &Dataset) -> Result<Self> {
        let images: Vec<_> = dataset.items().iter().map(|i| i.log_radiance.as_slice()).collect();
        let latents: Vec<_> = veni.encode(dataset.grid(), &images)?.into_iter().map(|e| e.vectors).collect();
        Ok(Self::compare(dataset, &veni.decode(dataset.grid(), &latents)))
    }
}

/// Scores of one image, both log radiance.
pub fn scores(grid: Equirect, prediction: &[f32], target: &[f32]) -> Scores {
    metrics(grid, prediction, target)
}
