//! A panorama from a file, clean.

use std::path::Path;

use anyhow::{Result, bail};
use veni_image::Panorama;

use crate::args::Layer;
use crate::output::with_remedy;
use crate::report::Report;

/// A panorama with every value finite, none negative, and nothing unknown; says what was replaced, and what the file says besides.
pub(crate) fn panorama(path: &Path, layer: &Layer, report: Report) -> Result<Panorama> {
    let mut panorama = Panorama::read_with(path, &layer.options()).map_err(with_remedy)?;
    notes(path, panorama.notes(), report);
    if panorama.unknown() >= 1.0 {
        bail!(
            "{}: all of it is unknown (transparent, or outside of what the file holds); store it opaque, and within its display window",
            path.display()
        );
    }
    let unknown = 100.0 * panorama.fill();
    if unknown > 0.0 {
        report.note(format_args!(
            "{}: {unknown:.1} % of it are unknown (transparent, or outside of what the file holds) and were filled from their \
             surroundings",
            path.display()
        ));
    }
    let bad = panorama.sanitise().map_err(|e| e.in_file(path))?;
    notes(path, &bad.notes(), report);
    Ok(panorama)
}

/// What a file says of itself.
pub(crate) fn notes(path: &Path, notes: &[String], report: Report) {
    for note in notes {
        report.note(format_args!("{}: {note}", path.display()));
    }
}
