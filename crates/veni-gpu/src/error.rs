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
    #[error("graphics device: {what}: {cause}")]
    Gpu {
        /// What was being made or done.
        what: String,
        /// The device's own error, whose words the message has too.
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
