//! What display values mean: of all that a PNG, JPEG or WebP file may say, what goes before what.

use super::exif::{self, ColourSpace};
use super::meaning::{Curve, Meaning};
use super::{icc, spaces};
use crate::colour::{ADOBE_RGB, Primaries};
use crate::{Error, Result};

/// All that may be said, as it is stored.
#[derive(Clone, Debug, Default)]
pub(super) struct Tags {
    /// PNG: primaries and transfer characteristics of H.273.
    pub(super) cicp: Option<[u8; 2]>,
    pub(super) icc: Option<Vec<u8>>,
    /// PNG, JPEG: there is a profile, be it one that cannot be inflated or put together.
    pub(super) has_profile: bool,
    /// PNG: the sRGB chunk.
    pub(super) srgb: bool,
    /// PNG: the exponent from light to stored values, 1/2.2 for a display of 2.2.
    pub(super) gamma: Option<f64>,
    /// PNG: (x, y) of red, green, blue, white.
    pub(super) chromaticities: Option<[[f64; 2]; 4]>,
    pub(super) exif: Option<Vec<u8>>,
    /// All packets of XMP.
    pub(super) packets: Vec<String>,
    /// What the reader noticed.
    pub(super) notes: Vec<String>,
}

/// Adobe RGB's exponent, 2 + 51/256.
const ADOBE_GAMMA: f32 = 563.0 / 256.0;
/// gAMA of 1/2.2, which the specification writes as 45455, stands for sRGB (PNG, 12.1 and 13.13).
const SRGB_GAMMA: f64 = 0.454_55;

/// cICP goes before the profile, that before sRGB, and that before gAMA and cHRM (PNG, third edition, 4.3); without any of
/// them EXIF's colour space; without that sRGB.
///
/// # Errors
/// Those of the tag that counts.
pub(super) fn meaning(tags: &Tags) -> Result<Meaning> {
    let mut meaning = if let Some([primaries, transfer]) = tags.cicp {
        spaces::h273(primaries, transfer, "cICP chunk")?
    } else if let Some(profile) = &tags.icc {
        icc::meaning(profile)?
    } else if tags.has_profile {
        // the decoder passes over it, but the picture's colours are others than without
        return Err(Error::invalid(
            "damaged ICC profile: it cannot be inflated, or pieces of it are missing",
        ));
    } else if tags.srgb {
        Meaning::default()
    } else if tags.gamma.is_some() || tags.chromaticities.is_some() {
        png(tags)?
    } else {
        exif(tags)?
    };
    meaning.notes.splice(0..0, tags.notes.iter().cloned());
    Ok(meaning)
}

fn png(tags: &Tags) -> Result<Meaning> {
    let mut meaning = Meaning::default();
    if let Some(gamma) = tags.gamma.filter(|gamma| (gamma - SRGB_GAMMA).abs() > 1e-3) {
        meaning.curve =
            if (gamma - 1.0).abs() < 1e-3 { Curve::Linear } else { Curve::Power((1.0 / gamma) as f32) };
    }
    if let Some(pairs) = tags.chromaticities {
        meaning.primaries(Primaries(pairs), "cHRM chunk")?;
    }
    Ok(meaning)
}

fn exif(tags: &Tags) -> Result<Meaning> {
    let mut meaning = Meaning::default();
    match tags.exif.as_deref().map(exif::colour_space) {
        Some(ColourSpace::AdobeRgb) => {
            meaning.curve = Curve::Power(ADOBE_GAMMA);
            meaning.primaries(ADOBE_RGB, "EXIF")?;
        }
        Some(ColourSpace::Uncalibrated) => {
            meaning
                .note("its EXIF data say that it is not sRGB, but nothing says what it is: taken for sRGB");
        }
        Some(ColourSpace::Both) => {
            meaning
                .note("its EXIF data say sRGB in one place and Adobe RGB (R03) in another: taken for sRGB");
        }
        Some(ColourSpace::Srgb) | None => {}
    }
    Ok(meaning)
}
