//! The sequence header of an AV1 stream, as far as the colours (AV1 specification, 5.5).
//!
//! The decoder's own accessors of the code points panic on values that H.273 reserves, so they are read here.

use super::Coding;
use crate::{Error, Result};

/// Type of the unit that holds a sequence header.
const SEQUENCE_HEADER: u8 = 1;
/// "Choose for every frame."
const SELECT: u32 = 2;
/// Code point for "unspecified".
const UNSPECIFIED: u8 = 2;

/// What a stream says of all its frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sequence {
    /// Largest width and height.
    pub(super) size: [u64; 2],
    pub(super) coding: Coding,
}

impl Sequence {
    /// # Errors
    /// [`Error::Invalid`] if there is no whole sequence header.
    pub(super) fn of(mut stream: &[u8]) -> Result<Self> {
        let missing =
            || Error::invalid("damaged or truncated AVIF file: its AV1 stream has no sequence header");
        while !stream.is_empty() {
            let (kind, content, rest) = unit(stream).ok_or_else(missing)?;
            if kind == SEQUENCE_HEADER {
                return Self::parse(&mut Bits { bytes: content, at: 0 }).ok_or_else(missing);
            }
            stream = rest;
        }
        Err(missing())
    }

    fn parse(bits: &mut Bits<'_>) -> Option<Self> {
        let profile = bits.take(3)?;
        bits.take(1)?;
        let reduced = bits.flag()?;
        if reduced {
            bits.take(5)?;
        } else {
            operating_points(bits)?;
        }
        let lengths = [bits.take(4)? + 1, bits.take(4)? + 1];
        let size = [1 + u64::from(bits.take(lengths[0])?), 1 + u64::from(bits.take(lengths[1])?)];
        if !reduced && bits.flag()? {
            bits.take(7)?;
        }
        bits.take(3)?;
        if !reduced {
            tools(bits)?;
        }
        bits.take(3)?;
        Some(Self { size, coding: coding(bits, profile)? })
    }
}

/// Type and content of the first unit, and what follows it.
fn unit(stream: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (&head, mut rest) = stream.split_first()?;
    if head & 4 != 0 {
        rest = rest.get(1..)?;
    }
    let mut length = rest.len();
    if head & 2 != 0 {
        let mut value = 0_u64;
        for shift in (0..56).step_by(7) {
            let (&byte, after) = rest.split_first()?;
            rest = after;
            value |= u64::from(byte & 0x7F) << shift;
            if byte & 0x80 == 0 {
                break;
            }
        }
        length = usize::try_from(value).ok()?;
    }
    let content = rest.get(..length)?;
    Some((head >> 3 & 15, content, &rest[length..]))
}

fn operating_points(bits: &mut Bits<'_>) -> Option<()> {
    let (mut decoder_model, mut delay_bits) = (false, 0);
    if bits.flag()? {
        // timing
        bits.take(32)?;
        bits.take(32)?;
        if bits.flag()? {
            bits.exponential()?;
        }
        decoder_model = bits.flag()?;
        if decoder_model {
            delay_bits = bits.take(5)? + 1;
            bits.take(32)?;
            bits.take(10)?;
        }
    }
    let delays = bits.flag()?;
    for _ in 0..=bits.take(5)? {
        bits.take(12)?;
        if bits.take(5)? > 7 {
            bits.take(1)?;
        }
        if decoder_model && bits.flag()? {
            bits.take(delay_bits)?;
            bits.take(delay_bits)?;
            bits.take(1)?;
        }
        if delays && bits.flag()? {
            bits.take(4)?;
        }
    }
    Some(())
}

/// What frames that refer to others need.
fn tools(bits: &mut Bits<'_>) -> Option<()> {
    bits.take(4)?;
    let order = bits.flag()?;
    if order {
        bits.take(2)?;
    }
    let screen = if bits.flag()? { SELECT } else { bits.take(1)? };
    if screen > 0 && !bits.flag()? {
        bits.take(1)?;
    }
    if order {
        bits.take(3)?;
    }
    Some(())
}

fn coding(bits: &mut Bits<'_>, profile: u32) -> Option<Coding> {
    let deep = bits.flag()?;
    if profile == 2 && deep {
        bits.take(1)?;
    }
    let grey = profile != 1 && bits.flag()?;
    let [primaries, transfer, matrix] = match bits.flag()? {
        true => [bits.take(8)? as u8, bits.take(8)? as u8, bits.take(8)? as u8],
        false => [UNSPECIFIED; 3],
    };
    // sRGB in green, blue and red has no flag of its range
    let identity = !grey && [primaries, transfer, matrix] == [1, 13, 0];
    let full_range = if identity { true } else { bits.flag()? };
    Some(Coding { transfer, matrix, full_range })
}

/// Bits of a stream, the highest of a byte first.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Bits<'_> {
    /// A number of at most 32 bits.
    fn take(&mut self, count: u32) -> Option<u32> {
        let mut value = 0;
        for _ in 0..count {
            let byte = self.bytes.get(self.at / 8)?;
            value = value << 1 | u32::from(byte >> (7 - self.at % 8) & 1);
            self.at += 1;
        }
        Some(value)
    }

    fn flag(&mut self) -> Option<bool> {
        self.take(1).map(|bit| bit == 1)
    }

    /// A number in the Exp-Golomb code, stepped over.
    fn exponential(&mut self) -> Option<()> {
        let mut zeros = 0;
        while !self.flag()? {
            zeros += 1;
        }
        (zeros < 32).then(|| self.take(zeros))?.map(|_| ())
    }
}
