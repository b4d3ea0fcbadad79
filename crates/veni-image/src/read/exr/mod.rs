//! OpenEXR through the block interface of the `exr` crate: its header is judged before anything is allocated,
//! and only the channels that are needed are kept.

mod dwa;
mod layers;
mod pixels;
mod tags;

use std::collections::BTreeMap;
use std::io::{Read, Seek};
use std::path::Path;

use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, EnvironmentMap, Text};
use exr::meta::header::Header;
use half::f16;
use rayon::prelude::*;

use super::meaning::Meaning;
use super::{ReadOptions, precheck};
use crate::limits::{MAX_EXR_BLOCK_BYTES, MAX_EXR_CHANNELS, MAX_EXR_CHUNKS, MAX_EXR_PARTS, at_most};
use crate::numbered::join;
use crate::{Error, Result};
use crate::{Panorama, Provenance, RADIANCE_SCALE};
use veni_light::sphere::Equirect;

/// What covers less of a pixel than this is not known from it.
const LEAST_ALPHA: f32 = 1.0 / 64.0;
/// What is said of several samples to a pixel.
const DEEP: &str = "a deep EXR image; flatten it to one sample per pixel";

pub(super) fn read(file: impl Read + Seek, path: &Path, options: &ReadOptions) -> Result<Panorama> {
    let reader = exr::block::read(file, false).map_err(|e| wrap(e, path))?;
    judge_parts(reader.headers(), options)?;
    let choice = layers::choose(reader.headers(), options)?;
    let header = reader.headers()[choice.part].clone();
    let grid = judge(&header, options)?;
    // the decoder's own view of the header: a damaged one may be walked through otherwise before
    precheck::budget(Some([grid.width as u64, grid.height as u64]), options)?;
    let attributes = text(&header);
    let meaning =
        if options.data { Meaning::linear() } else { tags::meaning(&header, &attributes, choice.coloured)? };
    let mut panorama = Panorama::new(grid, vec![[0.0; 3]; grid.len()]);
    let mut known = stored_window(&header, grid, choice.alpha.is_some());
    let beyond =
        pixels::read(reader, path, &choice, &header, &mut panorama.pixels, known.as_deref_mut(), grid)?;
    panorama.attributes = attributes;
    panorama.note_provenance();
    panorama.notes.clone_from(&meaning.notes);
    if beyond > 0 {
        panorama.notes.push(format!(
            "{beyond} values are infinite, beyond what half precision holds: they are taken for its largest, {}, and what \
             they had more is lost",
            f16::MAX
        ));
    }
    panorama.known = known;
    if choice.alpha.is_some() {
        cover(&mut panorama, stored_window(&header, grid, false), options.data);
    }
    meaning.apply(&mut panorama.pixels);
    match panorama.attributes.get(RADIANCE_SCALE) {
        Some(factor) if panorama.provenance == Provenance::Changed => panorama.notes.push(format!(
            "its pixels were changed after {RADIANCE_SCALE} = {factor} was written; they are taken as they are, not \
             divided by it"
        )),
        Some(factor) => {
            let factor = factor.parse().ok().filter(|f: &f32| f.is_normal() && *f > 0.0);
            let factor = factor
                .ok_or_else(|| Error::invalid(format!("attribute {RADIANCE_SCALE} is not a factor")))?;
            panorama.scale(1.0 / factor);
        }
        None => {}
    }
    Ok(panorama)
}

/// What the data window leaves uncovered is unknown: 0 there and 1 elsewhere, as far as that has to be written down.
fn stored_window(header: &Header, grid: Equirect, alpha: bool) -> Option<Vec<f32>> {
    let (display, data) = (header.shared_attributes.display_window, header.own_attributes.layer_position);
    let axis = |display: i32, data: i32, size: usize, whole: usize| {
        let first = i64::from(data) - i64::from(display);
        let inside = |at: i64| at.clamp(0, whole as i64) as usize;
        inside(first)..inside(first + size as i64)
    };
    let Vec2(width, height) = header.layer_size;
    let columns = axis(display.position.0, data.0, width, grid.width);
    let rows = axis(display.position.1, data.1, height, grid.height);
    let whole = columns.len() == grid.width && rows.len() == grid.height;
    if whole && !alpha {
        return None;
    }
    let mut known = vec![0.0; grid.len()];
    for line in known.chunks_exact_mut(grid.width).skip(rows.start).take(rows.len()) {
        line[columns.clone()].fill(1.0);
    }
    Some(known)
}

