//! Radiance RGBE with the run-length code of its second version, row by row.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use super::{Accept, SOFTWARE, WriteOptions};
use crate::{Error, Result};
use veni_light::sphere::Equirect;

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
    let mut header = format!("#?RADIANCE\nSOFTWARE={SOFTWARE}\n");
    for (name, value) in &options.attributes {
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
    header.push_str(&format!("FORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n"));
    file.write_all(header.as_bytes()).map_err(io)?;
    let (mut row, mut bytes) = (0, Vec::new());
    run(&mut |rows| {
        for pixels in rows.chunks_exact(width) {
            bytes.clear();
            encode_row(pixels, &mut bytes).map_err(|column| {
                let pixel = pixels[column];
                Error::invalid(format!(
                    "pixel ({column}, {row}) is {pixel:?}; Radiance holds 0 to 1.7e38 only"
                ))
            })?;
            file.write_all(&bytes).map_err(io)?;
            row += 1;
        }
        Ok(())
    })
}

/// One row; the column of a pixel that RGBE cannot hold otherwise.
fn encode_row(pixels: &[[f32; 3]], out: &mut Vec<u8>) -> Result<(), usize> {
    let mut rgbe = Vec::with_capacity(pixels.len());
    for (column, &pixel) in pixels.iter().enumerate() {
        rgbe.push(encode(pixel).ok_or(column)?);
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
