//! OpenEXR as scan lines in increasing order with ZIP compression, blocks compressed on all cores.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock};
use exr::math::Vec2;
use exr::meta::attribute::{
    AttributeValue, ChannelDescription, Chromaticities, Compression, LineOrder, SampleType, Text,
};
use exr::meta::header::{Header, LayerAttributes};
use exr::meta::{BlockDescription, MetaData};
use half::f16;
use rayon::prelude::*;

use super::half_range::{Dark, HALF_RANGE};
use super::{Accept, HalfRange, Precision, SOFTWARE, WriteOptions, texts};
use crate::colour::REC709;
use crate::provenance::{PIXEL_DIGEST, PixelDigest};
use crate::{Error, Result};
use veni_light::sphere::Equirect;

/// Name of the attribute that says by the identifiers of the Color Interop Forum which colour space the values are in.
pub(super) const COLOUR_SPACE: &str = "colorInteropID";
/// Linear, Rec. 709 primaries, D65: what a file without the attribute is taken for, too.
const LINEAR_REC709: &str = "lin_rec709_scene";

/// The longest value of a text attribute: ffmpeg before 6 reads so much of one and goes on in its middle.
const MAX_TEXT: usize = 255;

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
    let mut header = header(grid, precision, factor, options)?;
    let coding = Coding {
        precision,
        factor,
        refuse_dark: precision == Precision::Half && options.half_range == HalfRange::Refuse,
        keep: header.own_attributes.other.contains_key(PIXEL_DIGEST.as_bytes()),
    };
    let (mut digest, mut dark) = (PixelDigest::new(grid), Dark::default());
    // the closure below can only return the exr crate's own error
    let mut failure = None;
    let headers = [header.clone()].into_iter().collect();
    let written = exr::block::write(&mut *file, headers, true, |meta, writer| {
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
                for block in compress(&meta, writer, grid, coding, row, band_rows, path)? {
                    digest.update(&block.stored);
                    dark.add(block.dark);
                }
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
        (Some(error), _) => return Err(error),
        (None, Err(error)) => return Err(wrap(error, path)),
        (None, Ok(())) => {}
    }
    if coding.refuse_dark && dark.count > 0 {
        return Err(Error::invalid(format!(
            "{} of {} values are below {:.1e}, where half precision loses bits; the darkest is {:.1e}: write floats, or \
             let the values be scaled",
            dark.count,
            3 * grid.len(),
            HALF_RANGE[0],
            dark.darkest
        )));
    }
    if coding.keep {
        let digest = AttributeValue::Text(text(&digest.finish())?);
        header.own_attributes.other.insert(text(PIXEL_DIGEST)?, digest);
    }
    // as many bytes, in another order and with the digest
    let attributes = attributes(&header).map_err(|e| wrap(e, path))?;
    let put = file.seek(SeekFrom::Start(PREFIX)).and_then(|_| file.write_all(&attributes));
    put.map_err(|e| Error::io(path, "write", e))
}

/// How values become samples.
#[derive(Clone, Copy)]
struct Coding {
    precision: Precision,
    factor: f32,
    /// Whether values that half precision does not keep are counted, to be refused.
    refuse_dark: bool,
    /// Whether the values as a reader gets them are wanted back.
    keep: bool,
}

/// A block of rows as it is stored.
struct Block {
    /// Native-endian samples: line by line, in each line all of B, then G, then R.
    data: Vec<u8>,
    /// The values that a reader gets; empty if they are not wanted.
    stored: Vec<[f32; 3]>,
    dark: Dark,
}

