//! On all cores, where the feature `parallel` allows it.

/// Threads that [`for_each`] may use.
pub(super) fn threads() -> usize {
    #[cfg(feature = "parallel")]
    return rayon::current_num_threads();
    #[cfg(not(feature = "parallel"))]
    1
}

/// Does every task; on all cores if there are several `workers`.
pub(super) fn for_each<T: Send>(workers: usize, tasks: Vec<T>, work: impl Fn(T) + Sync + Send) {
    #[cfg(feature = "parallel")]
    if workers > 1 && tasks.len() > 1 {
        use rayon::prelude::*;
        return tasks.into_par_iter().with_max_len(1).for_each(work);
    }
    let _ = workers;
    tasks.into_iter().for_each(work);
}
