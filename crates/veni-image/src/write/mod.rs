//! Writing: whole panoramas, or rows as they are computed so that memory stays bounded at any size.
//! Every file is written beside its target, synced and renamed ([`veni_light::output`]).

mod exr;
mod half_range;
mod hdr;
mod png;

use std::collections::BTreeMap;
use std::path::Path;

use super::tonemap::Tonemap;
use crate::numbered;
use crate::panorama::Panorama;
use crate::provenance::{PIXEL_DIGEST, PixelDigest};
use crate::{Error, Result};
use veni_light::output::{Overwrite, write_atomic};
use veni_light::sphere::Equirect;

/// Name of the attribute in which an EXR file records the factor that its values were multiplied by to fit
/// half precision; [`Panorama::read`] divides by it again.
pub const RADIANCE_SCALE: &str = "veni:radianceScale";

pub use half_range::{HALF_ERROR, HALF_RANGE, HalfRange, half_error};

/// The `software` that written files name.
const SOFTWARE: &str = concat!("veni ", env!("CARGO_PKG_VERSION"));

/// Attributes whose values are written already.
const RESERVED: [&str; 3] = [RADIANCE_SCALE, PIXEL_DIGEST, exr::COLOUR_SPACE];

/// The attributes of `options` in parts of at most `limit(name)` bytes, and where there are any, or `factor` changes the
/// values, a place for the digest of the pixels.
fn texts(
    options: &WriteOptions,
    factor: f32,
    limit: impl Fn(&str) -> usize,
) -> Result<Vec<(String, String)>> {
    let mut all = options.attributes.clone();
    if let Some(name) = all.keys().find(|name| RESERVED.contains(&name.as_str())) {
        return Err(Error::invalid(format!(
            "the attribute {name} is not free: it is written with what it says of the values"
        )));
    }
    if factor != 1.0 {
        all.insert(RADIANCE_SCALE.to_owned(), factor.to_string());
    }
    if !all.is_empty() {
        all.insert(PIXEL_DIGEST.to_owned(), PixelDigest::BLANK.to_owned());
    }
    numbered::split(&all, limit)
}

/// Bits of an EXR sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// 16-bit floats: 11 significant bits from 6.1e-5 to 65504, fewer below.
    #[default]
    Half,
    /// 32-bit floats.
    Float,
}

/// The format of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WriteFormat {
    /// OpenEXR: scan lines in increasing order, ZIP, Rec. 709 chromaticities. There is no `envmap`: by `latlong` OpenEXR
    /// means samples that lie on the edges of the image, ours are at the centres of pixels.
    Exr(Precision),
    /// Radiance RGBE with run-length coding: 8 significant bits, shared exponent.
    Hdr,
    /// 8-bit sRGB through a tone curve.
    Png(Tonemap),
}

impl WriteFormat {
    /// The format that a file name asks for: `.exr` (half precision), `.hdr`, or `.png` through `tonemap`.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for any other extension.
    pub fn of(path: impl AsRef<Path>, tonemap: Tonemap) -> Result<Self> {
        let path = path.as_ref();
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("exr") => Ok(Self::Exr(Precision::Half)),
            Some("hdr") => Ok(Self::Hdr),
            Some("png") => Ok(Self::Png(tonemap)),
            _ => Err(Error::unsupported("panoramas are written as .exr, .hdr or .png").in_file(path)),
        }
    }
}

/// How a file is written.
#[derive(Clone, Debug, PartialEq)]
pub struct WriteOptions {
    /// Its format.
    pub format: WriteFormat,
    /// Half-precision EXR only.
    pub half_range: HalfRange,
    /// Text attributes for EXR files, `NAME=value` header lines for `.hdr`, text chunks for PNG. Beside them EXR and
    /// `.hdr` files record a digest of the pixels ([`PIXEL_DIGEST`]). Long values take several attributes, numbered
    /// `NAME[1/3]`, since other software reads no more than 255 bytes of one and no lines of more than 127; reading puts
    /// them together.
    ///
    /// [`PIXEL_DIGEST`]: crate::PIXEL_DIGEST
    pub attributes: BTreeMap<String, String>,
    /// Whether an existing file may be replaced.
    pub overwrite: Overwrite,
    /// Whether the values are colours (linear Rec. 709, as an EXR file then says); otherwise they are numbers of another
    /// kind, such as normals.
    pub colour: bool,
}

