//! Panoramas of the set whose sources are no longer there.

use std::collections::BTreeSet;
use std::path::Path;

use super::place::Placed;
use super::scan::Source;
use crate::report::Report;

/// The sources of kept images that are gone, as the user named them. What was not found is looked for under its own name:
/// an earlier run may have been given other folders.
pub(super) fn sources(placed: &Placed, found: &[Source]) -> Vec<String> {
    let there: BTreeSet<&str> = found.iter().map(|source| source.key.as_str()).collect();
    let records = placed.kept.iter().map(|kept| &kept.record);
    let gone = records.filter(|r| !there.contains(r.key.as_str()) && !Path::new(&r.key).exists());
    gone.map(|record| record.source.clone()).collect()
}

/// Says so, if there are any.
pub(super) fn note(gone: &[String], report: Report) {
    let (first, count) = (gone.first().map(String::as_str).unwrap_or_default(), gone.len());
    match count {
        0 => {}
        1 => report.note(format_args!(
            "{first}: this source is gone, its image is kept; --force starts over without it"
        )),
        _ => report.note(format_args!(
            "{first} and {} more sources are gone, their images are kept (listed in report.md); --force starts over without \
             them",
            count - 1
        )),
    }
}
