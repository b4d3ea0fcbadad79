//! The one error type of this crate.

/// What went wrong. Whatever it is, the host's device stays usable.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument does not fit: a latent of another N or model, a texture of the wrong format, usage or size.
    #[error("{0}")]
    Invalid(String),
    /// The device cannot do it: its limits or features are named.
    #[error("{0}")]
    Unsupported(String),
    /// The device refused or failed while making or reading a resource: out of memory, lost, or a validation error.
    #[error("graphics device: {what}")]
    Gpu {
        /// What was being made or done.
        what: String,
        /// The device's own error. The message leaves it to whoever prints the chain, or to [`Error::with_source`].
        #[source]
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
    /// From veni-light: a latent that does not fit the model, for instance.
    #[error(transparent)]
    Light(#[from] veni_light::Error),
}

/// A result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// The message and, behind it, what the device said: for where there is one line and no chain.
    pub fn with_source(&self) -> String {
        match self {
            Self::Gpu { cause, .. } => format!("{self}: {cause}"),
            Self::Light(error) => error.with_source(),
            _ => self.to_string(),
        }
    }

    pub(crate) fn invalid(message: impl Into<String>) -> Self {
        Self::Invalid(message.into())
    }

    pub(crate) fn unsupported(message: impl Into<String>) -> Self {
        Self::Unsupported(message.into())
    }

    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn gpu(
        what: impl Into<String>,
        cause: impl std::error::Error + Send + Sync + 'static,
    ) -> Self {
        Self::Gpu { what: what.into(), cause: Box::new(cause) }
    }

    /// A browser's errors belong to one thread: their words are kept.
    #[cfg(target_arch = "wasm32")]
    pub(crate) fn gpu(what: impl Into<String>, cause: impl std::error::Error) -> Self {
        Self::Gpu { what: what.into(), cause: cause.to_string().into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::error::Error as _;

    #[test]
    fn what_the_device_said_is_the_source_and_not_in_the_message() {
        let error = Error::gpu("veni weights", std::io::Error::other("out of memory"));
        assert_eq!(error.to_string(), "graphics device: veni weights");
        assert_eq!(error.source().map(ToString::to_string), Some("out of memory".to_owned()));
        assert_eq!(error.with_source(), "graphics device: veni weights: out of memory");
        assert_eq!(Error::invalid("odd").with_source(), "odd");
    }
}
