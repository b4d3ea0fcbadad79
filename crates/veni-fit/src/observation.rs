//! From a picture to what can be fitted: log radiance at exposure 0, what is known, what is clipped.

pub(crate) mod black;

use std::f32::consts::TAU;

use crate::FitTarget;
use crate::{Error, Result};
use veni_image::{Panorama, Picture, exposure, luminance, without_zeros};
use veni_light::sphere::{Equirect, View};

/// A cell counts as unknown if less of it is known.
const LEAST_KNOWN: f32 = 0.1;

/// One image, ready to be fitted.
///
/// Black is dark, not unknown: a known value of 0, or below, stands for the smallest positive one of the picture, and at most 10⁻⁴ of
/// its mean radiance; in a pixel of which other channels have light, for a hundredth of its luminance ([`without_zeros`]). In a
/// photograph of display values it stands for the smallest that a pixel has, and at most the first step of 8
/// bits: what was clipped to black is known to be no brighter.
#[derive(Clone, Debug)]
pub struct Observation {
    grid: Equirect,
    perspective: Option<Perspective>,
    log_radiance: Vec<f32>,
    log_exposure: f32,
    /// How much of each pixel is known, if not all of all.
    mask: Option<Vec<f32>>,
    clipped: Option<Vec<bool>>,
}

/// The pixels of a perspective view.
#[derive(Clone, Debug)]
struct Perspective {
    view: View,
    directions: Vec<[f32; 3]>,
    areas: Vec<f32>,
}

impl Observation {
    /// A panorama (width = 2 × height) brought to `grid`, by the mean radiance of what is known under each of its
    /// pixels.
    ///
    /// # Errors
    /// [`Error::Invalid`] if no known pixel has positive radiance.
    pub fn panorama(picture: &Picture, grid: Equirect) -> Result<Self> {
        let source = Equirect::new(picture.size()[0], picture.size()[1]);
        if source.width != 2 * source.height {
            return Err(Error::invalid(format!(
                "{} × {} is not a panorama: its width must be twice its height; say how a photograph was taken \
                 (field of view and direction)",
                source.width, source.height
            )));
        }
        let (pixels, known) = split(picture);
        let grey = |values: &[f32]| -> Vec<[f32; 3]> { values.iter().map(|v| [*v; 3]).collect() };
        let sums = Panorama::new(source, pixels).resample(grid);
        let known = Panorama::new(source, grey(&known)).resample(grid);
        let clips = clipped(picture).map(|c| Panorama::new(source, c).resample(grid));
        let areas: Vec<f32> = (0..grid.height)
            .flat_map(|j| std::iter::repeat_n(grid.solid_angle(j) as f32, grid.width))
            .collect();
        let known = known.pixels().iter().map(|k| k[0]).collect();
        let (sums, clips) = (sums.pixels(), clips.as_ref().map(Panorama::pixels));
        Self::new(grid, None, &areas, sums, known, black::of_display(picture), clips)
    }

    /// A photograph taken by `view`, averaged over square cells so that neither side is longer than `longest`
    /// pixels.
    ///
    /// # Errors
    /// As [`Observation::panorama`]; also if `view` is none (a field of view of 0 or of half a turn).
    pub fn photograph(picture: &Picture, view: &View, longest: usize) -> Result<Self> {
        if !view.is_valid() {
            let degrees = view.fov.to_degrees();
            return Err(Error::invalid(format!(
                "a field of view of {degrees}°: it must lie between 0 and 180, and all angles must be finite"
            )));
        }
        let [width, height] = picture.size();
        let cell = width.max(height).div_ceil(longest.max(1)).max(1);
        // whole cells only, centred
        let [w, h] = [(width / cell).max(1), (height / cell).max(1)];
        let (pixels, known) = split(picture);
        let clips = clipped(picture);
        let [cw, ch] = [cell.min(width), cell.min(height)];
        let [left, top] = [(width - w * cw) / 2, (height - h * ch) / 2];
        let average = |at: &dyn Fn(usize) -> [f32; 3]| -> Vec<[f32; 3]> {
            let mut out = Vec::with_capacity(w * h);
            for (row, column) in (0..h).flat_map(|r| (0..w).map(move |c| (r, c))) {
                let mut sum = [0.0f64; 3];
                for (y, x) in (0..ch).flat_map(|y| (0..cw).map(move |x| (y, x))) {
                    let value = at((top + row * ch + y) * width + left + column * cw + x);
                    (0..3).for_each(|c| sum[c] += f64::from(value[c]));
                }
                out.push(sum.map(|v| (v / (cw * ch) as f64) as f32));
            }
            out
        };
        let sums = average(&|p| pixels[p]);
        let known = average(&|p| [known[p]; 3]).into_iter().map(|k| k[0]).collect();
        let clips = clips.map(|clips| average(&|p| clips[p]));
        // what was cut off at the sides is not seen
        let seen = 2.0 * ((0.5 * view.fov).tan() * (w * cw) as f64 / width as f64).atan();
        let view = View { fov: seen, ..*view };
        let (directions, areas) = view.pixels(w, h);
        let perspective = Perspective { view, directions, areas: areas.clone() };
        let (grid, black) = (Equirect::new(w, h), black::of_display(picture));
        Self::new(grid, Some(perspective), &areas, &sums, known, black, clips.as_deref())
    }

