//! OpenEXR as scan lines in increasing order with ZIP compression, blocks compressed on all cores.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::math::Vec2;
use exr::meta::attribute::{
    AttributeValue, ChannelDescription, Chromaticities, Compression, EnvironmentMap, LineOrder, SampleType,
    Text,
};
use exr::meta::header::{Header, LayerAttributes};
use exr::meta::{BlockDescription, MetaData};
use half::f16;
use rayon::prelude::*;

use super::{Accept, HalfRange, Precision, RADIANCE_SCALE, SOFTWARE, WriteOptions};
use crate::colour::REC709;
use crate::{Error, Result};
use veni_light::sphere::Equirect;

/// The largest finite half.
pub(super) const HALF_MAX: f64 = 65504.0;

/// Scan lines in one ZIP block; fixed by the format.
const BLOCK_ROWS: usize = 16;

pub(super) fn write(
    file: &mut BufWriter<File>,
    path: &Path,
    grid: Equirect,
    precision: Precision,
    options: &WriteOptions,
    run: impl FnOnce(Accept<'_>) -> Result<()>,
) -> Result<()> {
    let factor = match options.half_range {
        HalfRange::Factor(f) if f.is_normal() && f > 0.0 => f,
        HalfRange::Factor(f) => {
            return Err(Error::invalid(format!("{f} is not a factor to scale radiance by")));
        }
        HalfRange::Refuse => 1.0,
        HalfRange::Fit => {
            return Err(Error::invalid(
                "rows written one by one cannot be fitted to the half range: give a factor, or write floats",
            ));
        }
    };
    let header = header(grid, precision, factor, options)?;
    let attributes = attributes(&header).map_err(|e| wrap(e, path))?;
    // the closure below can only return the exr crate's own error
    let mut failure = None;
    let written = exr::block::write(&mut *file, [header].into_iter().collect(), true, |meta, writer| {
        let blocks = (2 * rayon::current_num_threads()).clamp(4, 64);
        let mut pending: Vec<[f32; 3]> = Vec::new();
        let mut row = 0;
        let result = run(&mut |rows| {
            pending.extend_from_slice(rows);
            let ready = pending.len() / grid.width;
            let band = blocks * BLOCK_ROWS;
            let last = row + ready == grid.height;
            let take = if last { ready } else { ready / band * band };
            for band_rows in pending[..take * grid.width].chunks(band * grid.width) {
                compress(&meta, writer, grid, precision, factor, row, band_rows, path)?;
                row += band_rows.len() / grid.width;
            }
            pending.drain(..take * grid.width);
            Ok(())
        });
        result.map_err(|e| {
            failure = Some(e);
            exr::error::Error::Aborted
        })
    });
    match (failure, written) {
        (Some(error), _) => Err(error),
        (None, Err(error)) => Err(wrap(error, path)),
        // the same bytes in another order
        (None, Ok(())) => file
            .seek(SeekFrom::Start(PREFIX))
            .and_then(|_| file.write_all(&attributes))
            .map_err(|e| Error::io(path, "write", e)),
    }
}

fn header(grid: Equirect, precision: Precision, factor: f32, options: &WriteOptions) -> Result<Header> {
    let sample_type = if precision == Precision::Half { SampleType::F16 } else { SampleType::F32 };
    // alphabetical, as the format demands
    let channels = ["B", "G", "R"].map(|name| ChannelDescription::new(name, sample_type, false));
    let mut attributes = LayerAttributes {
        environment_map: options.latlong.then_some(EnvironmentMap::LatitudeLongitude),
        software_name: Some(Text::from(SOFTWARE)),
        ..LayerAttributes::default()
    };
    for (name, value) in &options.attributes {
        let value = text(value)?;
        match name.as_str() {
            "comments" => attributes.comments = Some(value),
            "owner" => attributes.owner = Some(value),
            RADIANCE_SCALE => {
                return Err(Error::invalid(format!(
                    "the attribute {name} is not free: it is written when values are scaled"
                )));
            }
            _ => drop(attributes.other.insert(text(name)?, AttributeValue::Text(value))),
        }
    }
    if factor != 1.0 {
        attributes.other.insert(text(RADIANCE_SCALE)?, AttributeValue::Text(text(&factor.to_string())?));
    }
    let mut header =
        Header::new(Text::from(""), Vec2(grid.width, grid.height), channels.into_iter().collect())
            .with_attributes(attributes)
            .with_encoding(Compression::ZIP16, BlockDescription::ScanLines, LineOrder::Increasing);
    let [red, green, blue, white] = REC709.0.map(|[x, y]| Vec2(x as f32, y as f32));
    header.shared_attributes.chromaticities = Some(Chromaticities { red, green, blue, white });
    Ok(header)
}

/// Bytes in front of the attributes: magic number and version.
const PREFIX: u64 = 8;

/// The attributes of `header` as a file holds them: those of the format in the exr crate's order, then the others by
/// name. The crate keeps those in a hash map and writes them in its order, which differs from process to process.
fn attributes(header: &Header) -> exr::error::Result<Vec<u8>> {
    let mut all: Vec<_> = header.all_named_attributes().collect();
    let others = &header.own_attributes.other;
    // the sort is stable: what is not among the others keeps its place
    all.sort_by_key(|(name, _)| others.get_key_value(*name).map(|(name, _)| name));
    let mut bytes = Vec::new();
    for (name, value) in all {
        exr::meta::attribute::write(name, &value, &mut bytes)?;
    }
    Ok(bytes)
}

/// EXR text is bytes without an encoding; UTF-8 is what other software expects.
fn text(string: &str) -> Result<Text> {
    if string.is_empty() || string.contains('\0') {
        return Err(Error::invalid(format!(
            "{string:?} cannot be an EXR attribute: it is empty or holds a NUL"
        )));
    }
    Ok(Text::from_slice_unchecked(string.as_bytes()))
}

/// Converts and compresses whole blocks in parallel, then writes them in order.
#[expect(clippy::too_many_arguments, reason = "a private step of one function")]
fn compress(
    meta: &MetaData,
    writer: &mut impl ChunksWriter,
    grid: Equirect,
    precision: Precision,
    factor: f32,
    first_row: usize,
    rows: &[[f32; 3]],
    path: &Path,
) -> Result<()> {
    let chunks = (rows.par_chunks(BLOCK_ROWS * grid.width).enumerate())
        .map(|(k, rows)| {
            let top = first_row + k * BLOCK_ROWS;
            let data = bytes(grid.width, precision, factor, top, rows)?;
            let size = Vec2(grid.width, rows.len() / grid.width);
            let index =
                BlockIndex { layer: 0, pixel_position: Vec2(0, top), pixel_size: size, level: Vec2(0, 0) };
            let chunk = UncompressedBlock { index, data }.compress_to_chunk(&meta.headers);
            Ok((top / BLOCK_ROWS, chunk.map_err(|e| wrap(e, path))?))
        })
        .collect::<Result<Vec<_>>>()?;
    for (index, chunk) in chunks {
        writer.write_chunk(index, chunk).map_err(|e| wrap(e, path))?;
    }
    Ok(())
}

/// Native-endian samples: line by line, in each line all of B, then G, then R.
fn bytes(width: usize, precision: Precision, factor: f32, top: usize, rows: &[[f32; 3]]) -> Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(rows.len() * if precision == Precision::Half { 6 } else { 12 });
    for (k, row) in rows.chunks_exact(width).enumerate() {
        for channel in [2, 1, 0] {
            for (column, pixel) in row.iter().enumerate() {
                let value = pixel[channel] * factor;
                let limit = if precision == Precision::Half { HALF_MAX } else { f64::from(f32::MAX) };
                if f64::from(value.abs()) > limit {
                    let row = top + k;
                    return Err(Error::invalid(format!(
                        "pixel ({column}, {row}) is {value}, beyond the largest half of {HALF_MAX}: \
                         write floats, or let the values be scaled"
                    )));
                }
                match precision {
                    Precision::Half => bytes.extend(f16::from_f32(value).to_ne_bytes()),
                    Precision::Float => bytes.extend(value.to_ne_bytes()),
                }
            }
        }
    }
    Ok(bytes)
}

fn wrap(error: exr::error::Error, path: &Path) -> Error {
    match error {
        exr::error::Error::Io(e) => Error::io(path, "write", e),
        exr::error::Error::NotSupported(what) => Error::unsupported(format!("EXR: {what}")),
        exr::error::Error::Invalid(what) => Error::invalid(format!("EXR: {what}")),
        exr::error::Error::Aborted => Error::invalid("writing the EXR file was given up"),
    }
}
