//! The images that a fit can leave: the whole panorama, and where it is uncertain.

use std::path::Path;

use anyhow::Result;
use veni_fit::Best;
use veni_image::tonemap::Tonemap;
use veni_image::{Panorama, Picture, Precision, WriteFormat, WriteOptions};
use veni_light::latent::Latent;
use veni_light::output::Overwrite;
use veni_light::sphere::{Equirect, View};

use super::model::FitModel;
use veni_image::Sheet;

use crate::output::with_remedy;
use crate::size::Size;

/// The default size where the picture is not a panorama.
const GRID: [usize; 2] = [1024, 512];
/// Of the uncertainty, in natural log of radiance, at the hot end of the heat map: one stop.
const HOT: f32 = std::f32::consts::LN_2;

/// What the images are made from.
pub(super) struct Images<'a> {
    pub(super) model: &'a FitModel,
    /// The picture of the panorama or of a part of it, if there is one.
    pub(super) seen: Option<&'a Picture>,
    pub(super) view: Option<View>,
    pub(super) size: Option<Size>,
    pub(super) overwrite: Overwrite,
}

impl Images<'_> {
    fn grid(&self) -> Result<Equirect> {
        let [width, height] = match (self.size, self.view, self.seen) {
            (Some(size), _, _) => {
                let (width, height) = size.equirect()?;
                [width, height]
            }
            (None, None, Some(picture)) => picture.size(),
            _ => GRID,
        };
        Ok(Equirect::new(width, height))
    }

    /// What is known as it is, the rest from the latent.
    pub(super) fn completed(&self, path: &Path, latent: &Latent) -> Result<()> {
        let grid = self.grid()?;
        let decoded = self.model.decode(grid, latent)?;
        let mut pixels: Vec<_> = decoded.as_chunks::<3>().0.iter().map(|p| p.map(f32::exp)).collect();
        let Some(picture) = self.seen else { return self.write(path, &Panorama::new(grid, pixels)) };
        let (known, seen) = self.known(picture, grid);
        for ((pixel, known), seen) in pixels.iter_mut().zip(&known).zip(&seen) {
            for (p, s) in pixel.iter_mut().zip(seen) {
                *p = *p * (1.0 - known) + s * known;
            }
        }
        self.write(path, &Panorama::new(grid, pixels))
    }

    /// How much of each pixel is known, and its radiance there.
    fn known(&self, picture: &Picture, grid: Equirect) -> (Vec<f32>, Vec<[f32; 3]>) {
        let [width, height] = picture.size();
        let known = |p: usize| {
            let finite = picture.pixels()[p].iter().all(|v| v.is_finite());
            if finite { picture.known().map_or(1.0, |k| k[p].clamp(0.0, 1.0).max(0.0)) } else { 0.0 }
        };
        let known: Vec<f32> = (0..width * height).map(known).collect();
        // what is below 0, as a colour outside of Rec. 709 is, was fitted as black
        let radiance =
            |p: usize| if known[p] > 0.0 { picture.pixels()[p].map(|v| v.max(0.0)) } else { [0.0; 3] };
        if let Some(view) = &self.view {
            let at = |d: [f32; 3]| view.pixel_of(d, width, height);
            let hits: Vec<_> = grid.directions().into_iter().map(at).collect();
            let share = hits.iter().map(|hit| hit.map_or(0.0, |p| known[p])).collect();
            return (share, hits.iter().map(|hit| hit.map_or([0.0; 3], radiance)).collect());
        }
        let source = Equirect::new(width, height);
        let weighted = (0..source.len()).map(|p| radiance(p).map(|v| v * known[p])).collect();
        let share = Panorama::new(source, known.iter().map(|k| [*k; 3]).collect()).resample(grid);
        let sums = Panorama::new(source, weighted).resample(grid);
        let pairs = sums.pixels().iter().zip(share.pixels());
        let seen = pairs.map(|(s, k)| s.map(|v| if k[0] > 0.0 { v / k[0] } else { 0.0 })).collect();
        (share.pixels().iter().map(|k| k[0]).collect(), seen)
    }

    /// The standard deviation of log radiance over the starts (two at least), the root mean square of its channels.
    pub(super) fn uncertainty(&self, path: &Path, best: &Best) -> Result<()> {
        let grid = self.grid()?;
        let (mut sum, mut squares) = (vec![0.0f64; 3 * grid.len()], vec![0.0f64; 3 * grid.len()]);
        for latent in &best.all {
            let decoded = self.model.decode(grid, latent)?;
            for (k, v) in decoded.iter().enumerate() {
                sum[k] += f64::from(*v);
                squares[k] += f64::from(*v).powi(2);
            }
        }
        let count = best.all.len() as f64;
        let variance = |k: usize| (squares[k] - sum[k] * sum[k] / count).max(0.0) / (count - 1.0);
        let deviation: Vec<f32> = (0..grid.len())
            .map(|p| ((0..3).map(|c| variance(3 * p + c)).sum::<f64>() / 3.0).sqrt() as f32)
            .collect();
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
            let mut sheet = Sheet::plain(grid.width, grid.height);
            sheet.place(0, 0, deviation.iter().map(|d| heat(d / HOT)));
            return sheet.write(path, self.overwrite).map_err(with_remedy);
        }
        self.write(path, &Panorama::new(grid, deviation.iter().map(|d| [*d; 3]).collect()))
    }

    fn write(&self, path: &Path, image: &Panorama) -> Result<()> {
        let mut format = WriteFormat::of(path, Tonemap::filmic(image, 0.0))?;
        if let WriteFormat::Exr(precision) = &mut format {
            // radiance of any level, the sun's included
            *precision = Precision::Float;
        }
        let options = WriteOptions { overwrite: self.overwrite, ..WriteOptions::new(format) };
        image.write(path, &options).map_err(with_remedy)
    }
}

/// Black, red, yellow, white for 0 to 1.
fn heat(x: f32) -> [u8; 3] {
    let x = x.clamp(0.0, 1.0);
    [0.0, 1.0, 2.0].map(|k| ((3.0 * x - k).clamp(0.0, 1.0) * 255.0).round() as u8)
}
