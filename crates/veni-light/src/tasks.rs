//! Independent tasks on all threads of rayon's current pool; without the feature `parallel`, one after the other on the
//! calling thread. The results are the same to the bit.

#[cfg(feature = "parallel")]
use rayon::prelude::*;

/// What `work` gives for each task, in their order. `scratch` makes workspace that a thread keeps from task to task.
#[cfg(feature = "parallel")]
pub(crate) fn map<T: Send, S, R: Send>(
    tasks: impl Iterator<Item = T>,
    scratch: impl Fn() -> S + Sync + Send,
    work: impl Fn(&mut S, T) -> R + Sync + Send,
) -> Vec<R> {
    tasks.collect::<Vec<T>>().into_par_iter().map_init(scratch, work).collect()
}

/// What `work` gives for each task, in their order, with one `scratch` for all.
#[cfg(not(feature = "parallel"))]
pub(crate) fn map<T, S, R>(
    tasks: impl Iterator<Item = T>,
    scratch: impl Fn() -> S,
    work: impl Fn(&mut S, T) -> R,
) -> Vec<R> {
    let mut scratch = scratch();
    tasks.map(|task| work(&mut scratch, task)).collect()
}

/// [`map`] for work that leaves nothing but what it wrote.
pub(crate) fn each<T: Send, S>(
    tasks: impl Iterator<Item = T>,
    scratch: impl Fn() -> S + Sync + Send,
    work: impl Fn(&mut S, T) + Sync + Send,
) {
    map(tasks, scratch, work);
}

/// `work` once on every thread at the same time.
pub(crate) fn on_every_thread<R: Send>(work: impl Fn() -> R + Sync) -> Vec<R> {
    #[cfg(feature = "parallel")]
    let results = rayon::broadcast(|_| work());
    #[cfg(not(feature = "parallel"))]
    let results = vec![work()];
    results
}
