//! A panorama from a file, clean.

use std::path::Path;

use anyhow::{Result, anyhow};
use veni_core::Error;
use veni_core::panorama::{LdrPanorama, Panorama};

use crate::report::Report;

/// A panorama with every value positive and finite; says what was replaced.
pub(crate) fn panorama(path: &Path, report: Report) -> Result<Panorama> {
    let mut panorama = Panorama::read(path).map_err(|e| expandable(path, e))?;
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

/// Says of an image with a display's range, which the library refuses, what makes a panorama of it.
pub(crate) fn expandable(path: &Path, error: Error) -> anyhow::Error {
    match error {
        Error::Unsupported(_) if LdrPanorama::recognise(path).unwrap_or(false) => {
            anyhow!("{error}, as 'veni-cli prepare' does")
        }
        error => error.into(),
    }
}
