//! What is fitted: picture files, what is known of them, and how a photograph was taken.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow};
use clap::Args;
use image::{DynamicImage, ImageFormat, ImageReader};
use veni_light::Error;
use veni_core::fit::{Observation, Picture};
use veni_image::tonemap::srgb_to_linear;
use veni_image::{Panorama, ReadOptions};
use veni_light::sphere::{Equirect, View};

use crate::report::Report;

/// An sRGB value from here on is taken for clipped.
const CLIPPED: f32 = 254.0 / 255.0;
/// Longest side at which a photograph is fitted, in pixels.
const LONGEST: usize = 96;

#[derive(Args, Debug)]
pub(crate) struct Input {
    /// OpenEXR, Radiance, PNG or JPEG files
    #[arg(required = true, value_name = "PICTURE")]
    pub(super) pictures: Vec<PathBuf>,

    /// PNG of the same size: white is known, black unknown
    #[arg(long, value_name = "MASK.png")]
    mask: Option<PathBuf>,

    /// The picture is a photograph with this field of view across its width
    #[arg(long, value_name = "DEGREES")]
    fov: Option<f64>,

    /// Where the photograph's centre looks: azimuth (counter-clockwise from the panorama's centre, seen from above),
    /// elevation, and how far the camera was turned clockwise [default: 0,0,0]
    #[arg(long, value_name = "AZIMUTH[,ELEVATION[,ROLL]]", value_parser = look, allow_hyphen_values = true,
        requires = "fov")]
    look: Option<Look>,
}

/// Three angles in degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Look([f64; 3]);

/// A picture as read.
pub(super) struct Read {
    pub(super) size: [usize; 2],
    pub(super) pixels: Vec<[f32; 3]>,
    pub(super) known: Option<Vec<f32>>,
    clip: Option<f32>,
}

impl Input {
    pub(super) fn view(&self) -> Option<View> {
        let [azimuth, elevation, roll] = self.look.unwrap_or_default().0.map(f64::to_radians);
        self.fov.map(|fov| View { fov: fov.to_radians(), azimuth, elevation, roll })
    }

    pub(super) fn mask(&self) -> Option<&Path> {
        self.mask.as_deref()
    }

    pub(super) fn read(&self, path: &Path, report: Report) -> Result<Read> {
        let mut read = match limited_range(path)? {
            Some(format) => Read::limited(path, format)?,
            None => Read::radiance(path)?,
        };
        if let Some(mask) = &self.mask {
            let known = read_mask(mask, read.size)?;
            read.known = Some(match read.known.take() {
                Some(alpha) => alpha.iter().zip(known).map(|(a, m)| a * m).collect(),
                None => known,
            });
        }
        let bad = read.pixels.iter().filter(|p| p.iter().any(|v| !v.is_finite())).count();
        if bad > 0 {
            report
                .note(format_args!("{}: {bad} pixels are not numbers and count as unknown", path.display()));
        }
        Ok(read)
    }

    pub(super) fn observe(&self, read: &Read, grid: Equirect) -> veni_light::Result<Observation> {
        let picture =
            Picture { size: read.size, pixels: &read.pixels, known: read.known.as_deref(), clip: read.clip };
        match self.view() {
            Some(view) => Observation::photograph(&picture, &view, LONGEST),
            None => Observation::panorama(&picture, grid),
        }
    }
}

impl Read {
    /// Whether some of its pixels are unknown.
    pub(super) fn is_partial(&self) -> bool {
        let hidden = self.known.as_ref().is_some_and(|known| known.iter().any(|k| *k < 1.0));
        hidden || self.pixels.iter().any(|p| p.iter().any(|v| !v.is_finite()))
    }

    fn radiance(path: &Path) -> Result<Self> {
        let options = ReadOptions { any_aspect: true, ..ReadOptions::default() };
        let image = Panorama::read_with(path, &options)?;
        let size = [image.grid().width, image.grid().height];
        let known = Panorama::read_alpha(path, &options)?.filter(|a| a.iter().any(|a| *a < 1.0));
        Ok(Self { size, pixels: image.pixels().to_vec(), known, clip: None })
    }

