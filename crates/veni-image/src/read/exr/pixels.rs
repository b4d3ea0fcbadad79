//! The blocks of an EXR file, decompressed on all cores and put where they belong.

use std::collections::HashSet;
use std::io::{Read, Seek};
use std::path::Path;

use exr::block::UncompressedBlock;
use exr::block::reader::{ChunksReader, Reader};
use exr::math::Vec2;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;

use super::dwa;
use super::layers::Choice;
use super::wrap;
use crate::{Error, Result};
use veni_light::sphere::Equirect;

/// Blocks held at a time while decompressing on all cores, and their bytes where they are large.
const BATCH: usize = 32;
const BATCH_BYTES: usize = 1 << 28;

/// Decompresses all blocks of the largest level and copies them to where the display window has them. Returns how many colour
/// values of half precision were +∞.
pub(super) fn read(
    reader: Reader<impl Read + Seek>,
    path: &Path,
    choice: &Choice,
    header: &Header,
    out: &mut [[f32; 3]],
    mut known: Option<&mut [f32]>,
    grid: Equirect,
) -> Result<usize> {
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
    let mut beyond = 0;
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
                dwa::check(&chunk, header)?;
                let block = UncompressedBlock::decompress_chunk(chunk, &meta, false)?;
                Ok((block.index, rows(&block, choice, header)?))
            })
            .collect::<Result<Vec<_>, exr::error::Error>>()
            .map_err(|e| wrap(e, path))?;
        for (index, Rows { pixels, alpha, beyond: here }) in decoded {
            beyond += here;
            if index.layer != part || index.level != Vec2(0, 0) || !seen.insert(index.pixel_position) {
                return Err(Error::invalid(
                    "damaged EXR file: a block is stored twice or in the wrong place",
                ));
            }
            place(index.pixel_position, index.pixel_size.0, &pixels, shift, grid, out);
            if let (Some(alpha), Some(known)) = (alpha, known.as_deref_mut()) {
                place(index.pixel_position, index.pixel_size.0, &alpha, shift, grid, known);
            }
        }
    }
    if seen.len() != expected {
        return Err(Error::invalid(format!("truncated EXR file: {} of {expected} blocks", seen.len())));
    }
    Ok(beyond)
}

/// One block, row-major.
struct Rows {
    pixels: Vec<[f32; 3]>,
    /// Where it is wanted.
    alpha: Option<Vec<f32>>,
    /// Colour values that were +∞ in half precision.
    beyond: usize,
}

/// The pixels of one block, row-major.
fn rows(block: &UncompressedBlock, choice: &Choice, header: &Header) -> exr::error::Result<Rows> {
    let Vec2(width, height) = block.index.pixel_size;
    let mut pixels = vec![[0f32; 3]; width * height];
    let mut alpha = choice.alpha.map(|_| vec![0f32; width * height]);
    let mut beyond = 0;
    let (mut halves, mut line) = (vec![f16::ZERO; width], vec![0f32; width]);
    for slice in block.lines(&header.channels) {
        let wanted = (0..3).filter(|&i| choice.channels[i] == slice.location.channel).collect::<Vec<_>>();
        let is_alpha = choice.alpha == Some(slice.location.channel);
        if wanted.is_empty() && !is_alpha {
            continue;
        }
        match header.channels.list[slice.location.channel].sample_type {
            SampleType::F16 => {
                slice.read_samples_into_slice(&mut halves)?;
                halves.convert_to_f32_slice(&mut line);
                if !is_alpha && !choice.data {
                    beyond += largest_for_infinite(&mut line);
                }
            }
            SampleType::F32 => slice.read_samples_into_slice(&mut line)?,
            SampleType::U32 => {
                for (to, from) in line.iter_mut().zip(slice.read_samples::<u32>()) {
                    *to = from? as f32;
                }
            }
        }
        let row = slice.location.position.1 - block.index.pixel_position.1;
        if let Some(alpha) = alpha.as_mut().filter(|_| is_alpha) {
            alpha[row * width..][..width].copy_from_slice(&line);
        }
        for (pixel, &value) in pixels[row * width..][..width].iter_mut().zip(&line) {
            for &i in &wanted {
                pixel[i] = value;
            }
        }
    }
    Ok(Rows { pixels, alpha, beyond })
}

/// A light too bright for half precision was written as +∞; it has at least the largest value. Returns how many there were.
fn largest_for_infinite(line: &mut [f32]) -> usize {
    let mut beyond = 0;
    for value in line.iter_mut().filter(|value| **value == f32::INFINITY) {
        *value = f16::MAX.to_f32();
        beyond += 1;
    }
    beyond
}

/// Copies a block's rows, cut to the display window.
fn place<T: Copy>(
    position: Vec2<usize>,
    width: usize,
    pixels: &[T],
    shift: [i64; 2],
    grid: Equirect,
    out: &mut [T],
) {
    let (columns, lines) = (grid.width as i64, grid.height as i64);
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
            out[start..start + source.len()].copy_from_slice(source);
        }
    }
}
