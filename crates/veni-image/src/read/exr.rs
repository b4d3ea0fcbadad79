//! OpenEXR through the block interface of the `exr` crate: its header is judged before anything is allocated,
//! and only the three channels that are needed are kept.

use std::collections::{BTreeMap, HashSet};
use std::io::{Read, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use exr::block::UncompressedBlock;
use exr::block::reader::{ChunksReader, Reader};
use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::{AttributeValue, EnvironmentMap, SampleType, Text};
use exr::meta::header::Header;
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;

use super::ReadOptions;
use crate::colour::{Primaries, convert};
use crate::limits::{MAX_EXR_BLOCK_BYTES, MAX_EXR_CHANNELS, MAX_EXR_CHUNKS, MAX_EXR_PARTS, at_most};
use crate::numbered::join;
use crate::{Error, Result};
use crate::{Panorama, Provenance, RADIANCE_SCALE};

/// Blocks held at a time while decompressing on all cores, and their bytes where they are large.
const BATCH: usize = 32;
const BATCH_BYTES: usize = 1 << 28;

pub(super) fn read(file: impl Read + Seek, path: &Path, options: &ReadOptions) -> Result<Panorama> {
    guarded(|| {
        let reader = exr::block::read(file, false).map_err(|e| wrap(e, path))?;
        judge_parts(reader.headers(), options)?;
        let choice = choose(reader.headers(), options)?;
        let header = reader.headers()[choice.part].clone();
        let grid = judge(&header, options)?;
        let matrix = match header.shared_attributes.chromaticities {
            Some(c) => {
                let pairs = [c.red, c.green, c.blue, c.white].map(|v| [f64::from(v.0), f64::from(v.1)]);
                Primaries(pairs).to_rec709().map_err(Error::invalid)?
            }
            None => None,
        };
        let mut panorama = Panorama::new(grid, vec![[0.0; 3]; grid.len()]);
        panorama.attributes = text(&header);
        blocks(reader, path, &choice, &header, &mut panorama)?;
        panorama.note_provenance();
        if let Some(matrix) = matrix.filter(|_| choice.coloured) {
            panorama.pixels.par_iter_mut().for_each(|pixel| *pixel = convert(&matrix, *pixel));
        }
        if let Some(factor) =
            panorama.attributes.get(RADIANCE_SCALE).filter(|_| panorama.provenance != Provenance::Changed)
        {
            let factor = factor.parse().ok().filter(|f: &f32| f.is_normal() && *f > 0.0);
            let factor = factor
                .ok_or_else(|| Error::invalid(format!("attribute {RADIANCE_SCALE} is not a factor")))?;
            panorama.scale(1.0 / factor);
        }
        Ok(panorama)
    })
}

/// The alpha channel that belongs to the colours that [`read`] takes; 0 where no data is stored.
pub(super) fn read_alpha(
    file: impl Read + Seek,
    path: &Path,
    options: &ReadOptions,
) -> Result<Option<Vec<f32>>> {
    guarded(|| {
        let reader = exr::block::read(file, false).map_err(|e| wrap(e, path))?;
        judge_parts(reader.headers(), options)?;
        let choice = choose(reader.headers(), options)?;
        let Some(alpha) = choice.alpha else { return Ok(None) };
        let header = reader.headers()[choice.part].clone();
        let grid = judge(&header, options)?;
        let mut panorama = Panorama::new(grid, vec![[0.0; 3]; grid.len()]);
        let choice = Choice { channels: [alpha; 3], coloured: false, ..choice };
        blocks(reader, path, &choice, &header, &mut panorama)?;
        Ok(Some(panorama.pixels.iter().map(|pixel| pixel[0]).collect()))
    })
}

pub(super) fn attributes(file: impl Read + Seek, path: &Path) -> Result<BTreeMap<String, String>> {
    guarded(|| {
        let reader = exr::block::read(file, false).map_err(|e| wrap(e, path))?;
        let mut all = BTreeMap::new();
        for header in reader.headers().iter().rev() {
            all.extend(text(header));
        }
        Ok(all)
    })
}

/// Some damaged files make the decoder panic instead of returning an error; that must not reach the caller.
fn guarded<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|_| Err(Error::invalid("damaged EXR file: its decoder gave up on it")))
}

