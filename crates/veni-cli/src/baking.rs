//! A sky written to image files: how large, how precise, how arranged.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use veni_image::tonemap::{Curve, Tonemap};
use veni_image::{HALF_RANGE, Precision, WriteFormat, WriteOptions};
use veni_light::latent::Latent;
use veni_light::model::Model;
use veni_light::output::Overwrite;

use crate::device::Device;
use crate::output::{self, with_remedy};
use crate::picture::{FrameName, Layout, Picture, preview_tonemap};
use crate::progress::ProgressBars;
use crate::report::Report;
use crate::size::Size;

/// The largest radiance that is written: what a Radiance file holds, and half of the largest float.
const MOST: f32 = 1.7e38;

/// Stands where no PNG is written.
const NEUTRAL: Tonemap = Tonemap { scale: 1.0, curve: Curve::Srgb };

/// What images of skies are like.
#[derive(Args, Clone, Debug)]
pub(crate) struct Pictures {
    /// Width, or width x height; of one face for cube maps [default: 1024x512, faces of 256]
    #[arg(long, value_name = "W|WxH")]
    pub(crate) size: Option<Size>,

    /// EXR in half precision; fails where radiance exceeds 65504, or is below 6.1e-5, where half precision loses bits
    /// [default: half if it keeps all, else float]
    #[arg(long, conflicts_with = "float")]
    half: bool,

    /// EXR in single precision
    #[arg(long)]
    float: bool,

    /// Arrangement of directions
    #[arg(long, value_enum, default_value_t)]
    layout: Layout,

    /// Axes that a cube map's faces are named by, and that the file says its directions have
    #[arg(long, value_enum)]
    frame: Option<FrameName>,
}

/// What was written.
pub(crate) struct Baked {
    /// Paths, for display.
    pub(crate) files: Vec<String>,
    /// Of EXR files, where there are any.
    pub(crate) precision: Option<&'static str>,
    pub(crate) seconds: f64,
}

impl Pictures {
    /// The pixels' directions.
    pub(crate) fn picture(&self) -> Result<Picture> {
        Picture::new(self.layout, self.frame, self.size)
    }

    /// The arrangement's name.
    pub(crate) fn layout(&self) -> Option<String> {
        self.layout.to_possible_value().map(|v| v.get_name().to_owned())
    }

    /// Writes a sky's files. The first of the latents is the one that was named, the second the one that is written.
    pub(crate) fn write(
        &self,
        paths: &[PathBuf],
        [named, latent]: [&Latent; 2],
        picture: &Picture,
        (device, model): (&Device, &Model),
        overwrite: Overwrite,
        report: Report,
    ) -> Result<Baked> {
        let started = Instant::now();
        let baker = device.condition(latent)?;
        let png = paths.iter().any(|p| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")));
        // the exposure of a preview is that of the sky before --exposure, which would otherwise be undone
        let tonemap = if png { preview_tonemap(&device.condition(named)?)? } else { NEUTRAL };
        let attributes = picture.attributes(latent, &model.hash())?;
        let files = |precision| -> veni_light::Result<Vec<_>> {
            let file = |path: &PathBuf| {
                let mut format = WriteFormat::of(path, tonemap)?;
                if let WriteFormat::Exr(p) = &mut format {
                    *p = precision;
                }
                let attributes = attributes.clone();
                Ok((path.clone(), WriteOptions { attributes, overwrite, ..WriteOptions::new(format) }))
            };
            paths.iter().map(file).collect()
        };
        let (mut precision, may_change) = match (self.half, self.float) {
            (true, _) => (Precision::Half, false),
            (_, true) => (Precision::Float, false),
            _ => (Precision::Half, true),
        };
        // known beforehand of lights, and not found out at their row
        let peak = latent.lights.scaled(latent.log_exposure.exp()).peak(picture.grid());
        if may_change && peak > HALF_RANGE[1] && has_exr(&files(precision)?) && picture.is_panorama() {
            report.note(beyond(peak));
            precision = Precision::Float;
        }
        let progress = ProgressBars::new(report);
        loop {
            let (files, mut range) = (files(precision)?, Range::default());
            let watch = may_change && precision == Precision::Half && has_exr(&files);
            progress.begin("", "row", Some(picture.grid().height as u64));
            let result = output::write_all(&files, picture.grid(), &mut |push| {
                baker.rows(picture.directions(), &mut |row| {
                    range.see(row)?;
                    if watch && range.beyond_half().is_some() {
                        return Err(veni_light::Error::invalid("beyond the range of half precision"));
                    }
                    progress.add(1);
                    push(row)
                })
            });
            progress.end();
            match (result, range.beyond_half()) {
                (Ok(()), _) => break,
                (Err(_), Some(value)) if watch && value >= f32::MIN_POSITIVE => {
                    let [least, most] = HALF_RANGE;
                    report.note(if value > most {
                        beyond(value)
                    } else {
                        format!("half precision loses bits of a radiance of {value:.1e} (below {least:.1e}): writing floats")
                    });
                    precision = Precision::Float;
                }
                (Err(error @ veni_light::Error::Invalid { .. }), Some(value)) if self.half => {
                    let change = if value > HALF_RANGE[1] {
                        "darken with --exposure -1 …"
                    } else {
                        "brighten with --exposure 1 …"
                    };
                    bail!("{error} (leave --half out, or {change})")
                }
                (Err(error), _) => return Err(with_remedy(error)),
            }
        }
        let seconds = started.elapsed().as_secs_f64();
        // the other formats have but one
        let exr = paths.iter().any(|p| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")));
        let precision = exr.then_some(if precision == Precision::Half { "half" } else { "float" });
        Ok(Baked { files: paths.iter().map(|p| p.display().to_string()).collect(), precision, seconds })
    }
}

fn beyond(value: f32) -> String {
    format!("radiance of {value:.0} is beyond half precision ({}): writing floats", HALF_RANGE[1])
}

/// The smallest and the largest value of what is baked.
#[derive(Clone, Copy, Debug)]
struct Range {
    low: f32,
    high: f32,
}

impl Default for Range {
    fn default() -> Self {
        Self { low: f32::INFINITY, high: 0.0 }
    }
}

impl Range {
    /// Radiance is an exponential: where it is 0, or has lost bits already, it is too small for a number.
    fn see(&mut self, row: &[[f32; 3]]) -> veni_light::Result<()> {
        for value in row.as_flattened().iter().filter(|v| v.is_finite()) {
            (self.low, self.high) = (self.low.min(*value), self.high.max(*value));
        }
        if self.low < f32::MIN_POSITIVE {
            return Err(veni_light::Error::invalid(format!(
                "a radiance of {:e} is below {:.1e}, the smallest number with all its bits: the exposure is too low",
                self.low,
                f32::MIN_POSITIVE
            )));
        }
        if self.high > MOST {
            return Err(veni_light::Error::invalid(format!(
                "a radiance of {:.1e} is beyond {MOST:.1e}: the exposure is too high",
                self.high
            )));
        }
        Ok(())
    }

    /// The value that half precision does not keep, if there is one.
    fn beyond_half(self) -> Option<f32> {
        let [least, most] = HALF_RANGE;
        [self.high].into_iter().find(|v| *v > most).or(Some(self.low).filter(|v| *v < least))
    }
}

fn has_exr(files: &[(PathBuf, WriteOptions)]) -> bool {
    files.iter().any(|(_, options)| matches!(options.format, WriteFormat::Exr(_)))
}
