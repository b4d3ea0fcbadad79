//! A panorama from a file, clean.

use std::path::Path;

use anyhow::Result;
use veni_image::Panorama;

use crate::output::with_remedy;
use crate::report::Report;

/// A panorama with every value positive and finite; says what was replaced.
pub(crate) fn panorama(path: &Path, report: Report) -> Result<Panorama> {
    let mut panorama = Panorama::read(path).map_err(with_remedy)?;
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
