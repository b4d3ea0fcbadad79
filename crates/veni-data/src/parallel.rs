//! Many large items by a few threads.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

/// f(0), …, f(count − 1), computed by as many threads as there are processors, begun in this order. An error ends the
/// work; of several the first in order is returned.
///
/// These are threads of their own: a thread of rayon's pool that waits for inner work takes up another item meanwhile. It
/// may then wait for itself, and what is half done piles up in memory.
///
/// # Errors
/// The first error of `f`, in the order of the items.
pub fn parallel<T: Send, E: Send>(
    count: usize,
    f: impl Fn(usize) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let threads = thread::available_parallelism().map_or(1, usize::from).min(count);
    let (next, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let results = Mutex::new((0..count).map(|_| None).collect::<Vec<Option<Result<T, E>>>>());
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while !failed.load(Ordering::Relaxed) {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    if at >= count {
                        break;
                    }
                    let result = f(at);
                    failed.fetch_or(result.is_err(), Ordering::Relaxed);
                    results.lock().unwrap_or_else(std::sync::PoisonError::into_inner)[at] = Some(result);
                }
            });
        }
    });
    let results = results.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    // after an error later items may be absent; the error comes first
    let (done, errors): (Vec<_>, Vec<_>) = results.into_iter().flatten().partition(Result::is_ok);
    errors.into_iter().next().map_or_else(|| done.into_iter().collect(), |error| error.map(|_| Vec::new()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;

    #[test]
    fn order_is_kept_and_errors_come_through() {
        let all = parallel(100, |i| Ok::<_, Error>(i * i));
        assert_eq!(all.unwrap(), (0..100).map(|i| i * i).collect::<Vec<_>>());
        assert_eq!(parallel(0, |_| Ok::<_, Error>(1)).unwrap(), Vec::<i32>::new());
        let failing = parallel(100, |i| if i == 7 { Err(Error::invalid("seven")) } else { Ok(i) });
        assert_eq!(failing.unwrap_err().to_string(), "seven");
    }
}
