//! A file's content as one short name.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::{Error, Result};

/// The first 16 hexadecimal digits of the SHA-256 of a file's bytes.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read.
pub fn content_hash(path: &Path) -> Result<String> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let mut file = BufReader::new(file);
    let (mut hash, mut buffer) = (Sha256::new(), vec![0; 1 << 16]);
    loop {
        match file.read(&mut buffer).map_err(|e| Error::io(path, "read", e))? {
            0 => break,
            n => hash.update(&buffer[..n]),
        }
    }
    Ok(hash.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect())
}
