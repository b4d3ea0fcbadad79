//! Panoramas to learn from are whole: what little is unknown is filled, more is refused.

use veni_image::Panorama;

use crate::{Error, Result};

/// More unknown pixels than this, and the panorama has holes.
const HOLES: f64 = 0.01;

/// # Errors
/// [`Error::Invalid`] if more of it than [`HOLES`] is unknown.
pub(crate) fn refuse_holes(unknown: f64) -> Result<()> {
    if unknown > HOLES {
        let percent = 100.0 * unknown;
        return Err(Error::invalid(format!(
            "{percent:.0} % of it are unknown (transparent, or outside of what the file holds): fill the holes first"
        )));
    }
    Ok(())
}

/// Fills small holes from their surroundings.
///
/// # Errors
/// As [`refuse_holes`].
pub(crate) fn whole(panorama: &mut Panorama) -> Result<()> {
    refuse_holes(panorama.unknown())?;
    panorama.fill();
    Ok(())
}
