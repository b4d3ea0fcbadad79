//! Colour spaces by name: the identifiers of the Color Interop Forum, and the code points of ITU-T H.273.

use super::meaning::{Curve, Meaning};
use crate::colour::{ADOBE_RGB, AP0, AP1, P3_D65, Primaries, REC709, REC2020, XYZ};
use crate::{Error, Result};

/// A colour space that a file names: `lin_ap1_scene` is linear light with the primaries of ACEScg.
pub(super) struct Named {
    pub(super) curve: Curve,
    pub(super) primaries: Primaries,
}

/// An identifier of the Color Interop Forum (2025): curve, primaries and image state between underscores; nothing if it is none.
pub(super) fn interop(id: &str) -> Option<Named> {
    let mut words = id.split('_');
    let (curve, primaries, state) = (words.next()?, words.next()?, words.next()?);
    if words.next().is_some() || !["scene", "display"].contains(&state) {
        return None;
    }
    let curve = match curve {
        "lin" => Curve::Linear,
        "srgb" | "srgbe" => Curve::Srgb,
        "pq" => Curve::Pq,
        "hlg" => Curve::Hlg,
        power => {
            Curve::Power(power.strip_prefix('g')?.parse::<u8>().ok().filter(|g| *g >= 10)? as f32 / 10.0)
        }
    };
    let primaries = match primaries {
        "rec709" => REC709,
        "rec2020" => REC2020,
        "p3d65" => P3_D65,
        "adobergb" => ADOBE_RGB,
        "ap0" => AP0,
        "ap1" => AP1,
        "ciexyzd65" | "xyzd65" => XYZ,
        _ => return None,
    };
    Some(Named { curve, primaries })
}

/// The meaning of display values by code points of H.273: primaries (table 2) and transfer characteristics (table 3).
///
/// # Errors
/// [`Error::Unsupported`] with the code point for what is not read; `tag` is what says so.
pub(super) fn h273(primaries: u8, transfer: u8, tag: &str) -> Result<Meaning> {
    let curve = match transfer {
        // BT.709, unspecified, BT.601, sRGB, BT.2020: curves so close that all of them are taken for sRGB
        1 | 2 | 6 | 13..=15 => Curve::Srgb,
        4 => Curve::Power(2.2),
        5 => Curve::Power(2.8),
        8 => Curve::Linear,
        16 => Curve::Pq,
        18 => Curve::Hlg,
        other => {
            return Err(Error::unsupported(format!(
                "{tag}: values in transfer characteristic {other} of H.273 are not read; convert it to EXR"
            )));
        }
    };
    let primaries = match primaries {
        1 | 2 => REC709,
        5 => Primaries([[0.64, 0.33], [0.29, 0.60], [0.15, 0.06], [0.3127, 0.3290]]),
        6 | 7 => Primaries([[0.630, 0.340], [0.310, 0.595], [0.155, 0.070], [0.3127, 0.3290]]),
        9 => REC2020,
        10 => XYZ,
        11 => Primaries([[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], [0.314, 0.351]]),
        12 => P3_D65,
        other => {
            return Err(Error::unsupported(format!(
                "{tag}: colour primaries {other} of H.273 are not read; convert it to Rec. 709"
            )));
        }
    };
    let mut meaning = Meaning { curve, ..Meaning::default() };
    meaning.primaries(primaries, tag)?;
    Ok(meaning)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_curve_primaries_and_state() {
        let curve = |id: &str| interop(id).map(|n| n.curve);
        assert_eq!(curve("lin_ap1_scene"), Some(Curve::Linear));
        assert_eq!(curve("srgb_rec709_scene"), Some(Curve::Srgb));
        assert_eq!(curve("g22_adobergb_scene"), Some(Curve::Power(2.2)));
        assert_eq!(curve("pq_rec2020_display"), Some(Curve::Pq));
        for wrong in [
            "data",
            "unknown",
            "lin_ap1",
            "lin_ap9_scene",
            "acescct_ap1_scene",
            "lin_ap1_scene_x",
            "g_rec709_scene",
            "",
        ] {
            assert!(curve(wrong).is_none(), "{wrong}");
        }
    }
}
