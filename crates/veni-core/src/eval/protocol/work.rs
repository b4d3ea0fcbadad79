//! Work over many items: what is kept is read, the rest is computed by several threads and kept one by one.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::Evaluation;
use crate::eval::store::{Key, digest};
use crate::{Error, Result};

/// The value of every key, in order: one key per `unit` of `task`. `compute` gets the index of a key that nothing is kept of.
pub(super) fn kept<T: Serialize + DeserializeOwned + Send>(
    run: &Evaluation<'_>,
    (unit, task): (&'static str, &str),
    keys: &[Key],
    compute: impl Fn(usize) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    let mut values = keys.iter().map(|key| run.store.get::<T>(key)).collect::<Result<Vec<_>>>()?;
    let missing: Vec<usize> = (0..keys.len()).filter(|i| values[*i].is_none()).collect();
    run.watch.begin(unit, task, keys.len() - missing.len(), keys.len());
    let computed = parallel(missing.len(), |at| {
        let value = compute(missing[at])?;
        run.store.put(&keys[missing[at]], &value)?;
        run.watch.advance(1);
        Ok(value)
    })?;
    for (index, value) in missing.into_iter().zip(computed) {
        values[index] = Some(value);
    }
    let whole = values.into_iter().collect::<Option<Vec<_>>>();
    whole.ok_or_else(|| Error::invalid(format!("{task}: a result is missing")))
}

/// f(0), …, f(count − 1), computed by as many threads as there are processors. The first error ends the work.
///
/// These are threads of their own: a thread of rayon's pool that waits inside of burn may take up another item and then
/// wait for itself.
pub(super) fn parallel<T: Send>(count: usize, f: impl Fn(usize) -> Result<T> + Sync) -> Result<Vec<T>> {
    let threads = thread::available_parallelism().map_or(1, usize::from).min(count);
    let (next, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let results = Mutex::new((0..count).map(|_| None).collect::<Vec<Option<Result<T>>>>());
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

/// Identity of each panorama: its values and its size.
pub(super) fn images(run: &Evaluation<'_>) -> Vec<Value> {
    let grid = run.data.grid();
    let identity = |values: &[f32]| json!([grid.width, grid.height, digest([bytemuck::cast_slice(values)])]);
    run.data.items().iter().map(|item| identity(&item.log_radiance)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_is_kept_and_errors_come_through() {
        assert_eq!(parallel(100, |i| Ok(i * i)).unwrap(), (0..100).map(|i| i * i).collect::<Vec<_>>());
        assert_eq!(parallel(0, |_| Ok(1)).unwrap(), Vec::<i32>::new());
        let failing = parallel(100, |i| if i == 7 { Err(Error::invalid("seven")) } else { Ok(i) });
        assert_eq!(failing.unwrap_err().to_string(), "seven");
    }
}
