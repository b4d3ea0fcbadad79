//! A file's content as one short name.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use veni_light::digest::Digest;

use crate::{Error, Result};

/// The digest of a file's bytes.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read.
pub fn content_hash(path: &Path) -> Result<Digest> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let mut file = BufReader::new(file);
    let (mut hash, mut buffer) = (Digest::build(), vec![0; 1 << 16]);
    loop {
        match file.read(&mut buffer).map_err(|e| Error::io(path, "read", e))? {
            0 => break,
            n => hash = hash.update(&buffer[..n]),
        }
    }
    Ok(hash.finish())
}
