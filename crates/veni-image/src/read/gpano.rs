//! Parts of panoramas (GPano XMP): where in the full sphere the pixels of a file lie.

use super::ReadOptions;
use super::xmp::{GPANO, Namespace};
use crate::{Error, Result};
use veni_light::sphere::Equirect;

/// What the file says of its place in the sphere.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Sphere {
    /// The part that the file holds, if not all.
    pub(super) crop: Option<Crop>,
    pub(super) notes: Vec<String>,
}

/// A part of a full panorama, in units of the file's own pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crop {
    full: [usize; 2],
    corner: [usize; 2],
}

impl Sphere {
    /// From a file's packets, for `size` pixels; nothing where they say nothing.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for other projections, [`Error::Invalid`] for a part that sticks out of its whole, or whose place is
    /// not given in numbers.
    pub(super) fn of(packets: &[String], size: [usize; 2]) -> Result<Self> {
        let Some(gpano) = Namespace::first(packets, GPANO) else { return Ok(Self::default()) };
        if let Some(projection) = gpano.text("ProjectionType")
            && !projection.eq_ignore_ascii_case("equirectangular")
        {
            return Err(Error::unsupported(format!(
                "its XMP says GPano:ProjectionType = {projection:?}; only equirectangular panoramas are read"
            )));
        }
        let mut notes = Vec::new();
        let angles = ["PosePitchDegrees", "PoseRollDegrees"].map(|name| gpano.number(name).unwrap_or(0.0));
        if angles.iter().any(|a| a.abs() > 0.5) {
            let [pitch, roll] = angles;
            notes.push(format!("its XMP says that the camera was tilted (GPano pitch {pitch}°, roll {roll}°); it is not levelled"));
        }
        let [width, height] = [gpano.pixels("FullPanoWidthPixels")?, gpano.pixels("FullPanoHeightPixels")?];
        let full = width.zip(height);
        let [width, height] =
            [gpano.pixels("CroppedAreaImageWidthPixels")?, gpano.pixels("CroppedAreaImageHeightPixels")?];
        let part = width.zip(height);
        let [left, top] = [gpano.pixels("CroppedAreaLeftPixels")?, gpano.pixels("CroppedAreaTopPixels")?];
        let corner = [left.unwrap_or(0.0), top.unwrap_or(0.0)];
        let sizes = full.zip(part).map(|(full, part)| [<[f64; 2]>::from(full), part.into()]);
        let Some([full, part]) = sizes.filter(|s| s.as_flattened().iter().all(|v| *v >= 1.0)) else {
            return Ok(Self { crop: None, notes });
        };
        if part == full {
            return Ok(Self { crop: None, notes });
        }
        // the file may have been scaled since
        let scaled = |value: f64, axis: usize| (value * size[axis] as f64 / part[axis]).round();
        let crop = [0, 1].map(|axis| [scaled(full[axis], axis), scaled(corner[axis], axis)]);
        let fits = (0..2).all(|axis| {
            let [full, corner] = crop[axis];
            corner >= 0.0 && corner + size[axis] as f64 <= full && full < 4e9
        });
        if !fits {
            let [[fw, left], [fh, top]] = crop;
            return Err(Error::invalid(format!(
                "its XMP (GPano) places {} × {} pixels at ({left}, {top}) of a panorama of {fw} × {fh}, where they do not fit",
                size[0], size[1]
            )));
        }
        let crop = Crop {
            full: crop.map(|[full, _]| full as usize),
            corner: crop.map(|[_, corner]| corner as usize),
        };
        Ok(Self { crop: Some(crop), notes })
    }
}

impl Namespace<'_> {
    /// A count of pixels, if it is there.
    fn pixels(&self, name: &str) -> Result<Option<f64>> {
        let Some(text) = self.text(name).filter(|text| !text.is_empty()) else { return Ok(None) };
        let number = self.number(name).ok_or_else(|| {
            Error::invalid(format!("its XMP says GPano:{name} = {text:?}, which is not a number"))
        })?;
        Ok(Some(number))
    }
}

impl Crop {
    /// The grid of the full sphere.
    pub(super) fn grid(self, options: &ReadOptions) -> Result<Equirect> {
        let [width, height] = self.full;
        let context =
            |e: Error| Error::invalid(format!("the whole of which its XMP (GPano) says it is a part: {e}"));
        options.check(width, height).map_err(context)
    }

    /// Values of a grid of `size` placed among `elsewhere`.
    pub(super) fn place<T: Copy>(self, size: [usize; 2], values: &[T], elsewhere: T) -> Vec<T> {
        let mut all = vec![elsewhere; self.full[0] * self.full[1]];
        for (row, source) in values.chunks_exact(size[0]).enumerate() {
            let start = (self.corner[1] + row) * self.full[0] + self.corner[0];
            all[start..start + size[0]].copy_from_slice(source);
        }
        all
    }

    /// For messages.
    pub(super) fn describe(self) -> String {
        let [[width, height], [left, top]] = [self.full, self.corner];
        format!("a part, at ({left}, {top}), of a panorama of {width} × {height}")
    }
}
