//! Radiance `.hdr` (Ward, "Real Pixels", Graphics Gems II; the file format chapter of the Radiance manual): a header of lines, then rows of RGBE.

mod header;
mod rows;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::io::BufRead;
use std::path::Path;

use super::ReadOptions;
use super::meaning::{Curve, Meaning};
use crate::colour::XYZ;
use crate::panorama::Panorama;
use crate::{Error, Result};
use header::Header;
pub(super) use header::line_end;

pub(super) fn read(mut file: impl BufRead, path: &Path, options: &ReadOptions) -> Result<Panorama> {
    let header = Header::read(&mut file, path)?;
    let [width, height] = header.size();
    let grid = options.check(width, height)?;
    let meaning = if options.data { Meaning::linear() } else { meaning(&header)? };
    let mut pixels = vec![[0f32; 3]; grid.len()];
    rows::read(&mut file, header.layout, &mut pixels).map_err(|e| wrap(e, path))?;
    let mut panorama = Panorama::new(grid, pixels);
    panorama.attributes = header.attributes();
    panorama.note_provenance();
    meaning.apply(&mut panorama.pixels);
    panorama.notes = meaning.notes;
    Ok(panorama)
}

pub(super) fn attributes(mut file: impl BufRead, path: &Path) -> Result<BTreeMap<String, String>> {
    Header::read(&mut file, path).map(|header| header.attributes())
}

/// Linear values: stored ones to the power of GAMMA, divided by EXPOSURE and COLORCORR, in the PRIMARIES.
fn meaning(header: &Header) -> Result<Meaning> {
    let mut meaning = Meaning::linear();
    let mut divisors = [1f32; 3];
    for value in header.all("EXPOSURE") {
        match value.trim().parse::<f32>() {
            Ok(0.0) => {
                meaning.note("EXPOSURE=0 in the header says that the exposure is not known: taken for 1");
            }
            Ok(exposure) => divisors = divisors.map(|d| d * exposure),
            Err(_) => return Err(Error::invalid(format!("EXPOSURE={value} in the header is not a number"))),
        }
    }
    if !(divisors[0] > 0.0 && divisors[0].is_finite()) {
        let exposure = divisors[0];
        return Err(Error::invalid(format!("EXPOSURE={exposure} in the header; it must be positive")));
    }
    for value in header.all("COLORCORR") {
        let [r, g, b] = numbers(value)[..] else {
            return Err(Error::invalid(format!("COLORCORR={value} in the header is not three numbers")));
        };
        match [r, g, b].map(|v| v as f32) {
            factors if factors.iter().all(|v| *v > 0.0) => (0..3).for_each(|c| divisors[c] *= factors[c]),
            [0.0, 0.0, 0.0] => meaning.note("COLORCORR=0 0 0 in the header says nothing: ignored"),
            _ => return Err(Error::invalid(format!("COLORCORR={value} in the header; it must be positive"))),
        }
    }
    for value in header.all("GAMMA") {
        match value.trim().parse::<f32>() {
            Ok(1.0) => {}
            Ok(0.0) => meaning.note("GAMMA=0 in the header says nothing: taken for 1"),
            // what Walter's rgbe.c, which writes this line, calls the power by which values were encoded
            Ok(gamma) if (0.1..=10.0).contains(&gamma) => meaning.curve = Curve::Power(gamma),
            _ => {
                return Err(Error::invalid(format!(
                    "GAMMA={value} in the header is not a power from 0.1 to 10"
                )));
            }
        }
    }
    if divisors != [1.0; 3] {
        meaning.factors = Some(divisors.map(|d| 1.0 / d));
    }
    if let Some(value) = header.all("PRIMARIES").last() {
        let numbers = numbers(value);
        let Ok(pairs) = <[f64; 8]>::try_from(numbers) else {
            return Err(Error::invalid(format!("PRIMARIES={value} in the header is not eight numbers")));
        };
        // Photoshop writes eight zeros
        if pairs != [0.0; 8] {
            let [rx, ry, gx, gy, bx, by, wx, wy] = pairs;
            let primaries = crate::colour::Primaries([[rx, ry], [gx, gy], [bx, by], [wx, wy]]);
            meaning.matrix = primaries
                .to_rec709()
                .map_err(|e| Error::invalid(format!("PRIMARIES={value} in the header: {e}")))?;
        }
    }
    if header.is_xyz {
        // white of equal energy is white, as in Radiance's own conversion
        meaning.matrix = XYZ.to_rec709().map_err(Error::invalid)?;
    }
    if let Some(ratio) = header.all("PIXASPECT").last().filter(|v| v.trim().parse() != Ok(1f32)) {
        meaning.note(format!("PIXASPECT={ratio} in the header is not applied: pixels are taken for square"));
    }
    Ok(meaning)
}

fn numbers(text: &str) -> Vec<f64> {
    let numbers: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    numbers.unwrap_or_default()
}

fn wrap(error: std::io::Error, path: &Path) -> Error {
    match error.kind() {
        std::io::ErrorKind::UnexpectedEof => Error::invalid("truncated Radiance .hdr file"),
        std::io::ErrorKind::InvalidData => Error::invalid(format!("damaged Radiance .hdr file: {error}")),
        _ => Error::io(path, "read", error),
    }
}
