//! What an EXR header says of its numbers.

use std::collections::BTreeMap;

use exr::meta::attribute::AttributeValue;
use exr::meta::header::Header;

use super::super::meaning::{Curve, Meaning};
use super::super::spaces::interop;
use crate::colour::{AP0, Primaries};
use crate::{Error, Result};

/// Curve and primaries by `colorInteropID`; primaries by `chromaticities` before that, and by `acesImageContainerFlag` after.
/// One channel for all three has no primaries.
pub(super) fn meaning(header: &Header, text: &BTreeMap<String, String>, coloured: bool) -> Result<Meaning> {
    let mut meaning = Meaning::linear();
    let chromaticities = header
        .shared_attributes
        .chromaticities
        .map(|c| Primaries([c.red, c.green, c.blue, c.white].map(|v| [f64::from(v.0), f64::from(v.1)])));
    let unsaid = Primaries([[0.0; 2]; 4]);
    if chromaticities == Some(unsaid) {
        meaning.note("chromaticities are all 0, which is not a colour space: they are ignored");
    }
    let chromaticities = chromaticities.filter(|stated| *stated != unsaid);
    let mut primaries = chromaticities;
    if let Some(id) = text.get("colorInteropID").map(|id| id.trim()).filter(|id| !id.is_empty()) {
        match interop(id) {
            Some(named) => {
                meaning.curve = named.curve;
                primaries = primaries.or(Some(named.primaries));
                if let Some(stated) = chromaticities
                    && !stated.is_near(named.primaries)
                {
                    meaning.note(format!(
                        "colorInteropID = {id} and chromaticities disagree: the chromaticities are taken"
                    ));
                }
            }
            None if id == "data" => {
                return Err(Error::unsupported("colorInteropID = data: its values are not colours"));
            }
            None if id == "unknown" => {
                meaning.note(
                    "colorInteropID = unknown: taken for linear Rec. 709 unless chromaticities say otherwise",
                );
            }
            None => {
                return Err(Error::unsupported(format!(
                    "colorInteropID = {id:?} is not a colour space that is read; convert it to lin_rec709_scene"
                )));
            }
        }
    } else if let Some(space) = text.get("oiio:ColorSpace").map(|s| s.trim()) {
        other_name(space, &mut meaning, &mut primaries);
    }
    let others = header.shared_attributes.other.iter().chain(&header.own_attributes.other);
    for (name, value) in others {
        if name.as_slice() == b"acesImageContainerFlag" && *value == AttributeValue::I32(1) {
            primaries = primaries.or(Some(AP0));
        }
        if let (b"Orientation", AttributeValue::I32(at @ 2..=8)) = (name.as_slice(), value) {
            meaning.note(format!("Orientation = {at} is not applied: pixels are taken as they are stored"));
        }
    }
    if let Some(primaries) = primaries.filter(|_| coloured) {
        meaning.primaries(primaries, "chromaticities")?;
    }
    let aspect = header.shared_attributes.pixel_aspect;
    // zero and what is no number are said by programs that do not know it
    if aspect.is_finite() && aspect > 0.0 && aspect != 1.0 {
        meaning.note(format!("pixelAspectRatio = {aspect} is not applied: pixels are taken for square"));
    }
    let own = &header.own_attributes;
    if let Some(luminance) = own.white_luminance.filter(|v| *v > 0.0) {
        meaning.note(format!(
            "whiteLuminance = {luminance}: 1 stands for {luminance} cd/m²; values stay as stored"
        ));
    }
    if let Some(neutral) = own.adopted_neutral {
        meaning.note(format!(
            "adoptedNeutral = ({}, {}): what should look grey; colours are not balanced by it",
            neutral.0, neutral.1
        ));
    }
    Ok(meaning)
}

/// OpenImageIO's older attribute, whose names are those of somebody's configuration: those that everybody writes alike count.
fn other_name(space: &str, meaning: &mut Meaning, primaries: &mut Option<Primaries>) {
    match (space.to_ascii_lowercase().as_str(), interop(space)) {
        (_, Some(named)) => {
            meaning.curve = named.curve;
            *primaries = primaries.or(Some(named.primaries));
        }
        ("linear" | "scene_linear" | "lin_rec709" | "lin_srgb" | "", _) => {}
        ("acescg" | "lin_ap1", _) => *primaries = primaries.or(Some(crate::colour::AP1)),
        ("aces2065-1" | "lin_ap0", _) => *primaries = primaries.or(Some(AP0)),
        ("srgb" | "srgb_texture", _) => meaning.curve = Curve::Srgb,
        _ => meaning.note(format!("oiio:ColorSpace = {space:?} is not applied: values are taken for linear")),
    }
}