    fn limited(path: &Path, format: ImageFormat) -> Result<Self> {
        let image = decode(path, format)?;
        let size = [image.width() as usize, image.height() as usize];
        let alpha = image.color().has_alpha();
        let image = image.into_rgba16();
        let value = |v: u16| f32::from(v) / f32::from(u16::MAX);
        let pixels =
            image.pixels().map(|p| [p.0[0], p.0[1], p.0[2]].map(|v| srgb_to_linear(value(v)))).collect();
        let known = alpha.then(|| image.pixels().map(|p| value(p.0[3])).collect());
        Ok(Self { size, pixels, known, clip: Some(srgb_to_linear(CLIPPED)) })
    }
}

/// PNG or JPEG, by its first bytes.
fn limited_range(path: &Path) -> Result<Option<ImageFormat>> {
    let reader = ImageReader::open(path).map_err(|e| Error::io(path, "open", e))?;
    let reader = reader.with_guessed_format().map_err(|e| Error::io(path, "read", e))?;
    // the name says nothing: only what was recognised by content counts
    let format = reader.format().filter(|f| [ImageFormat::Png, ImageFormat::Jpeg].contains(f));
    let start = std::fs::File::open(path).and_then(|mut f| {
        let mut start = [0; 3];
        std::io::Read::read(&mut f, &mut start).map(|_| start)
    });
    let start = start.map_err(|e| Error::io(path, "read", e))?;
    Ok(format.filter(|_| start.starts_with(b"\x89PN") || start.starts_with(b"\xFF\xD8\xFF")))
}

fn decode(path: &Path, format: ImageFormat) -> Result<DynamicImage> {
    let file = std::fs::File::open(path).map_err(|e| Error::io(path, "open", e))?;
    // the reader's own limits refuse headers that claim more than half a gigabyte
    let reader = ImageReader::with_format(std::io::BufReader::new(file), format);
    reader.decode().map_err(|e| anyhow!("{}: {e}", path.display()))
}

/// Luma of a PNG.
fn read_mask(path: &Path, size: [usize; 2]) -> Result<Vec<f32>> {
    let format = limited_range(path)?.filter(|f| *f == ImageFormat::Png);
    let format = format.with_context(|| format!("{}: a mask is a PNG", path.display()))?;
    let image = decode(path, format)?.into_luma16();
    let found = [image.width() as usize, image.height() as usize];
    if found != size {
        return Err(anyhow!(
            "{}: the mask is {} x {}, the picture {} x {}: they must have one size",
            path.display(),
            found[0],
            found[1],
            size[0],
            size[1]
        ));
    }
    Ok(image.pixels().map(|p| f32::from(p.0[0]) / f32::from(u16::MAX)).collect())
}

fn look(text: &str) -> Result<Look, String> {
    let mut angles = [0.0; 3];
    let parts: Vec<_> = text.split(',').collect();
    if parts.len() > 3 {
        return Err("give at most three angles: azimuth,elevation,roll".to_owned());
    }
    for (angle, part) in angles.iter_mut().zip(parts) {
        *angle = match part.trim().parse::<f64>() {
            Ok(v) if v.is_finite() => v,
            _ => return Err(format!("'{part}' is no angle in degrees")),
        };
    }
    if angles[1].abs() > 90.0 {
        return Err(format!("an elevation of {}° is beyond the zenith: give -90 to 90", angles[1]));
    }
    Ok(Look(angles))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_are_one_to_three_angles() {
        assert_eq!(look("90"), Ok(Look([90.0, 0.0, 0.0])));
        assert_eq!(look("-30, 12.5,3"), Ok(Look([-30.0, 12.5, 3.0])));
        for wrong in ["", "a", "1,2,3,4", "0,91", "inf"] {
            assert!(look(wrong).is_err(), "{wrong}");
        }
    }
}
