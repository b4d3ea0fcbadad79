//! How well panoramas survive the latent: through the encoder, or with a latent optimised for each.

use std::ops::Range;

use serde::Serialize;

use crate::Result;
use crate::data::coarsen::{averaged, coarse_grid};
use crate::data::{Dataset, Item};
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
        Self::of(rated(dataset, 0, decoded, alignment))
    }

    /// [`compare`](Self::compare) with images that `decode` makes of a range of the panoramas at a time, so that those of a
    /// large set are never all in memory. Ranges but the last are of [`PART`](Self::PART) panoramas.
    ///
    /// # Errors
    /// What `decode` says.
    ///
    /// # Panics
    /// If there is not one image of the set's size per panorama.
    pub fn by_parts(
        dataset: &Dataset,
        alignment: Alignment,
        mut decode: impl FnMut(Range<usize>) -> Result<Vec<Vec<f32>>>,
    ) -> Result<Self> {
        let mut images = Vec::with_capacity(dataset.len());
        for first in (0..dataset.len()).step_by(Self::PART) {
            let range = first..dataset.len().min(first + Self::PART);
            let decoded = decode(range.clone())?;
            assert_eq!(range.len(), decoded.len(), "one decoded image per panorama");
            images.extend(rated(dataset, first, &decoded, alignment));
        }
        Ok(Self::of(images))
    }

    /// Panoramas that [`by_parts`](Self::by_parts) decodes together.
    pub const PART: usize = 64;

    fn of(images: Vec<(String, MeanScores)>) -> Self {
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

/// Name and scores of the panoramas from `first` on.
fn rated(
    dataset: &Dataset,
    first: usize,
    decoded: &[Vec<f32>],
    alignment: Alignment,
) -> Vec<(String, MeanScores)> {
    let (width, height) = (dataset.grid().width, dataset.grid().height);
    let rate = |(item, decoded): (&Item, &Vec<f32>)| {
        let s = metrics::scores(decoded, &item.log_radiance, height, width, alignment);
        (item.name(), MeanScores { ldr_psnr: s.psnr_ldr, hdr_psnr: s.psnr_hdr, ssim: s.ssim_ldr })
    };
    dataset.items()[first..].iter().zip(decoded).map(rate).collect()
}

fn encoded(veni: &Veni, dataset: &Dataset) -> Result<Vec<Latent>> {
    let images: Vec<_> = dataset.items().iter().map(|item| item.log_radiance.as_slice()).collect();
    Ok(veni.encode(dataset.grid(), &images)?.into_iter().map(|e| Latent::new(e.vectors)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sphere::Equirect;

    #[test]
    fn parts_are_rated_as_the_whole_is() {
        let grid = Equirect::new(32, 16);
        let value = |at: usize, v: usize| ((at * 31 + v) as f32 * 0.37).sin();
        let item = |at: usize| Item {
            path: at.to_string().into(),
            log_radiance: (0..3 * grid.len()).map(|v| value(at, v)).collect(),
            log_exposure: 0.0,
            generated: false,
        };
        let set = Dataset::new(grid, (0..Reconstruction::PART + 6).map(item).collect());
        let decoded = |at: usize| (0..3 * grid.len()).map(|v| 0.9 * value(at, v) + 0.1).collect::<Vec<_>>();
        let all: Vec<_> = (0..set.len()).map(decoded).collect();
        let whole = Reconstruction::compare(&set, &all, Alignment::Exposure);
        let mut ranges = Vec::new();
        let parts = Reconstruction::by_parts(&set, Alignment::Exposure, |range| {
            ranges.push(range.clone());
            Ok(all[range].to_vec())
        });
        assert_eq!(parts.unwrap(), whole);
        assert_eq!(ranges, [0..64, 64..70]);
        // images of other panoramas are others
        let shifted = Reconstruction::by_parts(&set, Alignment::Exposure, |range| {
            Ok(range.map(|at| decoded((at + 1) % set.len())).collect())
        });
        assert_ne!(shifted.unwrap(), whole);
    }
}
