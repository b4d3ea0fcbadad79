//! What is fitted: picture files, what is known of them, and how a photograph was taken.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use veni_fit::{Observation, unseen};
use veni_image::{Picture, ReadOptions, read_mask};
use veni_light::sphere::{Equirect, View};

use crate::args::Layer;
use crate::output::with_remedy;
use crate::piped;
use crate::report::Report;
use crate::source;

#[derive(Args, Debug)]
pub(crate) struct Input {
    /// OpenEXR, Radiance, PNG, JPEG or WebP files; - is standard input
    #[arg(required_unless_present_any = ["target_sh", "target_irradiance", "illuminance"], value_name = "PICTURE")]
    pub(super) pictures: Vec<PathBuf>,

    #[command(flatten)]
    layer: Layer,

    /// Picture of the same size: white is known, black or transparent unknown; - is standard input
    #[arg(long, value_name = "MASK", requires = "pictures")]
    mask: Option<PathBuf>,

    /// The picture is a photograph with this field of view across its width
    #[arg(long, value_name = "DEGREES", requires = "pictures")]
    fov: Option<f64>,

    /// Where the photograph's centre looks: azimuth (counter-clockwise from the panorama's centre, seen from above),
    /// elevation, and how far the camera was rotated clockwise [default: 0,0,0]
    #[arg(long, value_name = "AZIMUTH[,ELEVATION[,ROLL]]", value_parser = look, allow_hyphen_values = true,
        requires = "fov")]
    look: Option<Look>,
}

/// Three angles in degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Look([f64; 3]);

impl Input {
    /// The mask is read with every picture.
    pub(super) fn keep(&mut self) -> Result<()> {
        self.mask = piped::input_if(self.mask.as_deref())?;
        Ok(())
    }

    pub(super) fn view(&self) -> Option<View> {
        let [azimuth, elevation, roll] = self.look.unwrap_or_default().0.map(f64::to_radians);
        self.fov.map(|fov| View { fov: fov.to_radians(), azimuth, elevation, roll })
    }

    pub(super) fn mask(&self) -> Option<&Path> {
        self.mask.as_deref()
    }

    pub(super) fn read(&self, path: &Path, report: Report) -> Result<Picture> {
        // a photograph is placed by --look, not by what it says of itself
        let options =
            ReadOptions { any_aspect: true, place_parts: self.fov.is_none(), ..self.layer.options() };
        let mut picture = Picture::read_with(path, &options).map_err(with_remedy)?;
        source::notes(path, picture.notes(), report);
        if let Some(path) = &self.mask {
            let (size, mask) = read_mask(path).map_err(with_remedy)?;
            if size != picture.size() {
                let [[w, h], [pw, ph]] = [size, picture.size()];
                bail!(
                    "{}: the mask is {w} x {h}, the picture {pw} x {ph}: they must have one size",
                    path.display()
                );
            }
            picture = picture.masked(&mask)?;
        }
        let bad = picture.not_finite();
        if bad > 0 {
            report
                .note(format_args!("{}: {bad} pixels are not numbers and count as unknown", path.display()));
        }
        let negative = picture.pixels().as_flattened().iter().filter(|v| v.is_finite() && **v < 0.0).count();
        if negative > 0 {
            report.note(format_args!("{}: {negative} negative values count as black", path.display()));
        }
        Ok(picture)
    }

    pub(super) fn observe(&self, picture: &Picture, grid: Equirect) -> veni_light::Result<Observation> {
        match self.view() {
            Some(view) => Observation::photograph(picture, &view, unseen::LONGEST),
            None => Observation::panorama(picture, grid),
        }
    }
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
            _ => return Err(format!("'{part}' is not an angle in degrees")),
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
