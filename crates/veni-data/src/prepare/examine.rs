//! One file: read, expanded if it must be, checked, resampled.

use std::path::Path;
use std::sync::Arc;

use super::Fingerprint;
use crate::expand::network::{Estimate, ExpansionNetwork, NetworkOptions};
use crate::expand::{Expand, ExpandOptions, Sun};
use crate::whole::{refuse_holes, whole};
use crate::{Error, Result};
use veni_image::limits::{EXAMINE_BYTES_PER_PIXEL, READ_BYTES_PER_PIXEL};
use veni_image::tonemap::quantile;
use veni_image::{Content, LdrPanorama, Panorama, ReadOptions, Sanitised, luminance, memory};
use veni_light::sphere::Equirect;

/// More pixels than this that are not numbers, and a file counts as broken.
const BROKEN: f64 = 0.05;
/// More black pixels than this, and there is not enough left.
const BLACK: f64 = 0.5;
/// Less between the darkest and the brightest value, as a factor, and there is nothing to see.
const CONSTANT: f32 = 1.01;

/// What is asked of a panorama.
#[derive(Clone, Debug)]
pub struct PrepareConfig {
    /// The size it is brought to; it must be at least as large.
    pub grid: Equirect,
    /// How LDR panoramas are expanded; without, they are refused.
    pub expand: Option<Expander>,
    /// Limits of what is read.
    pub read: ReadOptions,
}

/// What makes radiance from the values of LDR panoramas.
#[derive(Clone, Debug)]
pub enum Expander {
    /// The fitted functions of [`panorama::expand`](crate::expand).
    Fitted(ExpandOptions),
    /// A network.
    Network(Arc<dyn ExpansionNetwork>, NetworkOptions),
}

/// How an LDR panorama was expanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expansion {
    /// Share of the sphere that was clipped in at least one channel, 0 to 1.
    pub clipped: f64,
    /// The sun that was added, if any; networks add none.
    pub sun: Option<Sun>,
    /// How the network did, if one was run.
    pub estimate: Option<Estimate>,
}

/// A panorama that is fit for training.
#[derive(Clone, Debug)]
pub struct Examined {
    /// Finite radiance at the size asked for, nowhere negative.
    pub panorama: Panorama,
    /// The size of the file.
    pub size: Equirect,
    /// What it looks like.
    pub fingerprint: Fingerprint,
    /// Values of the file that were replaced.
    pub replaced: Sanitised,
    /// Stops from the median luminance to the brightest, at the file's size.
    pub stops: f32,
    /// What was done to an LDR file.
    pub expanded: Option<Expansion>,
    /// What the file says that is not applied, or is worth knowing.
    pub notes: Vec<String>,
}

/// Reads, checks and resamples a panorama: OpenEXR, Radiance, or an LDR format that is expanded.
///
/// # Errors
/// Why the file is not fit: those of [`Panorama::read_with`] and [`LdrPanorama::read_with`]; [`Error::Invalid`]
/// if it is smaller than asked, more than half black, has more than 5 % pixels that are not numbers or more than 1 %
/// unknown ones (transparent, or outside of what the file holds), or one value throughout; [`Error::Unsupported`] for LDR files without `expand`; those of
/// [`LdrPanorama::expand_by`].
pub fn examine(path: &Path, config: &PrepareConfig) -> Result<Examined> {
    let (mut panorama, expanded) = read(path, config)?;
    let mut examined = || -> Result<Examined> {
        let size = panorama.grid();
        let Equirect { width, height } = config.grid;
        if size.width < width {
            return Err(Error::invalid(format!(
                "{} × {} pixels are fewer than the {width} × {height} asked for",
                size.width, size.height
            )));
        }
        check_values(&panorama)?;
        let replaced = panorama.sanitise()?;
        let luminances: Vec<f32> = panorama.pixels().iter().map(|p| luminance(*p)).collect();
        let (low, high) = luminances.iter().fold((f32::INFINITY, 0f32), |(l, h), v| (l.min(*v), h.max(*v)));
        if high < CONSTANT * low {
            return Err(Error::invalid("has the same value everywhere: there is no light to learn from"));
        }
        let stops = (high / quantile(&luminances, 0.5).max(f32::MIN_POSITIVE)).log2();
        let fingerprint = Fingerprint::new(&panorama);
        Ok(Examined {
            panorama: panorama.resample(config.grid),
            size,
            fingerprint,
            replaced,
            stops,
            expanded,
            notes: [panorama.notes(), &replaced.notes()].concat(),
        })
    };
    examined().map_err(|e| e.in_file(path))
}

fn read(path: &Path, config: &PrepareConfig) -> Result<(Panorama, Option<Expansion>)> {
    let ldr = match Content::read(path, &config.read)? {
        Content::Radiance(mut panorama) => {
            whole(&mut panorama).map_err(|e| e.in_file(path))?;
            return Ok((panorama, None));
        }
        Content::Display(ldr) => ldr,
    };
    let expanded = || -> Result<_> {
        let Some(expander) = &config.expand else {
            return Err(Error::unsupported("holds no high dynamic range, and expansion is switched off"));
        };
        refuse_holes(ldr.unknown())?;
        let (mut panorama, expansion) = expander.expand(&ldr)?;
        panorama.fill();
        Ok((panorama, Some(expansion)))
    };
    expanded().map_err(|e| e.in_file(path))
}

impl Expander {
    fn expand(&self, ldr: &LdrPanorama) -> Result<(Panorama, Expansion)> {
        // on top of what the display values take
        memory::check(ldr.grid().len() as u64 * (EXAMINE_BYTES_PER_PIXEL - READ_BYTES_PER_PIXEL))?;
        match self {
            Self::Fitted(options) => {
                let done = ldr.expand(options);
                Ok((done.panorama, Expansion { clipped: done.clipped, sun: done.sun, estimate: None }))
            }
            Self::Network(network, options) => {
                let done = ldr.expand_by(network.as_ref(), options)?;
                let expansion = Expansion { clipped: done.clipped, sun: None, estimate: done.estimate };
                Ok((done.panorama, expansion))
            }
        }
    }
}

/// Refuses what [`Panorama::sanitise`] would paint over, but only by inventing too much.
fn check_values(panorama: &Panorama) -> Result<()> {
    let count = panorama.pixels().len() as f64;
    let share =
        |f: &dyn Fn(&[f32; 3]) -> bool| panorama.pixels().iter().filter(|p| f(p)).count() as f64 / count;
    let negative = -panorama.unit();
    let broken = share(&|p| p.iter().any(|v| !v.is_finite() || *v < negative));
    if broken > BROKEN {
        return Err(Error::invalid(format!(
            "{:.0} % of its pixels are not numbers, infinite or negative",
            100.0 * broken
        )));
    }
    let black = share(&|p| p.iter().all(|v| *v <= 0.0));
    if black > BLACK {
        return Err(Error::invalid(format!("{:.0} % of its pixels are black", 100.0 * black)));
    }
    Ok(())
}
