//! The one error type of this crate: three kinds a caller can act on.

use std::fmt;
use std::path::{Path, PathBuf};

/// What went wrong. Messages name the file, the offending value and the remedy.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// The data violates its format or a documented requirement (truncated file, NaN, wrong shape).
    Invalid(String),
    /// The data is well formed, but not something this crate reads or does.
    Unsupported(String),
    /// The operating system refused.
    Io {
        /// The file or folder concerned.
        path: PathBuf,
        /// What was being done, as an infinitive without "to" ("read", "create").
        action: &'static str,
        /// The system's own word. It is part of the message, so it is no `source` beside it.
        cause: std::io::Error,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Invalid(message) | Self::Unsupported(message) => f.write_str(message),
            Self::Io { path, action, cause } => write!(f, "{}: cannot {action}: {cause}", path.display()),
        }
    }
}

impl std::error::Error for Error {}

/// A result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// An [`Error::Invalid`] from anything printable.
    pub fn invalid(message: impl Into<String>) -> Self {
        Self::Invalid(message.into())
    }

    /// An [`Error::Unsupported`] from anything printable.
    pub fn unsupported(message: impl Into<String>) -> Self {
        Self::Unsupported(message.into())
    }

    /// An [`Error::Io`] for `path`, e.g. `.map_err(|e| Error::io(path, "read", e))`.
    pub fn io(path: impl AsRef<Path>, action: &'static str, cause: std::io::Error) -> Self {
        Self::Io { path: path.as_ref().to_path_buf(), action, cause }
    }

    /// The same error with `path: ` put before an invalid or unsupported message that lacks it.
    #[must_use]
    pub fn in_file(self, path: impl AsRef<Path>) -> Self {
        let path = path.as_ref().display();
        match self {
            Self::Invalid(m) => Self::Invalid(format!("{path}: {m}")),
            Self::Unsupported(m) => Self::Unsupported(format!("{path}: {m}")),
            io @ Self::Io { .. } => io,
        }
    }
}
