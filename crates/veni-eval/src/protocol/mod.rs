//! The experiments of the paper, each with a name, fixed seeds and an exact definition (docs/MODEL.md, Evaluation).
//!
//! | protocol | question |
//! |---|---|
//! | [`reconstruction`] | how much of a panorama survives a latent of dimension D? |
//! | [`uniqueness`] | do two fits of one panorama end in the same place of latent space? |
//! | [`consistency`] | are latents that are far apart panoramas that are far apart? |
//! | [`interpolation`] | is the way from one panorama to another even? |
//! | [`equivariance`] | does the latent rotate with the panorama? |
//! | [`dataset_size`] | what is more training data worth? |
//! | [`ablations`] | what is each part of the model worth? |
//! | [`light`] | does what is decoded light things as the panorama does? |
//! | [`spheres`] | do three balls look as they do under the panorama? |
//! | [`photo`] | what light does a photograph of part of the scene give? |
//! | [`completion`] | what is in the hidden half of a panorama? |
//! | [`realism`] | are random skies like photographed ones? |
//! | [`inverse_rendering`] | what does the rendered image of a ball tell of the light on it? |
//! | [`paper`] | all of them but `light`, `spheres`, `photo`, `completion` and `realism`, with published numbers beside ours |
//!
//! A protocol takes an [`Evaluation`] and gives a [`Report`]. What takes long is kept in its [`ResultStore`] image by image; a
//! [`Part`](veni_data::Part) of it can be computed beforehand by `keep`, in processes that know nothing of each other, without tables or
//! figures. Once all parts are there, `run` finds them and makes both.

pub mod ablations;
mod camera;
pub mod completion;
pub mod consistency;
pub mod dataset_size;
pub mod equivariance;
pub mod interpolation;
pub mod inverse_rendering;
pub mod light;
pub mod paper;
mod patches;
pub mod photo;
mod published;
mod quality;
pub mod realism;
pub mod reconstruction;
pub mod spheres;
#[cfg(test)]
mod tests;
mod training;
pub mod uniqueness;
mod work;

use std::path::{Path, PathBuf};

pub use published::Published;

use super::codec::{Autoencoder, Codec, Lobed, Optimised};
use super::figure::{LabelledSheet, Plot};
use super::fitting::FitSettings;
use super::lpips::Lpips;
use super::store::ResultStore;
use super::table::Table;
use crate::Result;
use veni_core::LoadedModel;
use veni_data::Dataset;
use veni_image::Panorama;
use veni_image::tonemap::Tonemap;
use veni_light::progress::Observer;
use veni_light::sphere::Equirect;

/// Most columns of a panorama in figures that show many.
const SHOWN: usize = 128;

/// What can be chosen about the protocols.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Seed of everything random.
    pub seed: u64,
    /// Fewer steps, fewer pixels, fewer pairs: to see a trend in minutes.
    pub quick: bool,
    /// Pairs of random latents (consistency); absent: 1000, or 200 in quick.
    pub pairs: Option<usize>,
    /// Frames of an interpolation, both ends included; at least 3.
    pub frames: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { seed: 0, quick: false, pairs: None, frames: 9 }
    }
}

/// Everything that a protocol works with.
#[derive(Clone, Copy)]
pub struct Evaluation<'a> {
    /// The models.
    pub subjects: &'a [LoadedModel],
    /// Rows beside the models' own in reconstruction tables: classical bases of equal D.
    pub others: &'a [&'a dyn Codec],
    /// Numbers of lobes: a row of each beside the models' own passes.
    pub lobes: &'a [usize],
    /// The panoramas.
    pub data: &'a Dataset,
    /// Panoramas of the same size that are known beforehand, for baselines of [`photo`] and [`completion`].
    pub train: Option<&'a Dataset>,
    /// LPIPS, if there are weights for it.
    pub lpips: Option<&'a Lpips>,
    /// Seeds and effort.
    pub settings: Settings,
    /// Where results are kept.
    pub store: &'a ResultStore,
    /// The folder of figures.
    pub figures: &'a Path,
    /// Observer of progress.
    pub observer: &'a dyn Observer,
}

