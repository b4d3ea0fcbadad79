//! How every PNG file of this crate begins.

use std::io::Write;

use crate::{Error, Result};

/// An encoder of a picture of 8-bit channels, `[width, height]` pixels. RGB says that it is sRGB; what has alpha here holds
/// numbers, not colours.
///
/// # Errors
/// [`Error::Invalid`] if a side is too long for PNG.
pub(crate) fn encoder<'a, W: Write>(
    out: W,
    size: [usize; 2],
    colour: png::ColorType,
) -> Result<png::Encoder<'a, W>> {
    let side =
        |n: usize| u32::try_from(n).map_err(|_| Error::invalid(format!("{n} is too long a side for PNG")));
    let mut encoder = png::Encoder::new(out, side(size[0])?, side(size[1])?);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Eight);
    if colour == png::ColorType::Rgb {
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    }
    Ok(encoder)
}