/// Checks everything the header says that the pixels will be allocated by.
fn judge(header: &Header, options: &ReadOptions) -> Result<veni_light::sphere::Equirect> {
    if header.own_attributes.environment_map == Some(EnvironmentMap::Cube) {
        return Err(Error::unsupported(
            "a cube map (envmap = cube); convert it to a latitude-longitude panorama",
        ));
    }
    if header.deep {
        return Err(Error::unsupported("deep EXR images are not read"));
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

/// The part of the file and its channels that hold red, green and blue.
struct Choice {
    part: usize,
    channels: [usize; 3],
    /// Of the same layer, where it has one.
    alpha: Option<usize>,
    coloured: bool,
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

/// Candidates are all prefixes that have R, G and B (or Y alone); no prefix wins, then the one asked for.
fn choose(headers: &[Header], options: &ReadOptions) -> Result<Choice> {
    let mut found: Vec<(String, Choice, bool)> = Vec::new();
    for (part, header) in headers.iter().enumerate() {
        let part_name = header.own_attributes.layer_name.as_ref().map(Text::to_string).unwrap_or_default();
        let mut layers: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
        for (index, channel) in header.channels.list.iter().enumerate() {
            let full = channel.name.to_string();
            let (prefix, last) = full.rsplit_once('.').unwrap_or(("", &full));
            layers.entry(prefix.to_owned()).or_default().insert(last.to_ascii_uppercase(), index);
        }
        for (prefix, names) in layers {
            let name = [part_name.as_str(), prefix.as_str()].into_iter().filter(|s| !s.is_empty());
            let name = name.collect::<Vec<_>>().join(".");
            let get = |wanted: &str| names.get(wanted).copied();
            let (channels, coloured) = match (get("R"), get("G"), get("B"), get("Y")) {
                (Some(r), Some(g), Some(b), _) => ([r, g, b], true),
                (_, _, _, Some(y)) if get("RY").is_none() && get("BY").is_none() => ([y; 3], false),
                (_, _, _, Some(_)) => {
                    return Err(Error::unsupported(
                        "luminance-chroma EXR images are not read; convert it to RGB",
                    ));
                }
                _ => continue,
            };
            let sampled = channels.iter().any(|&c| header.channels.list[c].sampling != Vec2(1, 1));
            if sampled || header.channels.list.iter().any(|c| c.sampling != Vec2(1, 1)) {
                return Err(Error::unsupported("EXR images with subsampled channels are not read"));
            }
            found.push((name, Choice { part, channels, alpha: get("A"), coloured }, prefix.is_empty()));
        }
    }
    let names = found.iter().map(|(name, ..)| format!("{name:?}")).collect::<Vec<_>>().join(", ");
    if let Some(wanted) = &options.layer {
        let hit = found.into_iter().find(|(name, ..)| name == wanted);
        return hit.map(|(_, choice, _)| choice).ok_or_else(|| {
            Error::invalid(format!("no layer {wanted:?} with R, G, B or Y; there are: {names}"))
        });
    }
    let unnamed = found.iter().filter(|(.., bare)| *bare).count();
    if unnamed == 1 {
        found.retain(|(.., bare)| *bare);
    } else if found.len() > 1 {
        let main = |name: &str| {
            let last = name.rsplit('.').next().unwrap_or(name).to_ascii_lowercase();
            ["combined", "beauty", "rgba", "rgb", "color"].contains(&last.as_str())
        };
        if found.iter().filter(|(name, ..)| main(name)).count() == 1 {
            found.retain(|(name, ..)| main(name));
        }
    }
    if found.len() > 1 {
        return Err(Error::invalid(format!("several layers could be meant, name one of: {names}")));
    }
    found.pop().map(|(_, choice, _)| choice).ok_or_else(|| {
        let channels = headers.iter().flat_map(|h| h.channels.list.iter().map(|c| c.name.to_string()));
        let channels = channels.take(16).collect::<Vec<_>>().join(", ");
        Error::unsupported(format!("no R, G, B or Y channels among: {channels}"))
    })
}

/// Decompresses all blocks of the largest level and copies them to where the display window has them.
fn blocks(
    reader: Reader<impl Read + Seek>,
    path: &Path,
    choice: &Choice,
    header: &Header,
    out: &mut Panorama,
) -> Result<()> {
    let part = choice.part;
    let mut chunks = reader
        .filter_chunks(false, |_, tile, block| block.layer == part && tile.is_largest_resolution_level())
        .map_err(|e| wrap(e, path))?;
    let expected = chunks.expected_chunk_count();
    let meta = chunks.meta_data().clone();
    let origin = header.shared_attributes.display_window.position;
    let shift = [
        i64::from(header.own_attributes.layer_position.0) - i64::from(origin.0),
        i64::from(header.own_attributes.layer_position.1) - i64::from(origin.1),
    ];
    let mut seen = HashSet::with_capacity(expected);
    let together = (BATCH_BYTES / header.max_block_byte_size().max(1)).clamp(1, BATCH);
    loop {
        let batch =
            chunks.by_ref().take(together).collect::<Result<Vec<_>, _>>().map_err(|e| wrap(e, path))?;
        if batch.is_empty() {
            break;
        }
        let decoded = batch
            .into_par_iter()
            .map(|chunk| {
                let block = UncompressedBlock::decompress_chunk(chunk, &meta, false)?;
                Ok((block.index, rows(&block, choice, header)?))
            })
            .collect::<Result<Vec<_>, exr::error::Error>>()
            .map_err(|e| wrap(e, path))?;
        for (index, pixels) in decoded {
            if index.layer != part || index.level != Vec2(0, 0) || !seen.insert(index.pixel_position) {
                return Err(Error::invalid(
                    "damaged EXR file: a block is stored twice or in the wrong place",
                ));
            }
            place(index.pixel_position, index.pixel_size.0, &pixels, shift, out);
        }
    }
    if seen.len() != expected {
        return Err(Error::invalid(format!("truncated EXR file: {} of {expected} blocks", seen.len())));
    }
    Ok(())
}

/// The pixels of one block, row-major.
fn rows(block: &UncompressedBlock, choice: &Choice, header: &Header) -> exr::error::Result<Vec<[f32; 3]>> {
    let Vec2(width, height) = block.index.pixel_size;
    let mut pixels = vec![[0f32; 3]; width * height];
    let (mut halves, mut line) = (vec![f16::ZERO; width], vec![0f32; width]);
    for slice in block.lines(&header.channels) {
        let wanted = (0..3).filter(|&i| choice.channels[i] == slice.location.channel).collect::<Vec<_>>();
        if wanted.is_empty() {
            continue;
        }
        match header.channels.list[slice.location.channel].sample_type {
            SampleType::F16 => {
                slice.read_samples_into_slice(&mut halves)?;
                halves.convert_to_f32_slice(&mut line);
            }
            SampleType::F32 => slice.read_samples_into_slice(&mut line)?,
            SampleType::U32 => {
                for (to, from) in line.iter_mut().zip(slice.read_samples::<u32>()) {
                    *to = from? as f32;
                }
            }
        }
        let row = slice.location.position.1 - block.index.pixel_position.1;
        for (pixel, &value) in pixels[row * width..][..width].iter_mut().zip(&line) {
            for &i in &wanted {
                pixel[i] = value;
            }
        }
    }
    Ok(pixels)
}

/// Copies a block's rows, cut to the display window.
fn place(position: Vec2<usize>, width: usize, pixels: &[[f32; 3]], shift: [i64; 2], out: &mut Panorama) {
    let (columns, lines) = (out.grid.width as i64, out.grid.height as i64);
    let left = position.0 as i64 + shift[0];
    let (from, to) = (left.clamp(0, columns), (left + width as i64).clamp(0, columns));
    if from >= to {
        return;
    }
    for (k, row) in pixels.chunks_exact(width).enumerate() {
        let y = position.1 as i64 + k as i64 + shift[1];
        if (0..lines).contains(&y) {
            let start = (y * columns + from) as usize;
            let source = &row[(from - left) as usize..(to - left) as usize];
            out.pixels[start..start + source.len()].copy_from_slice(source);
        }
    }
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
        exr::error::Error::NotSupported(what) => Error::unsupported(format!("EXR: {what}")),
        exr::error::Error::Invalid(what) => Error::invalid(format!("damaged or truncated EXR file: {what}")),
        exr::error::Error::Io(e) => Error::io(path, "read", e),
        exr::error::Error::Aborted => Error::invalid("reading the EXR file was given up"),
    }
}
