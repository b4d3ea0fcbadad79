//! Limits of what is read, each with its reason. They are checked before anything of the size in question is allocated, and
//! refused as [`Error::TooLarge`] with the value and the limit.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::text::decode;
use crate::{Error, Result};

/// Bytes of a model file. The paper's largest model is 88 MB; nothing bigger than this is a model of these sizes, and a
/// wrong path cannot fill the memory.
pub const MAX_MODEL_BYTES: u64 = 1 << 30;

/// Bytes of a model file's header: names, shapes and the configuration. The largest shipped has 30 kB; a megabyte of it
/// costs ten in memory.
pub const MAX_MODEL_HEADER_BYTES: u64 = 4 << 20;

/// Bytes of a latent file; N = 4096 vectors take about 200 kB.
pub const MAX_LATENT_BYTES: u64 = 16 << 20;

/// Compact lights of a latent: eight are taken out of a panorama at most, and a scene between two has those of both.
pub const MAX_LIGHTS: usize = 64;

/// Lobes of a latent, each of which costs every direction about 0.2 % of the network.
pub const MAX_LOBES: usize = 1024;

/// Bytes of a file of settings (TOML). One with everything said has 4 kB.
pub const MAX_SETTINGS_BYTES: u64 = 1 << 20;

/// Samples of an encoder, stripes × samples per stripe: the paper has 32,768, an image of 1,448 rows has 2²⁰ at full
/// resolution in its equal-area heights.
pub const MAX_ENCODER_SAMPLES: u64 = 1 << 20;

/// Numbers that an encoder's buffers hold for one image, 512 MiB: the paper's needs 1.5 million. The size follows from the
/// configuration alone: a file of a few kB can ask for any.
pub const MAX_ENCODER_NUMBERS: u64 = 1 << 27;

/// Condition features of a latent, N · (N + 1) where they are inner products: the paper's 100 vectors have 50,500.
pub const MAX_CONDITION_FEATURES: u64 = 1 << 22;

/// Numbers of one ray's tokens, N × hidden features: the paper's 100 vectors have 12,800. A ray looks at all of them.
pub const MAX_TOKEN_NUMBERS: u64 = 1 << 20;

/// Refuses `value` beyond `limit`; `what` names it with its unit.
///
/// # Errors
/// [`Error::TooLarge`] with both numbers.
pub fn at_most(what: &str, value: u64, limit: u64) -> Result<()> {
    if value <= limit {
        return Ok(());
    }
    Err(Error::beyond(format!("{value} {what} are more than the limit of {limit}"), value, limit))
}

/// All bytes of a file, of which `what` says what it is ("a latent"). A pipe and a file that grows are read up to the limit.
///
/// # Errors
/// [`Error::Io`] if it cannot be read, [`Error::TooLarge`] if it is larger than `limit`.
pub fn read_file(path: &Path, what: &str, limit: u64) -> Result<Vec<u8>> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let size = file.metadata().map_err(|e| Error::io(path, "read", e))?.len();
    let most = if limit >= 1 << 20 { format!("{} MiB", limit >> 20) } else { format!("{limit} bytes") };
    // a device or a pipe that goes on beyond the limit says no size
    let refuse = |value| Error::TooLarge {
        path: Some(path.to_path_buf()),
        message: format!("not {what} (larger than {most})"),
        value,
        limit: Some(limit),
    };
    if size > limit {
        return Err(refuse(Some(size)));
    }
    let mut bytes = Vec::with_capacity(usize::try_from(size).map_err(|_| refuse(Some(size)))?);
    file.take(limit + 1).read_to_end(&mut bytes).map_err(|e| Error::io(path, "read", e))?;
    if bytes.len() as u64 > limit { Err(refuse(None)) } else { Ok(bytes) }
}

/// [`read_file`] as text ([`text::decode`](crate::text::decode)).
///
/// # Errors
/// As [`read_file`]; [`Error::Invalid`] if it is neither UTF-8 nor UTF-16 with its mark.
pub fn read_text(path: &Path, what: &str, limit: u64) -> Result<String> {
    decode(read_file(path, what, limit)?)
        .map_err(|e| Error::invalid(format!("not {what} ({e})")).in_file(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_up_to_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(read_text(&path, "a note", 5).unwrap(), "12345");
        let error = read_text(&path, "a note", 4).unwrap_err();
        assert!(
            matches!(&error, Error::TooLarge { value: Some(5), limit: Some(4), .. })
                && error.to_string().contains("a.txt: not a note (larger than 4"),
            "{error}"
        );
        std::fs::write(&path, [0xFF]).unwrap();
        assert!(read_text(&path, "a note", 5).unwrap_err().to_string().contains("no text"));
        assert!(matches!(read_file(&folder.path().join("none"), "a note", 5), Err(Error::Io { .. })));
        // a device says that it has no bytes, and has no end
        #[cfg(target_os = "linux")]
        assert!(matches!(
            read_file(Path::new("/dev/zero"), "a note", 1000),
            Err(Error::TooLarge { value: None, .. })
        ));
    }
}
