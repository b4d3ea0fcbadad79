//! What the chunks of a PNG (third edition, 2025) say of its colours, read before any pixel.

use std::io::{BufRead, ErrorKind, Read, Seek};

use super::display::Tags;
use crate::{Error, Result};

/// Chunks read whole; each of them has a size of its own.
const LARGEST: u32 = 1 << 10;

/// The colour chunks before the pixels; rewinds. Text, profile and EXIF are left to the decoder.
pub(super) fn tags(file: &mut (impl BufRead + Seek)) -> Result<Tags> {
    let read = |e: std::io::Error| match e.kind() {
        ErrorKind::UnexpectedEof => Error::invalid("truncated PNG file"),
        _ => Error::invalid(format!("damaged PNG file: {e}")),
    };
    let mut tags = Tags::default();
    let mut signature = [0; 8];
    file.read_exact(&mut signature).map_err(read)?;
    loop {
        let mut head = [0; 8];
        file.read_exact(&mut head).map_err(read)?;
        let [a, b, c, d, name @ ..] = head;
        let length = u32::from_be_bytes([a, b, c, d]);
        let wanted = matches!(&name, b"cICP" | b"gAMA" | b"cHRM" | b"sRGB" | b"acTL");
        if matches!(&name, b"IDAT" | b"IEND") {
            break;
        }
        let mut body = Vec::new();
        if wanted && length <= LARGEST {
            file.take(u64::from(length)).read_to_end(&mut body).map_err(read)?;
            file.seek_relative(4).map_err(read)?;
        } else {
            file.seek_relative(i64::from(length) + 4).map_err(read)?;
        }
        match &name {
            b"cICP" => {
                let &[primaries, transfer, matrix, range] = body.as_slice() else {
                    return Err(Error::invalid("damaged PNG file: a cICP chunk that is not of 4 bytes"));
                };
                if matrix != 0 || range != 1 {
                    return Err(Error::unsupported(format!(
                        "its cICP chunk says matrix {matrix} and range flag {range}; only RGB values of full range are read"
                    )));
                }
                tags.cicp = Some([primaries, transfer]);
            }
            b"gAMA" => match numbers(&body).first() {
                Some(0.0) => {
                    tags.notes.push("its gAMA chunk says 0, which is no exponent: it is ignored".to_owned());
                }
                value => tags.gamma = value.map(|v| v / 100_000.0),
            },
            b"iCCP" => tags.has_profile = true,
            b"cHRM" => {
                if let [wx, wy, rx, ry, gx, gy, bx, by] = numbers(&body)[..] {
                    let pairs = [[rx, ry], [gx, gy], [bx, by], [wx, wy]];
                    tags.chromaticities = Some(pairs.map(|p| p.map(|v| v / 100_000.0)));
                }
            }
            b"sRGB" => tags.srgb = true,
            b"acTL" => {
                tags.notes.push("is animated (APNG): its still image is taken".to_owned());
            }
            _ => {}
        }
    }
    file.rewind().map_err(read)?;
    Ok(tags)
}

fn numbers(body: &[u8]) -> Vec<f64> {
    body.as_chunks::<4>().0.iter().map(|bytes| f64::from(u32::from_be_bytes(*bytes))).collect()
}
