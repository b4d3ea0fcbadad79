//! ICC profiles (ICC.1:2022) of display values: three curves and a matrix, or the curve of grey, read by moxcms.

use std::sync::Arc;

use moxcms::TransferCharacteristics as Transfer;
use moxcms::{ColorProfile, DataColorSpace, ParsingOptions, ProfileText, ToneReprCurve};

use super::meaning::{Curve, Meaning};
use super::spaces::h273;
use crate::colour::icc_to_rec709;
use crate::tonemap::srgb_to_linear;
use crate::{Error, Result};

/// Entries of a tabulated curve: every value of 8 and of 16 bits is one.
const ENTRIES: usize = 1 << 16;
/// Curves closer than this to sRGB's are that: profiles store it in tables of 16 bits.
const SAME: f32 = 2e-3;
/// Profiles are a few hundred bytes to some megabytes (printers).
const LARGEST: usize = 1 << 24;

/// What an embedded profile says of red, green and blue; grey values are all three.
///
/// # Errors
/// [`Error::Unsupported`] by the profile's name for RGB profiles without matrix and curves, or with tables, which go before them;
/// [`Error::Invalid`] for damaged ones.
pub(super) fn meaning(profile: &[u8]) -> Result<Meaning> {
    let has_tables = has_tables(profile);
    let options = ParsingOptions { max_profile_size: LARGEST, ..ParsingOptions::default() };
    let profile = ColorProfile::new_from_slice_with_options(profile, options)
        .map_err(|e| Error::invalid(format!("damaged ICC profile: {e}")))?;
    let name = name(&profile);
    // curves and matrix say the same where they can, and there are writers whose code points are wrong
    let plain = profile.red_trc.is_some() || profile.gray_trc.is_some();
    if let Some(cicp) = profile.cicp
        && (!plain || matches!(cicp.transfer_characteristics, Transfer::Smpte2084 | Transfer::Hlg))
    {
        let (primaries, transfer) = (cicp.color_primaries as u8, cicp.transfer_characteristics as u8);
        return h273(primaries, transfer, &format!("ICC profile {name:?}"));
    }
    let unsupported = |what: &str| {
        Err(Error::unsupported(format!(
            "its ICC profile {name:?} {what}; only curves with a matrix are applied: convert the picture to sRGB first"
        )))
    };
    let (curves, matrix) = match profile.color_space {
        DataColorSpace::Gray | DataColorSpace::Rgb if has_tables => {
            return unsupported("maps colours by tables");
        }
        DataColorSpace::Gray => match &profile.gray_trc {
            Some(curve) => ([curve, curve, curve], None),
            None => return unsupported("has no grey curve"),
        },
        DataColorSpace::Rgb => {
            let curves = (&profile.red_trc, &profile.green_trc, &profile.blue_trc);
            let columns = profile.colorant_matrix().v;
            let (Some(r), Some(g), Some(b)) = curves else { return unsupported("maps colours by tables") };
            match icc_to_rec709(columns) {
                Some(matrix) => ([r, g, b], matrix),
                None => return unsupported("spans no colour space"),
            }
        }
        DataColorSpace::Cmyk => {
            // decoders give red, green and blue by the plain formula
            let mut meaning = Meaning::default();
            meaning.note(format!(
                "its CMYK profile {name:?} is not applied: colours are (1 - ink) x (1 - black), taken for sRGB"
            ));
            return Ok(meaning);
        }
        other => return unsupported(&format!("is for {other:?} values")),
    };
    let (curve, high) = curve(curves, &name)?;
    let mut meaning = Meaning { curve, matrix, ..Meaning::default() };
    if let Some(high) = high {
        meaning.note(format!(
            "its ICC profile {name:?} has the curve of {high} without code points (cicp) that say so: its largest value is taken for a display's white"
        ));
    }
    Ok(meaning)
}

/// Whether there are tables to the connection space (ICC.1:2022, 8.3.2 and 8.4.2 put them before curves and matrix).
fn has_tables(profile: &[u8]) -> bool {
    let names = profile.get(132..).unwrap_or_default().as_chunks::<12>().0;
    let count = profile.get(128..132).and_then(|n| n.first_chunk()).map_or(0, |n| u32::from_be_bytes(*n));
    let count = usize::try_from(count).map_or(names.len(), |count| count.min(names.len()));
    names[..count].iter().any(|tag| matches!(tag, [b'A' | b'D', b'2', b'B', b'0'..=b'3', ..]))
}

/// One curve for three channels, by its short name where it has one; and which curve of high dynamic range it is.
fn curve(curves: [&ToneReprCurve; 3], name: &str) -> Result<(Curve, Option<&'static str>)> {
    let mut tables = [const { Vec::new() }; 3];
    for (table, curve) in tables.iter_mut().zip(curves) {
        let broken = || Error::invalid(format!("damaged ICC profile {name:?}: a curve without values"));
        if matches!(curve, ToneReprCurve::Parametric(parameters) if parameters.is_empty()) {
            return Err(broken());
        }
        let evaluate = curve.make_linear_evaluator().map_err(|_| broken())?;
        *table = (0..ENTRIES).map(|k| evaluate.evaluate_value(k as f32 / (ENTRIES - 1) as f32)).collect();
        if table.iter().any(|v| !v.is_finite()) {
            return Err(broken());
        }
    }
    let follows = |curve: fn(f32) -> f32| {
        let step = (ENTRIES - 1) as f32;
        let mut all = tables.iter().flat_map(|table| table.iter().enumerate());
        all.all(|(k, v)| (v - curve(k as f32 / step)).abs() < SAME)
    };
    if follows(srgb_to_linear) {
        return Ok((Curve::Srgb, None));
    }
    if follows(|v| v) {
        return Ok((Curve::Linear, None));
    }
    let high = if follows(|v| Curve::Pq.linear(0, v) / Curve::Pq.linear(0, 1.0)) {
        Some("PQ")
    } else if follows(|v| Curve::Hlg.linear(0, v) / Curve::Hlg.linear(0, 1.0)) {
        Some("HLG")
    } else {
        None
    };
    Ok((Curve::Table(Arc::new(tables)), high))
}

fn name(profile: &ColorProfile) -> String {
    let text = match &profile.description {
        Some(ProfileText::PlainString(text)) => Some(text.clone()),
        Some(ProfileText::Localizable(all)) => all.first().map(|one| one.value.clone()),
        Some(ProfileText::Description(text)) => Some(text.ascii_string.clone()),
        _ => None,
    };
    let text = text.unwrap_or_default();
    let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0');
    if text.is_empty() { "without a name".to_owned() } else { text.chars().take(80).collect() }
}
