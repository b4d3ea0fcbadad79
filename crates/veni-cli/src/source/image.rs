//! A panorama from a file, clean.

use std::path::Path;

use anyhow::Result;
use veni_image::{Panorama, Provenance, RADIANCE_SCALE};

use crate::output::with_remedy;
use crate::report::Report;

/// A panorama with every value positive and finite; says what was replaced, and which factor was not believed.
pub(crate) fn panorama(path: &Path, report: Report) -> Result<Panorama> {
    let mut panorama = Panorama::read(path).map_err(with_remedy)?;
    if let Some(remark) = stale_scale(&panorama) {
        report.note(format_args!("{}: {remark}", path.display()));
    }
    let bad = panorama.sanitise().map_err(|e| e.in_file(path))?;
    if bad.nan + bad.infinite > 0 {
        report.note(format_args!(
            "{}: {} values that are not a number and {} infinite ones were replaced",
            path.display(),
            bad.nan,
            bad.infinite
        ));
    }
    Ok(panorama)
}

/// What to say of a file that records a factor for pixels that it no longer has.
pub(crate) fn stale_scale(panorama: &Panorama) -> Option<String> {
    let factor = panorama.attributes().get(RADIANCE_SCALE)?;
    (panorama.provenance() == Provenance::Changed).then(|| {
        format!(
            "its pixels were changed after {RADIANCE_SCALE} = {factor} was written; they are taken as they are, not divided \
             by it"
        )
    })
}
