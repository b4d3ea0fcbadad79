//! What the chunks of a PNG (third edition, 2025) say of its values, read before any pixel.

mod chunks;
mod text;

use std::io::{BufRead, Seek};

use self::chunks::{Chunk, Chunks};
use self::text::Carried;
use super::display::Tags;
use super::xmp;
use crate::limits::MAX_METADATA_BYTES;
use crate::{Error, Result};

/// Colour chunks are read whole up to this; each of them has a size of its own.
const LARGEST: u32 = 1 << 10;

/// Chunks that stand once, and before the pixels.
const COLOURS: &[&[u8; 4]] = &[b"cICP", b"gAMA", b"cHRM", b"sRGB", b"iCCP"];

/// All of the file but its pixels: metadata may stand behind them. The profile itself is left to the decoder. Rewinds.
pub(super) fn tags(file: &mut (impl BufRead + Seek)) -> Result<Tags> {
    let mut tags = Tags::default();
    let (mut seen, mut unpacked) = (Vec::new(), 0);
    // eXIf counts before what text carries, wherever it stands
    let mut carried = None;
    let mut chunks = Chunks::new(file)?;
    while let Some(Chunk { name, body, sound }) = chunks.next(wanted)? {
        let is_text = matches!(&name, b"iTXt" | b"tEXt" | b"zTXt");
        let keyword = text::keyword(&body).filter(|_| is_text);
        let once = COLOURS.contains(&&name) || &name == b"eXIf";
        if (is_text && keyword.is_none()) || (chunks.pixels && COLOURS.contains(&&name)) {
            continue;
        }
        let called = String::from_utf8_lossy(&name);
        if !sound {
            note(&mut tags, format!("its {called} chunk has a wrong checksum: it is ignored"));
            continue;
        }
        if once && seen.contains(&name) {
            note(&mut tags, format!("has a second {called} chunk: it is ignored"));
            continue;
        }
        seen.extend(once.then_some(name));
        match &name {
            b"eXIf" => tags.exif = Some(body),
            b"iCCP" => tags.has_profile = true,
            b"acTL" => note(&mut tags, "is animated (APNG): its still image is taken".to_owned()),
            _ => match keyword {
                None => colour(&mut tags, &name, &body)?,
                Some(keyword) => match text::carried(&name, keyword, &body, &mut unpacked)? {
                    Carried::Exif(exif) => {
                        carried.get_or_insert(exif);
                    }
                    Carried::Xmp(packet) => tags.packets.push(xmp::text(&packet)),
                    Carried::Damaged => {
                        note(
                            &mut tags,
                            format!("its text chunk {keyword:?} cannot be unpacked: it is ignored"),
                        );
                    }
                },
            },
        }
    }
    tags.exif = tags.exif.take().or(carried);
    file.rewind().map_err(|e| Error::invalid(format!("damaged PNG file: {e}")))?;
    Ok(tags)
}

/// Once, however many chunks give reason for it.
fn note(tags: &mut Tags, sentence: String) {
    if !tags.notes.contains(&sentence) {
        tags.notes.push(sentence);
    }
}

/// Whether a chunk is read; all together are no more than the walk before this one let pass.
fn wanted(name: &[u8; 4], length: u32) -> bool {
    match name {
        b"cICP" | b"gAMA" | b"cHRM" | b"sRGB" => length <= LARGEST,
        b"iCCP" | b"eXIf" | b"iTXt" | b"tEXt" | b"zTXt" => u64::from(length) <= MAX_METADATA_BYTES,
        _ => false,
    }
}

fn colour(tags: &mut Tags, name: &[u8; 4], body: &[u8]) -> Result<()> {
    match name {
        b"cICP" => {
            let &[primaries, transfer, matrix, range] = body else {
                return Err(Error::invalid("damaged PNG file: a cICP chunk that is not of 4 bytes"));
            };
            if matrix != 0 || range != 1 {
                return Err(Error::unsupported(format!(
                    "its cICP chunk says matrix {matrix} and range flag {range}; only RGB values of full range are read"
                )));
            }
            tags.cicp = Some([primaries, transfer]);
        }
        b"gAMA" => match numbers(body).first() {
            Some(0.0) => {
                note(tags, "its gAMA chunk says 0, which is not an exponent: it is ignored".to_owned());
            }
            value => tags.gamma = value.map(|v| v / 100_000.0),
        },
        b"cHRM" => match numbers(body)[..] {
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] => {
                note(
                    tags,
                    "its cHRM chunk says 0 throughout, which is not a colour: it is ignored".to_owned(),
                );
            }
            [wx, wy, rx, ry, gx, gy, bx, by] => {
                let pairs = [[rx, ry], [gx, gy], [bx, by], [wx, wy]];
                tags.chromaticities = Some(pairs.map(|p| p.map(|v| v / 100_000.0)));
            }
            _ => {}
        },
        b"sRGB" => tags.srgb = true,
        _ => {}
    }
    Ok(())
}

fn numbers(body: &[u8]) -> Vec<f64> {
    body.as_chunks::<4>().0.iter().map(|bytes| f64::from(u32::from_be_bytes(*bytes))).collect()
}
