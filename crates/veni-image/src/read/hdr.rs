//! Radiance `.hdr` (RGBE) through the `image` crate.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use image::codecs::hdr::{HdrDecoder, HdrMetadata};
use image::{ImageDecoder, ImageError};

use super::ReadOptions;
use crate::numbered::join;
use crate::panorama::Panorama;
use crate::{Error, Result};

pub(super) fn read(file: impl Read, path: &Path, strict: bool, options: &ReadOptions) -> Result<Panorama> {
    let (decoder, header) = open(file, path, strict)?;
    let grid = options.check(header.width as usize, header.height as usize)?;
    let exposure = header.exposure.unwrap_or(1.0);
    if !(exposure > 0.0 && exposure.is_finite()) {
        return Err(Error::invalid(format!("EXPOSURE={exposure} in the header; it must be positive")));
    }
    let mut pixels = vec![[0f32; 3]; grid.len()];
    decoder.read_image(bytemuck::cast_slice_mut(&mut pixels)).map_err(|e| wrap(e, path))?;
    let mut panorama = Panorama::new(grid, pixels);
    panorama.attributes = text(&header);
    panorama.note_provenance();
    if exposure != 1.0 {
        panorama.scale(1.0 / exposure);
    }
    Ok(panorama)
}

pub(super) fn attributes(file: impl Read, path: &Path, strict: bool) -> Result<BTreeMap<String, String>> {
    open(file, path, strict).map(|(_, header)| text(&header))
}

fn open<R: Read>(file: R, path: &Path, strict: bool) -> Result<(HdrDecoder<R>, HdrMetadata)> {
    // a signature other than "#?RADIANCE" ("#?RGBE" is common) is only let through in the lenient mode
    let decoder = HdrDecoder::with_strictness(file, strict).map_err(|e| wrap(e, path))?;
    let header = decoder.metadata();
    if header
        .custom_attributes
        .iter()
        .any(|(name, value)| name == "FORMAT" && value.trim() == "32-bit_rle_xyze")
    {
        return Err(Error::unsupported(
            "XYZ-coded Radiance images are not read; convert it to 32-bit_rle_rgbe",
        ));
    }
    Ok((decoder, header))
}

fn text(header: &HdrMetadata) -> BTreeMap<String, String> {
    join(header.custom_attributes.iter().filter(|(name, _)| !name.is_empty()).cloned().collect())
}

fn wrap(error: ImageError, path: &Path) -> Error {
    match error {
        ImageError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
            Error::invalid("truncated Radiance .hdr file")
        }
        ImageError::IoError(e) => Error::io(path, "read", e),
        ImageError::Unsupported(e) => Error::unsupported(format!("Radiance .hdr: {e}")),
        other => Error::invalid(format!("damaged Radiance .hdr file: {other}")),
    }
}