/// What a protocol found.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// The answer: one table per protocol.
    pub tables: Vec<Table>,
    /// Tables of every panorama or pair behind it.
    pub details: Vec<Table>,
    /// Files that were written.
    pub figures: Vec<PathBuf>,
}

impl std::fmt::Debug for Evaluation<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: Vec<_> = self.subjects.iter().map(LoadedModel::name).collect();
        f.debug_struct("Evaluation")
            .field("subjects", &names)
            .field("panoramas", &self.data.len())
            .field("settings", &self.settings)
            .finish_non_exhaustive()
    }
}

fn boxed<'a>(codec: impl Codec + 'a) -> Box<dyn Codec + 'a> {
    Box::new(codec)
}

impl<'a> Evaluation<'a> {
    /// The models' passes that are compared: autoencoder where there is an encoder, optimised, and with each number of lobes.
    fn codecs(&self, subject: &'a LoadedModel) -> Vec<Box<dyn Codec + 'a>> {
        let fit = FitSettings::thorough(self.data.grid(), self.settings.quick);
        let fit = if subject.lights() > 0 { fit.lit() } else { fit };
        let quick = self.settings.quick;
        let with = |count: &usize| Box::new(Lobed::new(subject, *count, quick)) as Box<dyn Codec>;
        let (pass, optimised): (_, Box<dyn Codec>) = match subject.lobes() {
            0 => (Autoencoder::new(subject).map(boxed), boxed(Optimised::new(subject, fit))),
            _ => (Lobed::encoded(subject, quick).map(boxed), boxed(Lobed::own(subject, quick))),
        };
        pass.into_iter().chain([optimised]).chain(self.lobes.iter().map(with)).collect()
    }

    /// How the optimised pass fits, in words.
    fn optimised_note(&self) -> String {
        let fit = FitSettings::thorough(self.data.grid(), self.settings.quick);
        let lit = self.subjects.iter().any(|subject| subject.lights() > 0);
        let lit = if lit { " Models with lights in their codes: with an energy weight of 0.35." } else { "" };
        let lobes = match self.lobes.is_empty() && self.subjects.iter().all(|subject| subject.lobes() == 0) {
            true => "",
            false => {
                " With lobes: vectors and lobes at 128 columns, with an energy weight of 0.35, lights no wider than 1.5°."
            }
        };
        format!(
            "Optimised: {} from the encoder's latent (from 0 without encoder), solid-angle-weighted log error.{lit}{lobes}",
            fit.describe()
        )
    }

    fn plot(&self, name: &str, plot: &Plot, report: &mut Report) -> Result<()> {
        let path = self.figures.join(format!("{}.png", file_name(name)));
        plot.draw().write(&path)?;
        report.figures.push(path);
        Ok(())
    }

    fn sheet(&self, name: &str, sheet: &LabelledSheet, report: &mut Report) -> Result<()> {
        let path = self.figures.join(format!("{}.png", file_name(name)));
        sheet.write(&path)?;
        report.figures.push(path);
        Ok(())
    }
}

/// The size of panoramas in figures that show many.
fn shown(grid: Equirect) -> Equirect {
    if grid.width > SHOWN { Equirect::new(SHOWN, SHOWN / 2) } else { grid }
}

/// Log radiance as the LDR metrics see it, at the size of [`shown`].
fn thumbnail(grid: Equirect, log_radiance: &[f32]) -> Vec<[u8; 3]> {
    let small = Panorama::from_log(grid, log_radiance.as_chunks().0).resample(shown(grid));
    let tonemap = Tonemap::reference(&small);
    small.pixels().iter().map(|pixel| tonemap.apply_u8(*pixel)).collect()
}

/// A model's name may hold anything, a file's name may not.
fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect()
}