/// Colours are stored times alpha (OpenEXR, "Interpreting OpenEXR files"): divides by it, and what is then a colour is known. An
/// alpha that is 0 everywhere says nothing if there are colours; what the file holds is then its `window`.
fn cover(panorama: &mut Panorama, window: Option<Vec<f32>>, data: bool) {
    let Some(alpha) = &panorama.known else { return };
    if alpha.iter().all(|a| *a >= 1.0) {
        panorama.known = None;
        return;
    }
    let lit = || panorama.pixels.iter().any(|p| *p != [0.0; 3]);
    if alpha.iter().all(|a| *a == 0.0) && lit() {
        panorama
            .notes
            .push("its alpha channel is 0 everywhere although there are colours: it is ignored".to_owned());
        panorama.known = window;
        return;
    }
    let Some(alpha) = &mut panorama.known else { return };
    let hidden =
        |(pixel, alpha): &(&[f32; 3], &f32)| (0.0..LEAST_ALPHA).contains(*alpha) && **pixel != [0.0; 3];
    let coloured = panorama.pixels.iter().zip(&*alpha).filter(hidden).count();
    if coloured > 0 {
        panorama.notes.push(format!(
            "{:.1} % of its pixels have a colour although their alpha is 0 or below {LEAST_ALPHA}: they count as \
             transparent; where they are light, store them without alpha",
            100.0 * coloured as f64 / alpha.len() as f64
        ));
    }
    panorama.pixels.par_iter_mut().zip(&mut *alpha).for_each(|(pixel, alpha)| {
        // NaN is nothing known; of too little, division would make a light that nobody saw
        if *alpha >= LEAST_ALPHA {
            if !data {
                *pixel = pixel.map(|v| v / alpha.min(1.0));
            }
            *alpha = 1.0;
        } else {
            (*pixel, *alpha) = ([0.0; 3], 0.0);
        }
    });
    if alpha.iter().all(|known| *known == 1.0) {
        panorama.known = None;
    }
}

pub(super) fn attributes(file: impl Read + Seek, path: &Path) -> Result<BTreeMap<String, String>> {
    let reader = exr::block::read(file, false).map_err(|e| wrap(e, path))?;
    let mut all = BTreeMap::new();
    for header in reader.headers().iter().rev() {
        all.extend(text(header));
    }
    Ok(all)
}

/// Checks everything the header says that the pixels will be allocated by.
fn judge(header: &Header, options: &ReadOptions) -> Result<Equirect> {
    if header.own_attributes.environment_map == Some(EnvironmentMap::Cube) {
        return Err(Error::unsupported(
            "a cube map (envmap = cube); convert it to a latitude-longitude panorama",
        ));
    }
    if header.deep {
        return Err(Error::unsupported(DEEP));
    }
    let Vec2(width, height) = header.shared_attributes.display_window.size;
    let grid = options.check(width, height)?;
    let Vec2(data_width, _) = header.layer_size;
    let (block_width, block_height) = match header.blocks {
        BlockDescription::ScanLines => (data_width, header.compression.scan_lines_per_block()),
        BlockDescription::Tiles(tiles) => (tiles.tile_size.0, tiles.tile_size.1),
    };
    let bytes =
        (block_width.checked_mul(block_height)).and_then(|n| n.checked_mul(header.channels.bytes_per_pixel));
    if bytes.is_none_or(|n| n > MAX_EXR_BLOCK_BYTES) || block_width == 0 || block_height == 0 {
        return Err(Error::invalid(format!(
            "blocks of {block_width} × {block_height} pixels are not plausible"
        )));
    }
    Ok(grid)
}

/// Every part is walked through when chunks are looked up, so each must be of a plausible size.
fn judge_parts(headers: &[Header], options: &ReadOptions) -> Result<()> {
    let any = ReadOptions { any_aspect: true, ..options.clone() };
    if headers.len() > MAX_EXR_PARTS || headers.iter().any(|h| h.channels.list.len() > MAX_EXR_CHANNELS) {
        return Err(Error::invalid("more parts or channels than a panorama has"));
    }
    for Vec2(width, height) in headers.iter().map(|header| header.layer_size) {
        any.check(width, height).map_err(|e| Error::invalid(format!("data window: {e}")))?;
    }
    let chunks = headers.iter().fold(0_u64, |sum, header| sum.saturating_add(header.chunk_count as u64));
    at_most("blocks", chunks, MAX_EXR_CHUNKS as u64)?;
    Ok(())
}

/// Every text attribute of a part, the standard ones under their standard names.
fn text(header: &Header) -> BTreeMap<String, String> {
    let own = header.own_attributes.other.iter().chain(&header.shared_attributes.other);
    let mut all: BTreeMap<String, String> = own
        .filter_map(|(name, value)| match value {
            AttributeValue::Text(text) => Some((utf8(name), utf8(text))),
            _ => None,
        })
        .collect();
    let attributes = &header.own_attributes;
    let standard = [
        ("software", &attributes.software_name),
        ("comments", &attributes.comments),
        ("owner", &attributes.owner),
        ("capDate", &attributes.capture_date),
    ];
    for (name, value) in standard {
        if let Some(value) = value {
            all.insert(name.to_owned(), utf8(value));
        }
    }
    join(all)
}

/// EXR text is bytes without an encoding.
fn utf8(text: &Text) -> String {
    String::from_utf8_lossy(text.as_slice()).into_owned()
}

fn wrap(error: exr::error::Error, path: &Path) -> Error {
    match error {
        exr::error::Error::NotSupported(what) if what.contains("deep") => Error::unsupported(DEEP),
        exr::error::Error::NotSupported(what) => {
            Error::unsupported(format!("EXR: {what}; store it with ZIP or another compression of OpenEXR 2"))
        }
        exr::error::Error::Invalid(what) => Error::invalid(format!("damaged or truncated EXR file: {what}")),
        exr::error::Error::Io(e) => Error::io(path, "read", e),
        exr::error::Error::Aborted => Error::invalid("reading the EXR file was given up"),
    }
}
