//! Radiance RGBE with the run-length code of its second version, row by row.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use super::{Accept, SOFTWARE, WriteOptions, texts};
use crate::provenance::{PIXEL_DIGEST, PixelDigest};
use crate::{Error, Result};
use veni_light::sphere::Equirect;

/// The longest header line: three.js before its revision 184 reads no more than 127 bytes of one, FreeImage 255.
const MAX_LINE: usize = 99;

/// Row widths that the run-length code can express; others are stored flat.
const RLE_WIDTHS: std::ops::RangeInclusive<usize> = 8..=0x7fff;

pub(super) fn write(
    file: &mut BufWriter<File>,
    path: &Path,
    grid: Equirect,
    options: &WriteOptions,
    run: impl FnOnce(Accept<'_>) -> Result<()>,
) -> Result<()> {
    let io = |e| Error::io(path, "write", e);
    // some readers take the format for the first line of the header
    let mut header = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nSOFTWARE={SOFTWARE}\n");
    let mut digest = None;
    for (name, value) in texts(options, 1.0, |name| MAX_LINE.saturating_sub(name.len() + 1))? {
        if name == PIXEL_DIGEST {
            digest = Some((PixelDigest::new(grid), header.len() + name.len() + 1));
        }
        if name.is_empty()
            || name.starts_with('#')
            || name.contains(['=', '\n', '\r'])
            || value.contains(['\n', '\r'])
        {
            return Err(Error::invalid(format!(
                "{name:?} = {value:?} cannot be a line of a Radiance header"
            )));
        }
        header.push_str(&format!("{name}={value}\n"));
    }
    let Equirect { width, height } = grid;
    header.push_str(&format!("\n-Y {height} +X {width}\n"));
    file.write_all(header.as_bytes()).map_err(io)?;
    let (mut row, mut bytes) = (0, Vec::new());
    run(&mut |rows| {
        for pixels in rows.chunks_exact(width) {
            bytes.clear();
            let digest = digest.as_mut().map(|(digest, _)| digest);
            encode_row(pixels, &mut bytes, digest).map_err(|column| {
                let pixel = pixels[column];
                Error::invalid(format!(
                    "pixel ({column}, {row}) is {pixel:?}; Radiance holds 0 to 1.7e38 only"
                ))
            })?;
            file.write_all(&bytes).map_err(io)?;
            row += 1;
        }
        Ok(())
    })?;
    let Some((digest, at)) = digest else { return Ok(()) };
    let put = file.seek(SeekFrom::Start(at as u64)).and_then(|_| file.write_all(digest.finish().as_bytes()));
    put.map_err(io)
}

/// One row, which the digest sees as it is read; the column of a pixel that RGBE cannot hold otherwise.
fn encode_row(pixels: &[[f32; 3]], out: &mut Vec<u8>, digest: Option<&mut PixelDigest>) -> Result<(), usize> {
    let mut rgbe = Vec::with_capacity(pixels.len());
    for (column, &pixel) in pixels.iter().enumerate() {
        rgbe.push(encode(pixel).ok_or(column)?);
    }
    if let Some(digest) = digest {
        digest.update(&rgbe.iter().map(|pixel| decode(*pixel)).collect::<Vec<_>>());
    }
    if !RLE_WIDTHS.contains(&pixels.len()) {
        out.extend_from_slice(rgbe.as_flattened());
        return Ok(());
    }
    out.extend([2, 2, (pixels.len() >> 8) as u8, (pixels.len() & 255) as u8]);
    for component in 0..4 {
        let plane: Vec<u8> = rgbe.iter().map(|pixel| pixel[component]).collect();
        encode_runs(&plane, out);
    }
    Ok(())
}

/// Shared exponent; the largest component gets the full eight bits, all are rounded to nearest.
fn encode(pixel: [f32; 3]) -> Option<[u8; 4]> {
    let largest = pixel.into_iter().fold(0f32, f32::max);
    if pixel.iter().any(|v| v.is_sign_negative() && *v != 0.0) {
        return None;
    }
    if largest == 0.0 {
        return Some([0; 4]);
    }
    // 2^(e − 1) ≤ largest < 2^e
    let mut e = f64::from(largest).log2().floor() as i32 + 1;
    if f64::from(largest) * f64::from(8 - e).exp2() >= 255.5 {
        e += 1;
    }
    if e > 127 {
        return None;
    }
    if e < -127 {
        return Some([0; 4]);
    }
    let scale = f64::from(8 - e).exp2();
    let [r, g, b] = pixel.map(|v| (f64::from(v) * scale).round() as u8);
    Some([r, g, b, (e + 128) as u8])
}

/// What readers make of a pixel.
fn decode([r, g, b, e]: [u8; 4]) -> [f32; 3] {
    let scale = f32::exp2(f32::from(e) - 136.0);
    [r, g, b].map(|v| f32::from(v) * scale)
}

/// Runs of four or more equal bytes as (128 + length, byte), the rest as (length, bytes …), 127 and 128 at most.
fn encode_runs(bytes: &[u8], out: &mut Vec<u8>) {
    let run_at = |i: usize| bytes[i..].iter().take(127).take_while(|&&b| b == bytes[i]).count();
    let mut i = 0;
    while i < bytes.len() {
        let run = run_at(i);
        if run >= 4 {
            out.extend([128 + run as u8, bytes[i]]);
            i += run;
            continue;
        }
        let start = i;
        while i < bytes.len() && i - start < 128 && run_at(i) < 4 {
            i += 1;
        }
        out.push((i - start) as u8);
        out.extend_from_slice(&bytes[start..i]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rgbe_by_hand() {
        assert_eq!(encode([1.0, 0.5, 0.25]), Some([128, 64, 32, 129]));
        assert_eq!(encode([0.0; 3]), Some([0; 4]));
        // rounds up to the next power of two
        assert_eq!(encode([0.999_9, 0.0, 0.0]), Some([128, 0, 0, 129]));
        assert_eq!(encode([-1.0, 1.0, 1.0]), None);
        assert_eq!(encode([f32::MAX, 0.0, 0.0]), None);
        assert_eq!(encode([1e-40, 0.0, 0.0]), Some([0; 4]));
    }

    #[test]
    fn runs_by_hand() {
        let mut out = Vec::new();
        encode_runs(&[7, 7, 7, 7, 7, 1, 2, 2, 3, 3, 3, 3], &mut out);
        assert_eq!(out, [133, 7, 3, 1, 2, 2, 132, 3]);
        out.clear();
        encode_runs(&[9; 300], &mut out);
        assert_eq!(out, [255, 9, 255, 9, 128 + 46, 9]);
    }
}
