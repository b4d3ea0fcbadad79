//! Scores of reconstructions under both definitions.
//!
//! *Reference*: log radiance as stored in the files, the prediction multiplied by Σ I P/Σ P² of the logarithms
//! ([`Alignment::LogFactor`]). *Exposure*: both at exposure 0, the prediction's exposure matched to the target's
//! ([`Alignment::Exposure`]).

use serde_json::json;

use super::Evaluation;
use super::work::{Work, images};
use crate::Result;
use crate::canonical::Canonical;
use crate::codec::Codec;
use crate::lpips::Lpips;
use crate::store::Key;
use crate::table::Cell;
use veni_data::Item;
use veni_data::parallel::parallel;
use veni_image::metrics::{Alignment, Scores, scores, sun_error};
use veni_image::tonemap::srgb_q98;
use veni_light::sphere::Equirect;

/// Titles of the columns of [`Quality::cells`].
pub(super) const COLUMNS: [&str; 9] = [
    "*LDR PSNR (ref.)",
    "*SSIM (ref.)",
    "*LPIPS (ref.)",
    "*HDR PSNR (ref.)",
    "LDR PSNR (exp.)",
    "SSIM (exp.)",
    "LPIPS (exp.)",
    "HDR PSNR (exp.)",
    "Sun, °",
];

/// How the columns are to be read.
pub(super) const NOTE: &str = "PSNR in dB, mean over panoramas. (ref.): the reference implementation's definition, one factor on log radiance as \
     stored; (exp.): one exposure factor on radiance. LDR is sRGB after division by each image's 98 % quantile; LPIPS \
     (AlexNet) compares LDR values, lower is better. Sun: angle between the brightest lights, over the panoramas that show a sun.";

/// Scores of one definition.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Scored {
    pub(super) scores: Scores,
    /// Absent without weights.
    pub(super) lpips: Option<f64>,
}

/// Scores under the reference's definition and under exposure alignment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quality {
    pub(super) reference: Scored,
    pub(super) exposure: Scored,
    /// Degrees between the brightest lights; absent where no sun is seen.
    pub(super) sun: Option<f64>,
}

/// Codes, reconstructions (log radiance at exposure 0) and scores of all panoramas.
#[derive(Debug)]
pub(super) struct Reconstructed {
    pub(super) codes: Vec<Vec<f32>>,
    pub(super) images: Vec<Vec<f32>>,
    pub(super) each: Vec<Quality>,
    pub(super) mean: Quality,
}

/// Codes every panorama (codes are kept), decodes and scores it.
pub(super) fn reconstruct(run: &Evaluation<'_>, codec: &dyn Codec) -> Result<Reconstructed> {
    let (grid, items) = (run.data.grid(), run.data.items());
    let codes = codes(run, codec)?;
    let results = parallel(items.len(), |i| {
        let decoded = codec.decode(grid, &codes[i])?;
        let quality = rate(grid, &items[i], &decoded, run.lpips)?;
        Ok((decoded, quality))
    })?;
    let (images, each): (Vec<_>, Vec<_>) = results.into_iter().unzip();
    let mean = Quality::mean(&each);
    Ok(Reconstructed { codes, images, each, mean })
}

/// The codes alone.
pub(super) fn codes(run: &Evaluation<'_>, codec: &dyn Codec) -> Result<Vec<Vec<f32>>> {
    coding(run, codec).all(run)
}

/// Coding every panorama.
pub(super) fn coding<'a>(run: &Evaluation<'a>, codec: &'a dyn Codec) -> Work<'a, Vec<f32>> {
    let (grid, items) = (run.data.grid(), run.data.items());
    let key = |(item, image): (&Item, serde_json::Value)| Key {
        protocol: "reconstruction",
        name: format!("{}-{}-{}", item.name(), codec.system(), codec.pass()),
        decides: Canonical::of(json!({ "codec": codec.key(), "image": image })),
    };
    let keys: Vec<_> = items.iter().zip(images(run)).map(key).collect();
    let task = format!("{}, {}", codec.system(), codec.pass());
    Work::new("panorama", task, keys, move |i| codec.encode(grid, &items[i].log_radiance))
}

/// Scores one reconstruction at exposure 0.
pub(super) fn rate(grid: Equirect, item: &Item, decoded: &[f32], lpips: Option<&Lpips>) -> Result<Quality> {
    let stored = |image: &[f32]| image.iter().map(|v| v + item.log_exposure).collect::<Vec<_>>();
    let one =
        |prediction: &[f32], target: &[f32], alignment| score(grid, prediction, target, alignment, lpips);
    Ok(Quality {
        reference: one(&stored(decoded), &stored(&item.log_radiance), Alignment::LogFactor)?,
        exposure: one(decoded, &item.log_radiance, Alignment::Exposure)?,
        sun: sun_error(grid, decoded, &item.log_radiance),
    })
}

fn score(
    grid: Equirect,
    prediction: &[f32],
    target: &[f32],
    alignment: Alignment,
    lpips: Option<&Lpips>,
) -> Result<Scored> {
    let Equirect { width, height } = grid;
    let perceptual = |lpips: &Lpips| {
        let aligned = alignment.apply(prediction, target, height);
        let aligned: Vec<f32> = aligned.iter().map(|v| v.exp() as f32).collect();
        let target: Vec<f32> = target.iter().map(|v| v.exp()).collect();
        lpips.distance(&srgb_q98(&aligned).0, &srgb_q98(&target).0, height, width)
    };
    let lpips = lpips.map(perceptual).transpose()?;
    Ok(Scored { scores: scores(prediction, target, height, width, alignment), lpips })
}

fn mean(each: &[Quality], part: impl Fn(&Quality) -> Scored) -> Scored {
    let parts: Vec<_> = each.iter().map(part).collect();
    let lpips = parts.iter().map(|p| p.lpips).collect::<Option<Vec<_>>>().filter(|all| !all.is_empty());
    Scored {
        scores: Scores::mean(parts.iter().map(|p| &p.scores)),
        lpips: lpips.map(|all| all.iter().sum::<f64>() / all.len() as f64),
    }
}

impl Quality {
    /// Over panoramas.
    pub(super) fn mean(each: &[Self]) -> Self {
        let suns: Vec<_> = each.iter().filter_map(|q| q.sun).collect();
        Self {
            reference: mean(each, |q| q.reference),
            exposure: mean(each, |q| q.exposure),
            sun: (!suns.is_empty()).then(|| suns.iter().sum::<f64>() / suns.len() as f64),
        }
    }

    /// One cell per column of [`COLUMNS`].
    pub(super) fn cells(&self) -> Vec<Cell> {
        let cells = |s: &Scored| {
            let lpips = s.lpips.map_or_else(|| Cell::missing("no weights"), |v| Cell::Number(v, 3));
            let Scores { ldr_psnr, ssim, hdr_psnr, .. } = s.scores;
            [Cell::Number(ldr_psnr, 2), Cell::Number(ssim, 3), lpips, Cell::Number(hdr_psnr, 2)]
        };
        let sun = self.sun.map_or_else(|| Cell::missing("no sun"), |v| Cell::Number(v, 1));
        [cells(&self.reference), cells(&self.exposure)].into_iter().flatten().chain([sun]).collect()
    }
}