    /// `sums` are radiance × known; `black` is what stands for 0, if the picture's own radiance does not say it.
    fn new(
        grid: Equirect,
        perspective: Option<Perspective>,
        areas: &[f32],
        sums: &[[f32; 3]],
        mut known: Vec<f32>,
        black: Option<f32>,
        clips: Option<&[[f32; 3]]>,
    ) -> Result<Self> {
        known.iter_mut().filter(|k| **k < LEAST_KNOWN).for_each(|k| *k = 0.0);
        let pairs = sums.iter().zip(&known);
        let radiance: Vec<[f32; 3]> =
            pairs.map(|(sum, k)| if *k > 0.0 { sum.map(|v| v / k) } else { [1.0; 3] }).collect();
        let weights: Vec<f64> =
            known.iter().zip(areas).map(|(known, area)| f64::from(known * area)).collect();
        let of_radiance = black::of_radiance(&radiance, &weights)
            .ok_or_else(|| Error::invalid("no known pixel of the picture has positive radiance"))?;
        let radiance: Vec<[f32; 3]> = match black {
            Some(black) => radiance.into_iter().map(|rgb| rgb.map(|v| v.max(black))).collect(),
            None => {
                let lit = |rgb: [f32; 3]| without_zeros(rgb.map(|v| v.max(0.0)), of_radiance);
                radiance.into_iter().map(lit).collect()
            }
        };
        let mut log_radiance: Vec<f32> = radiance.as_flattened().iter().map(|v| v.ln()).collect();
        let logs: Vec<f64> = radiance.iter().map(|rgb| f64::from(luminance(*rgb)).ln()).collect();
        let log_exposure = exposure::over_pixels(&logs, &weights);
        log_radiance.iter_mut().for_each(|v| *v -= log_exposure);
        let clipped = clips.map(|clips| clips.as_flattened().iter().map(|c| *c > 0.0).collect::<Vec<_>>());
        Ok(Self {
            grid,
            perspective,
            log_radiance,
            log_exposure,
            mask: known.iter().any(|k| *k < 1.0 - 1e-5).then_some(known),
            clipped: clipped.filter(|c| c.iter().any(|c| *c)),
        })
    }

    /// Width and height; the directions too, for a panorama.
    pub fn grid(&self) -> Equirect {
        self.grid
    }

    /// Natural-log radiance at exposure 0, 3·W·H values, row-major, channels last.
    pub fn log_radiance(&self) -> &[f32] {
        &self.log_radiance
    }

    /// What was subtracted: the mean of ln(luminance) over what is known, weighted by area.
    pub fn log_exposure(&self) -> f32 {
        self.log_exposure
    }

    /// How much of each pixel is known, if not all of all.
    pub fn mask(&self) -> Option<&[f32]> {
        self.mask.as_deref()
    }

    /// Which of the 3·W·H values are clipped, if any.
    pub fn clipped(&self) -> Option<&[bool]> {
        self.clipped.as_deref()
    }

    /// Whether some of the sphere is not seen, so that the scene's own exposure is not known.
    pub fn is_partial(&self) -> bool {
        self.perspective.is_some() || self.mask.is_some()
    }

    /// The share of the sphere that is known.
    pub fn share(&self) -> f32 {
        let known = |p: usize| self.mask.as_ref().map_or(1.0, |m| m[p]);
        let area = |p: usize| match &self.perspective {
            Some(perspective) => perspective.areas[p],
            None => self.grid.solid_angle(p / self.grid.width) as f32,
        };
        (0..self.grid.len()).map(|p| known(p) * area(p)).sum::<f32>() / (2.0 * TAU)
    }

    /// Whether what comes from a unit direction is seen.
    pub fn sees(&self, direction: [f32; 3]) -> bool {
        let Equirect { width, height } = self.grid;
        let pixel = match &self.perspective {
            Some(perspective) => perspective.view.pixel_of(direction, width, height),
            None => {
                let [column, row] = self.grid.pixel(direction).map(|v| v as usize);
                Some(row.min(height - 1) * width + column)
            }
        };
        pixel.is_some_and(|p| self.mask.as_ref().is_none_or(|mask| mask[p] > 0.5))
    }

    /// The target of a fit.
    pub fn target(&self) -> FitTarget<'_> {
        let consistent = "an observation is consistent";
        let mut target = FitTarget::panoramas(self.grid, &[&self.log_radiance]).expect(consistent);
        if let Some(Perspective { directions, areas, .. }) = &self.perspective {
            target = target.in_directions(directions.as_slice(), Some(areas)).expect(consistent);
        }
        if let Some(mask) = &self.mask {
            target = target.masked(&[mask]).expect(consistent);
        }
        if let Some(clipped) = &self.clipped {
            target = target.clipped(&[clipped]).expect(consistent);
        }
        target
    }
}

/// Radiance × known, and known; both 0 where a value is not finite.
fn split(picture: &Picture) -> (Vec<[f32; 3]>, Vec<f32>) {
    let (pixels, mask) = (picture.pixels(), picture.known());
    let known = |p: usize| {
        let finite = pixels[p].iter().all(|v| v.is_finite());
        // NaN in a mask is unknown too
        if finite { mask.map_or(1.0, |k| k[p].clamp(0.0, 1.0).max(0.0)) } else { 0.0 }
    };
    let known: Vec<f32> = (0..pixels.len()).map(known).collect();
    let weighted = |(rgb, k): (&[f32; 3], &f32)| {
        if *k > 0.0 { rgb.map(|v| v.max(0.0) * k) } else { [0.0; 3] }
    };
    (pixels.iter().zip(&known).map(weighted).collect(), known)
}

/// 1 for every clipped value.
fn clipped(picture: &Picture) -> Option<Vec<[f32; 3]>> {
    let clip = picture.clip()?;
    Some(picture.pixels().iter().map(|rgb| rgb.map(|v| if v >= clip { 1.0 } else { 0.0 })).collect())
}

#[cfg(test)]
mod tests;
