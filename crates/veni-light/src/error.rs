//! The one error type of this crate: kinds that a caller can act on.

use std::path::{Path, PathBuf};

/// What went wrong. Messages name the file, the offending value and the remedy, in the words of the library: which
/// option or button a program has for it, the program adds. Files are fields besides, for who looks for them.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The data violates its format or a documented requirement (truncated file, NaN, wrong shape).
    #[error("{}{message}", before(path.as_deref()))]
    Invalid {
        /// The file concerned, or what stands for one (the name of an embedded model), once it is known.
        path: Option<PathBuf>,
        /// What is wrong with it.
        message: String,
    },
    /// The data is well formed, but not something this crate reads or does.
    #[error("{}{message}", before(path.as_deref()))]
    Unsupported {
        /// As of [`Error::Invalid`].
        path: Option<PathBuf>,
        /// What is not read or done.
        message: String,
    },
    /// An image whose format holds a display's range, where radiance is needed.
    #[error("{}: {format} holds no high dynamic range{}; expand such panoramas into EXR files first", path.display(), in_brackets(notes))]
    LowRange {
        /// The image.
        path: PathBuf,
        /// Its format ("PNG").
        format: &'static str,
        /// What it says that is not applied: there may be high dynamic range in it after all.
        notes: Vec<String>,
    },
    /// A file with several layers, of which one must be named, or without the one that was.
    #[error("{}: {}", path.display(), layers_message(wanted.as_deref(), layers))]
    Layers {
        /// The file, once it is known.
        path: PathBuf,
        /// The layer that was named and is not there.
        wanted: Option<String>,
        /// The layers that there are.
        layers: Vec<String>,
    },
    /// A file that was to be written is there already, and [`Overwrite`](crate::output::Overwrite) refuses.
    #[error("{}: exists already", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// Another process works in the folder, and only one may.
    #[error("{}: another process is at work here{}", path.display(), owner.as_ref().map(|o| format!(" ({o})")).unwrap_or_default())]
    Busy {
        /// The locked file.
        path: PathBuf,
        /// What it left in it.
        owner: Option<String>,
    },
    /// The data is, or claims to be, larger than a limit that protects the memory.
    #[error("{}{message}", before(path.as_deref()))]
    TooLarge {
        /// As of [`Error::Invalid`].
        path: Option<PathBuf>,
        /// What is larger than what, with the unit of both.
        message: String,
        /// What was found, where it was counted to its end.
        value: Option<u64>,
        /// The most that is taken, where it is one number.
        limit: Option<u64>,
    },
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
    /// The operating system refused.
    #[error("{}: cannot {action}", path.display())]
    Io {
        /// The file or folder concerned.
        path: PathBuf,
        /// What was being done, as an infinitive without "to" ("read", "create").
        action: &'static str,
        /// The system's own word. The message leaves it to whoever prints the chain, or to [`Error::with_source`].
        source: std::io::Error,
    },
}

