//! The chunks of a PNG file (third edition, 5.3), one after the other, with the checksum of those that are read.

use std::io::{BufRead, ErrorKind, Read, Result as IoResult, Seek};

use crate::{Error, Result};

/// One chunk; of those that nobody wants only the name.
pub(super) struct Chunk {
    pub(super) name: [u8; 4],
    pub(super) body: Vec<u8>,
    /// Whether its checksum is right; true of what is not read.
    pub(super) sound: bool,
}

/// A walk from the signature to `IEND`.
pub(super) struct Chunks<'a, R> {
    file: &'a mut R,
    /// A chunk of pixels was passed.
    pub(super) pixels: bool,
}

impl<'a, R: BufRead + Seek> Chunks<'a, R> {
    /// From the beginning of the file.
    pub(super) fn new(file: &'a mut R) -> Result<Self> {
        let mut signature = [0; 8];
        file.read_exact(&mut signature).map_err(wrap)?;
        Ok(Self { file, pixels: false })
    }

    /// The next chunk, with its body if it is `wanted` by name and length; nothing at the end. Between chunks behind the pixels a
    /// file may stop: whether enough of it is there, the decoder says.
    pub(super) fn next(&mut self, wanted: impl Fn(&[u8; 4], u32) -> bool) -> Result<Option<Chunk>> {
        let mut head = [0; 8];
        match self.file.read_exact(&mut head) {
            Err(e) if e.kind() == ErrorKind::UnexpectedEof && self.pixels => Ok(None),
            read => read.and_then(|()| self.read(head, wanted)).map_err(wrap),
        }
    }

    fn read(&mut self, head: [u8; 8], wanted: impl Fn(&[u8; 4], u32) -> bool) -> IoResult<Option<Chunk>> {
        let [a, b, c, d, name @ ..] = head;
        let length = u32::from_be_bytes([a, b, c, d]);
        self.pixels |= &name == b"IDAT";
        if &name == b"IEND" {
            return Ok(None);
        }
        if !wanted(&name, length) {
            self.file.seek_relative(i64::from(length) + 4)?;
            return Ok(Some(Chunk { name, body: Vec::new(), sound: true }));
        }
        let mut body = Vec::new();
        self.file.by_ref().take(u64::from(length)).read_to_end(&mut body)?;
        let mut sum = [0; 4];
        self.file.read_exact(&mut sum)?;
        let sound = crc(&name, &body) == u32::from_be_bytes(sum);
        Ok(Some(Chunk { name, body, sound }))
    }
}

fn wrap(e: std::io::Error) -> Error {
    match e.kind() {
        ErrorKind::UnexpectedEof => Error::invalid("truncated PNG file"),
        _ => Error::invalid(format!("damaged PNG file: {e}")),
    }
}

/// CRC-32 (ISO 3309) of each byte.
const TABLE: [u32; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let (mut sum, mut bit) = (byte as u32, 0);
        while bit < 8 {
            sum = if sum & 1 == 1 { sum >> 1 ^ 0xEDB8_8320 } else { sum >> 1 };
            bit += 1;
        }
        table[byte] = sum;
        byte += 1;
    }
    table
};

/// The checksum of a chunk, over its name and its body.
fn crc(name: &[u8], body: &[u8]) -> u32 {
    let step = |sum: u32, byte: &u8| TABLE[usize::from(sum as u8 ^ byte)] ^ sum >> 8;
    !body.iter().fold(name.iter().fold(!0, step), step)
}
