//! How well panoramas survive the latent: through the encoder, or with a latent optimised for each.

use serde::Serialize;

use crate::Result;
use crate::data::Dataset;
use crate::data::coarsen::{averaged, coarse_grid};
use crate::eval::metrics::{self, Alignment};
use crate::fit::{FitConfig, FitDecoder, FitTarget, fit};
use crate::latent::Latent;
use crate::vae::Veni;

/// Scores of one panorama or their mean over a set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MeanScores {
    /// Peak signal-to-noise ratio of the display values, dB.
    pub ldr_psnr: f64,
    /// Peak signal-to-noise ratio of linear radiance, dB.
    pub hdr_psnr: f64,
    /// Structural similarity of the display values.
    pub ssim: f64,
}

/// Scores of a set of panoramas.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reconstruction {
    /// Name and scores of each panorama, in the set's order.
    pub images: Vec<(String, MeanScores)>,
    /// Their mean; all NaN for an empty set.
    pub mean: MeanScores,
}

/// Where the optimisation of a latent starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The mean of the encoder's posterior.
    Encoder,
    /// All vectors zero.
    Zero,
}

impl Reconstruction {
    /// Compares decoded images (log radiance at exposure 0, 3·W·H values each) with the panoramas they stand
    /// for. The articles' protocol is [`Alignment::LogFactor`].
    ///
    /// # Panics
    /// If there is not one image of the set's size per panorama.
    pub fn compare(dataset: &Dataset, decoded: &[Vec<f32>], alignment: Alignment) -> Self {
        assert_eq!(dataset.len(), decoded.len(), "one decoded image per panorama");
        let (width, height) = (dataset.grid().width, dataset.grid().height);
        let images: Vec<_> = (dataset.items().iter().zip(decoded))
            .map(|(item, decoded)| {
                let s = metrics::scores(decoded, &item.log_radiance, height, width, alignment);
                (item.name(), MeanScores { ldr_psnr: s.psnr_ldr, hdr_psnr: s.psnr_hdr, ssim: s.ssim_ldr })
            })
            .collect();
        let n = images.len() as f64;
        let mean = |f: &dyn Fn(&MeanScores) -> f64| images.iter().map(|(_, s)| f(s)).sum::<f64>() / n;
        let mean = MeanScores {
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
    pub fn autoencoder(veni: &Veni, dataset: &Dataset, alignment: Alignment) -> Result<Self> {
        let latents = encoded(veni, dataset)?;
        Ok(Self::of_latents(veni, dataset, &latents, alignment))
    }

    /// The best the decoder can do: each panorama decoded from a latent optimised for it under `decoder`, the model's own
    /// in either form. The fit sees the panoramas averaged over `factor` × `factor` pixels (1: every pixel); the scores
    /// see every pixel.
    ///
    /// # Errors
    /// As [`Veni::stripes`] and [`fit`].
    ///
    /// # Panics
    /// If `factor` does not divide the grid's sides.
    pub fn optimised(
        veni: &Veni,
        decoder: FitDecoder<'_>,
        dataset: &Dataset,
        start: Start,
        config: &FitConfig,
        factor: usize,
        alignment: Alignment,
    ) -> Result<Self> {
        let start = match start {
            Start::Encoder => encoded(veni, dataset)?,
            Start::Zero => vec![Latent::new(vec![[0.0; 3]; veni.latent_vectors()]); dataset.len()],
        };
        let grid = coarse_grid(dataset.grid(), factor);
        let mut latents = Vec::with_capacity(dataset.len());
        // a few at a time: the graph of a fit holds every activation of its images
        for (items, start) in dataset.items().chunks(4).zip(start.chunks(4)) {
            let images: Vec<_> =
                items.iter().map(|i| averaged(dataset.grid(), &i.log_radiance, factor)).collect();
            let images: Vec<_> = images.iter().map(Vec::as_slice).collect();
            let target = FitTarget::panoramas(grid, &images);
            latents.extend(fit(decoder, &target, start, config)?.latents);
        }
        Ok(Self::of_latents(veni, dataset, &latents, alignment))
    }

    fn of_latents(veni: &Veni, dataset: &Dataset, latents: &[Latent], alignment: Alignment) -> Self {
        let vectors: Vec<_> = latents.iter().map(|z| z.vectors.clone()).collect();
        Self::compare(dataset, &veni.decode(dataset.grid(), &vectors), alignment)
    }
}

fn encoded(veni: &Veni, dataset: &Dataset) -> Result<Vec<Latent>> {
    let images: Vec<_> = dataset.items().iter().map(|item| item.log_radiance.as_slice()).collect();
    Ok(veni.encode(dataset.grid(), &images)?.into_iter().map(|e| Latent::new(e.vectors)).collect())
}
