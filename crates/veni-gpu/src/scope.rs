//! Error scopes around everything that is created, so that a failure comes back as an error instead of reaching the
//! host's handler.

use std::pin::pin;
use std::task::{Context, Poll, Waker};

use wgpu::{Device, ErrorFilter};

use crate::error::{Error, Result};

/// Runs `make` and gives what it made, or the first error it caused: out of memory, validation, or internal.
///
/// Native devices report at once. Where the answer comes later (browsers), it is not waited for, since a browser must
/// not be blocked; the host's handler does not see the error either.
pub(crate) fn guarded<T>(device: &Device, what: &str, make: impl FnOnce() -> T) -> Result<T> {
    let filters = [ErrorFilter::OutOfMemory, ErrorFilter::Internal, ErrorFilter::Validation];
    let scopes = filters.map(|filter| device.push_error_scope(filter));
    let made = make();
    let mut first = None;
    // scopes end in reverse
    for scope in scopes.into_iter().rev() {
        if let Poll::Ready(Some(error)) = pin!(scope.pop()).poll(&mut Context::from_waker(Waker::noop())) {
            first.get_or_insert(error);
        }
    }
    match first {
        None => Ok(made),
        Some(error) => Err(Error::gpu(what, error)),
    }
}