fn header(grid: Equirect, precision: Precision, factor: f32, options: &WriteOptions) -> Result<Header> {
    let sample_type = if precision == Precision::Half { SampleType::F16 } else { SampleType::F32 };
    // alphabetical, as the format demands
    let channels = ["B", "G", "R"].map(|name| ChannelDescription::new(name, sample_type, false));
    let mut attributes =
        LayerAttributes { software_name: Some(Text::from(SOFTWARE)), ..LayerAttributes::default() };
    let limit = |name: &str| if ["comments", "owner"].contains(&name) { usize::MAX } else { MAX_TEXT };
    for (name, value) in texts(options, factor, limit)? {
        let value = text(&value)?;
        match name.as_str() {
            "comments" => attributes.comments = Some(value),
            "owner" => attributes.owner = Some(value),
            _ => drop(attributes.other.insert(text(&name)?, AttributeValue::Text(value))),
        }
    }
    if options.colour {
        attributes.other.insert(text(COLOUR_SPACE)?, AttributeValue::Text(text(LINEAR_REC709)?));
    }
    let mut header =
        Header::new(Text::from(""), Vec2(grid.width, grid.height), channels.into_iter().collect())
            .with_attributes(attributes)
            .with_encoding(Compression::ZIP16, BlockDescription::ScanLines, LineOrder::Increasing);
    if options.colour {
        let [red, green, blue, white] = REC709.0.map(|[x, y]| Vec2(x as f32, y as f32));
        header.shared_attributes.chromaticities = Some(Chromaticities { red, green, blue, white });
    }
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

/// Converts and compresses whole blocks in parallel, then writes them in order; what they hold, without the samples.
fn compress(
    meta: &MetaData,
    writer: &mut impl ChunksWriter,
    grid: Equirect,
    coding: Coding,
    first_row: usize,
    rows: &[[f32; 3]],
    path: &Path,
) -> Result<Vec<Block>> {
    let chunks = (rows.par_chunks(BLOCK_ROWS * grid.width).enumerate())
        .map(|(k, rows)| {
            let top = first_row + k * BLOCK_ROWS;
            let mut block = samples(grid.width, coding, top, rows)?;
            let size = Vec2(grid.width, rows.len() / grid.width);
            let index =
                BlockIndex { layer: 0, pixel_position: Vec2(0, top), pixel_size: size, level: Vec2(0, 0) };
            let data = std::mem::take(&mut block.data);
            let chunk = UncompressedBlock { index, data }.compress_to_chunk(&meta.headers);
            Ok((top / BLOCK_ROWS, chunk.map_err(|e| wrap(e, path))?, block))
        })
        .collect::<Result<Vec<_>>>()?;
    let mut blocks = Vec::with_capacity(chunks.len());
    for (index, chunk, block) in chunks {
        writer.write_chunk(index, chunk).map_err(|e| wrap(e, path))?;
        blocks.push(block);
    }
    Ok(blocks)
}

fn samples(width: usize, coding: Coding, top: usize, rows: &[[f32; 3]]) -> Result<Block> {
    let half = coding.precision == Precision::Half;
    let mut data = Vec::with_capacity(rows.len() * if half { 6 } else { 12 });
    let mut stored = if coding.keep { rows.to_vec() } else { Vec::new() };
    let mut dark = Dark::default();
    for (k, row) in rows.chunks_exact(width).enumerate() {
        for channel in [2, 1, 0] {
            for (column, pixel) in row.iter().enumerate() {
                let mut value = pixel[channel] * coding.factor;
                let limit = if half { HALF_RANGE[1] } else { f32::MAX };
                if value.abs() > limit {
                    let row = top + k;
                    return Err(Error::invalid(format!(
                        "pixel ({column}, {row}) is {value}, beyond the largest half of {}: write floats, or let the \
                         values be scaled",
                        HALF_RANGE[1]
                    )));
                }
                if half {
                    if coding.refuse_dark {
                        dark.see(value);
                    }
                    let sample = f16::from_f32(value);
                    data.extend(sample.to_ne_bytes());
                    if coding.keep {
                        value = sample.to_f32();
                    }
                } else {
                    data.extend(value.to_ne_bytes());
                }
                if coding.keep {
                    stored[k * width + column][channel] = value;
                }
            }
        }
    }
    Ok(Block { data, stored, dark })
}

fn wrap(error: exr::error::Error, path: &Path) -> Error {
    match error {
        exr::error::Error::Io(e) => Error::io(path, "write", e),
        exr::error::Error::NotSupported(what) => Error::unsupported(format!("EXR: {what}")),
        exr::error::Error::Invalid(what) => Error::invalid(format!("EXR: {what}")),
        exr::error::Error::Aborted => Error::invalid("writing the EXR file was given up"),
    }
}