/// A result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// An [`Error::Invalid`] from anything printable.
    pub fn invalid(message: impl Into<String>) -> Self {
        Self::Invalid { path: None, message: message.into() }
    }

    /// An [`Error::Unsupported`] from anything printable.
    pub fn unsupported(message: impl Into<String>) -> Self {
        Self::Unsupported { path: None, message: message.into() }
    }

    /// An [`Error::TooLarge`] from anything printable, where no two numbers were compared.
    pub fn too_large(message: impl Into<String>) -> Self {
        Self::TooLarge { path: None, message: message.into(), value: None, limit: None }
    }

    /// An [`Error::TooLarge`] of a `value` beyond the `limit`, both of which the message should say.
    pub fn beyond(message: impl Into<String>, value: u64, limit: u64) -> Self {
        Self::TooLarge { path: None, message: message.into(), value: Some(value), limit: Some(limit) }
    }

    /// An [`Error::Layers`] of a file that [`Error::in_file`] will name.
    pub fn layers(wanted: Option<impl Into<String>>, layers: Vec<String>) -> Self {
        Self::Layers { path: PathBuf::new(), wanted: wanted.map(Into::into), layers }
    }

    /// An [`Error::Exists`] for `path`.
    pub fn exists(path: impl AsRef<Path>) -> Self {
        Self::Exists { path: path.as_ref().to_path_buf() }
    }

    /// An [`Error::Io`] for `path`, e.g. `.map_err(|e| Error::io(path, "read", e))`.
    pub fn io(path: impl AsRef<Path>, action: &'static str, source: std::io::Error) -> Self {
        Self::Io { path: path.as_ref().to_path_buf(), action, source }
    }

    /// The same error of the file `path`, which is then said before its message. An error of [`Error::Invalid`],
    /// [`Error::Unsupported`] or [`Error::TooLarge`] that names another file keeps that one in its message (a panorama, and
    /// the model that does not encode it); the other kinds keep the path that they have.
    #[must_use]
    pub fn in_file(self, path: impl AsRef<Path>) -> Self {
        let path = path.as_ref();
        let place = |known: Option<PathBuf>, message: String| match known {
            Some(known) if known != path => format!("{}: {message}", known.display()),
            _ => message,
        };
        let named = Some(path.to_path_buf());
        match self {
            Self::Invalid { path, message } => Self::Invalid { message: place(path, message), path: named },
            Self::Unsupported { path, message } => {
                Self::Unsupported { message: place(path, message), path: named }
            }
            Self::TooLarge { path, message, value, limit } => {
                Self::TooLarge { message: place(path, message), path: named, value, limit }
            }
            Self::Layers { path: known, wanted, layers } if known.as_os_str().is_empty() => {
                Self::Layers { path: path.to_path_buf(), wanted, layers }
            }
            other @ (Self::Layers { .. }
            | Self::LowRange { .. }
            | Self::Exists { .. }
            | Self::Busy { .. }
            | Self::Cancelled
            | Self::Io { .. }) => other,
        }
    }

    /// The message and, behind it, what the system said: for where there is one line and no chain.
    pub fn with_source(&self) -> String {
        match self {
            Self::Io { source, .. } => format!("{self}: {source}"),
            _ => self.to_string(),
        }
    }
}

/// A path as it stands before a message.
fn before(path: Option<&Path>) -> String {
    path.map(|path| format!("{}: ", path.display())).unwrap_or_default()
}

fn in_brackets(notes: &[String]) -> String {
    if notes.is_empty() { String::new() } else { format!(" ({})", notes.join("; ")) }
}

fn layers_message(wanted: Option<&str>, layers: &[String]) -> String {
    let list = layers.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ");
    match wanted {
        Some(wanted) => format!("no layer {wanted:?} that is a picture; there are: {list}"),
        None => format!("several layers could be meant; choose one of: {list}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::error::Error as _;

    #[test]
    fn a_file_is_named_once() {
        let wrong = "is wrong";
        for error in [Error::invalid(wrong), Error::unsupported(wrong), Error::too_large(wrong)] {
            assert_eq!(error.in_file("a.exr").in_file("a.exr").to_string(), "a.exr: is wrong");
        }
        assert_eq!(Error::exists("a.exr").in_file("b.exr").to_string(), "a.exr: exists already");
        let both = Error::invalid(wrong).in_file("a.safetensors").in_file("b.exr");
        assert_eq!(both.to_string(), "b.exr: a.safetensors: is wrong");
        assert!(matches!(both, Error::Invalid { path: Some(path), .. } if path == Path::new("b.exr")));
    }

    #[test]
    fn what_is_too_large_says_by_how_much() {
        let error = crate::limits::at_most("lobes", 3, 2).unwrap_err().in_file("a.json");
        assert_eq!(error.to_string(), "a.json: 3 lobes are more than the limit of 2");
        let Error::TooLarge { path, value, limit, .. } = error else { panic!("{error:?}") };
        assert_eq!((path.as_deref(), value, limit), (Some(Path::new("a.json")), Some(3), Some(2)));
    }

    #[test]
    fn what_the_system_said_is_the_source_and_not_in_the_message() {
        let refused = || std::io::Error::other("disk on fire");
        let error = Error::io("a.exr", "read", refused());
        assert_eq!(error.to_string(), "a.exr: cannot read");
        assert_eq!(error.source().map(ToString::to_string), Some("disk on fire".to_owned()));
        assert_eq!(error.with_source(), "a.exr: cannot read: disk on fire");
        assert_eq!(Error::invalid("odd").with_source(), "odd");
    }
}