impl WriteOptions {
    /// This format for a panorama; nothing out of range, no attributes, no overwriting.
    pub fn new(format: WriteFormat) -> Self {
        Self {
            format,
            half_range: HalfRange::Refuse,
            attributes: BTreeMap::new(),
            overwrite: Overwrite::Refuse,
            colour: true,
        }
    }
}

impl Panorama {
    /// Writes the file. The panorama's own [`Panorama::attributes`] are not written, only those of `options`.
    ///
    /// # Errors
    /// As [`write_rows`].
    pub fn write(&self, path: impl AsRef<Path>, options: &WriteOptions) -> Result<()> {
        let mut options = options.clone();
        if options.half_range == HalfRange::Fit {
            options.half_range = HalfRange::Factor(half_range::fit(&self.pixels));
        }
        write_rows(path, self.grid, &options, |sink| sink.push(&self.pixels))
    }
}

/// Takes the rows of an image from the top down.
#[expect(missing_debug_implementations, reason = "holds a closure")]
pub struct RowSink<'a> {
    grid: Equirect,
    row: usize,
    accept: &'a mut dyn FnMut(&[[f32; 3]]) -> Result<()>,
}

impl RowSink<'_> {
    /// The next row or rows, W pixels of linear radiance each.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a value that is not finite or that the format cannot hold; [`Error::Io`].
    ///
    /// # Panics
    /// If these are not whole rows, or more than the image has.
    pub fn push(&mut self, rows: &[[f32; 3]]) -> Result<()> {
        let Equirect { width, height } = self.grid;
        let count = rows.len() / width;
        assert!(
            rows.len() == count * width && self.row + count <= height,
            "{} pixels are not whole rows below row {} of a {width} × {height} image",
            rows.len(),
            self.row
        );
        if let Some(k) = rows.iter().position(|pixel| !pixel.iter().all(|v| v.is_finite())) {
            let (column, row) = (k % width, self.row + k / width);
            return Err(Error::invalid(format!(
                "pixel ({column}, {row}) is {:?}: only finite radiance is written",
                rows[k]
            )));
        }
        self.row += count;
        (self.accept)(rows)
    }
}

/// Writes an image whose rows `produce` pushes in order, holding only a few of them at a time.
///
/// # Errors
/// [`Error::Invalid`] if the file exists and may not be replaced, if a value does not fit the format or rows are
/// missing; whatever `produce` returns; [`Error::Io`]. After an error nothing is left at `path` that was not
/// there before.
pub fn write_rows(
    path: impl AsRef<Path>,
    grid: Equirect,
    options: &WriteOptions,
    produce: impl FnOnce(&mut RowSink<'_>) -> Result<()>,
) -> Result<()> {
    let path = path.as_ref();
    let run = |accept: &mut dyn FnMut(&[[f32; 3]]) -> Result<()>| {
        let mut sink = RowSink { grid, row: 0, accept };
        produce(&mut sink)?;
        if sink.row != grid.height {
            return Err(Error::invalid(format!("only {} of {} rows were produced", sink.row, grid.height)));
        }
        Ok(())
    };
    let result = write_atomic(path, options.overwrite, |file| match options.format {
        WriteFormat::Exr(precision) => exr::write(file, path, grid, precision, options, run),
        WriteFormat::Hdr => hdr::write(file, path, grid, options, run),
        WriteFormat::Png(tonemap) => png::write(file, path, grid, tonemap, options, run),
    });
    result.map_err(|e| match e {
        Error::Invalid { .. } => e.in_file(path),
        other => other,
    })
}

/// What a format's writer is handed: calls back with rows until the image is complete.
type Accept<'a> = &'a mut dyn FnMut(&[[f32; 3]]) -> Result<()>;
