//! Rows of RGBE: flat, with the old run lengths (a pixel 1 1 1 n repeats the one before), or with the new ones, each channel by
//! itself.

use std::io::{BufRead, Error, ErrorKind, Result};

/// Widths that may have the new run lengths.
const NEW: std::ops::Range<usize> = 8..32768;

/// How rows lie in the picture: the two axes of the resolution line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layout {
    /// Whether the first axis, which counts rows, is Y.
    upright: bool,
    /// For each axis in the order of the line: its length, and whether it runs with the picture (down, to the right).
    axes: [(usize, bool); 2],
}

impl Layout {
    /// "-Y 512 +X 1024" and its seven kin.
    pub(super) fn parse(line: &str) -> Option<Self> {
        let words: Vec<_> = line.split_whitespace().collect();
        let &[first, rows, second, columns] = words.as_slice() else { return None };
        let upright = match (first.get(1..)?, second.get(1..)?) {
            ("Y", "X") => true,
            ("X", "Y") => false,
            _ => return None,
        };
        let axis = |name: &str, length: &str| {
            let runs = match name {
                "-Y" | "+X" => true,
                "+Y" | "-X" => false,
                _ => return None,
            };
            Some((length.parse::<u32>().ok()? as usize, runs))
        };
        Some(Self { upright, axes: [axis(first, rows)?, axis(second, columns)?] })
    }

    /// Width and height.
    pub(super) fn size(self) -> [usize; 2] {
        let [(rows, _), (columns, _)] = self.axes;
        if self.upright { [columns, rows] } else { [rows, columns] }
    }

    /// Whether rows are stored as they are shown.
    fn is_plain(self) -> bool {
        self.upright && self.axes.iter().all(|(_, runs)| *runs)
    }

    /// Where a stored pixel is shown.
    fn place(self, row: usize, column: usize) -> usize {
        let at = |index: usize, (length, runs): (usize, bool)| if runs { index } else { length - 1 - index };
        let (first, second) = (at(row, self.axes[0]), at(column, self.axes[1]));
        let [width, _] = self.size();
        if self.upright { first * width + second } else { second * width + first }
    }
}

/// Reads all rows into `pixels`, upright.
pub(super) fn read(file: &mut impl BufRead, layout: Layout, pixels: &mut [[f32; 3]]) -> Result<()> {
    let [(rows, _), (columns, _)] = layout.axes;
    if rows == 0 || columns == 0 {
        return Ok(());
    }
    let mut row = vec![[0u8; 4]; columns];
    let mut planes = vec![0u8; 4 * columns];
    let mut turned = vec![[0f32; 3]; columns];
    for at in 0..rows {
        let mut start = [0; 4];
        file.read_exact(&mut start)?;
        let new = is_new(start, columns);
        if new {
            new_row(file, &mut planes)?;
        } else {
            old_row(file, start, &mut row)?;
        }
        let plain = layout.is_plain();
        let line = if plain { &mut pixels[at * columns..][..columns] } else { &mut turned[..] };
        if new {
            let (reds, rest) = planes.split_at(columns);
            let (greens, rest) = rest.split_at(columns);
            let (blues, exponents) = rest.split_at(columns);
            let colours = reds.iter().zip(greens).zip(blues).zip(exponents);
            line.iter_mut().zip(colours).for_each(|(to, (((r, g), b), e))| *to = radiance([*r, *g, *b, *e]));
        } else {
            line.iter_mut().zip(&row).for_each(|(to, from)| *to = radiance(*from));
        }
        if !plain {
            turned.iter().enumerate().for_each(|(column, value)| pixels[layout.place(at, column)] = *value);
        }
    }
    Ok(())
}

/// Mantissa × 2^(e − 136), as Radiance and most others define it.
fn radiance([r, g, b, e]: [u8; 4]) -> [f32; 3] {
    // 2^(e − 128) from its bits; e = 1 is below the normal numbers, and e = 0 is black
    let power = f32::from_bits(if e > 1 { (u32::from(e) - 1) << 23 } else { u32::from(e) << 22 });
    [r, g, b].map(|v| power * (1.0 / 256.0) * f32::from(v))
}

/// Whether a row begins with 2 2 and its own length; otherwise these are a pixel's.
fn is_new(start: [u8; 4], columns: usize) -> bool {
    start[..2] == [2, 2]
        && NEW.contains(&columns)
        && usize::from(u16::from_be_bytes([start[2], start[3]])) == columns
}

/// Each of the four channels by itself: runs of one value (count + 128, value) and of several (count, values).
fn new_row(file: &mut impl BufRead, planes: &mut [u8]) -> Result<()> {
    let columns = planes.len() / 4;
    for plane in planes.chunks_exact_mut(columns) {
        let mut at = 0;
        while at < columns {
            let count = usize::from(byte(file)?);
            let (count, repeats) = if count > 128 { (count - 128, true) } else { (count, false) };
            let run = plane.get_mut(at..at + count).filter(|run| !run.is_empty());
            let run = run.ok_or_else(|| {
                Error::new(ErrorKind::InvalidData, format!("a run of {count} at column {at} of {columns}"))
            })?;
            if repeats {
                run.fill(byte(file)?);
            } else {
                file.read_exact(run)?;
            }
            at += count;
        }
    }
    Ok(())
}

/// Flat pixels and old runs, of which several in a row count 1, 256, 65,536 times as much.
fn old_row(file: &mut impl BufRead, first: [u8; 4], row: &mut [[u8; 4]]) -> Result<()> {
    let (mut at, mut scale, mut pixel) = (0, 1usize, first);
    loop {
        if at > 0 && pixel[..3] == [1, 1, 1] {
            let count = usize::from(pixel[3]).saturating_mul(scale);
            let previous = row[at - 1];
            let run = row.get_mut(at..at.saturating_add(count)).ok_or_else(|| {
                Error::new(
                    ErrorKind::InvalidData,
                    format!("a run of {count} at column {at}, beyond the row's end"),
                )
            })?;
            run.fill(previous);
            (at, scale) = (at + count, scale.saturating_mul(256));
        } else {
            row[at] = pixel;
            (at, scale) = (at + 1, 1);
        }
        if at >= row.len() {
            return Ok(());
        }
        file.read_exact(&mut pixel)?;
    }
}

fn byte(file: &mut impl BufRead) -> Result<u8> {
    let mut byte = [0];
    file.read_exact(&mut byte)?;
    Ok(byte[0])
}
