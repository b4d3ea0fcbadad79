//! What a block compressed by DWA says of its sizes, checked before the decoder allocates it (docs/UPSTREAM.md).

use exr::block::chunk::{Chunk, CompressedBlock};
use exr::compression::Compression;
use exr::error::{Error, Result};
use exr::meta::header::Header;

/// The counters before the data of a block, 64 bits each.
const COUNTERS: usize = 11;

/// Refuses a block that claims more than its pixels can have.
pub(super) fn check(chunk: &Chunk, header: &Header) -> Result<()> {
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    let data = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        _ => return Ok(()),
    };
    let area = header
        .get_absolute_block_pixel_coordinates(header.get_block_data_indices(&chunk.compressed_block)?)?;
    let bytes = area.size.area() as u64 * header.channels.bytes_per_pixel as u64;
    if data.len() as u64 == bytes {
        // stored as it is
        return Ok(());
    }
    claims(
        data,
        bytes,
        padded(area.size.width()) * padded(area.size.height()) * header.channels.list.len() as u64,
    )
}

/// A side in whole blocks of the cosine transform.
fn padded(side: usize) -> u64 {
    (side as u64).next_multiple_of(8)
}

/// Of a block with so many bytes, and so many values where its sides are made multiples of 8.
fn claims(data: &[u8], bytes: u64, values: u64) -> Result<()> {
    let Some(counters) = data.get(..8 * COUNTERS) else { return Ok(()) };
    let counter = |k: usize| u64::from_le_bytes(std::array::from_fn(|i| counters[8 * k + i]));
    // the run-length code makes nothing twice as long
    let most = [(1, bytes), (6, bytes.saturating_mul(2)), (7, bytes), (8, values), (9, values)];
    match most.into_iter().find(|(k, most)| counter(*k) > *most) {
        Some((k, most)) => {
            let text = format!("a DWA block claims {} values where there may be {most}", counter(k));
            Err(Error::Invalid(text.into()))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_pixels_can_have_may_be_claimed() {
        let data = |at: usize, value: u64| {
            let mut counters = [0u64; COUNTERS];
            counters[at] = value;
            counters.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>()
        };
        for (at, most) in [(1, 600), (6, 1200), (7, 600), (8, 384), (9, 384)] {
            claims(&data(at, most), 600, 384).unwrap();
            assert!(claims(&data(at, most + 1), 600, 384).is_err(), "counter {at}");
        }
        // compressed sizes are checked against what is there by the decoder; what is too short, too
        claims(&data(2, u64::MAX), 600, 384).unwrap();
        claims(&[0; 20], 600, 384).unwrap();
    }
}
