//! Memory that is used again.

use std::sync::Mutex;

/// The first `len` numbers of `buffer`, which grows when needed; what they are is left over from before.
pub(super) fn grown(buffer: &mut Vec<f32>, len: usize) -> &mut [f32] {
    if buffer.len() < len {
        buffer.resize(len, 0.0);
    }
    &mut buffer[..len]
}

/// Values for whoever needs one for a while.
#[derive(Debug, Default)]
pub(super) struct Pool<T>(Mutex<Vec<T>>);

impl<T: Default> Pool<T> {
    /// Lends a value that was returned before, or a new one.
    pub(super) fn with<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        // whoever panicked with the lock only pushed or popped
        let lock = || self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let taken = lock().pop();
        let mut value = taken.unwrap_or_default();
        let result = work(&mut value);
        lock().push(value);
        result
    }
}
