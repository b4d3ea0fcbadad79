//! To whom the progress of long work is reported. The libraries print nothing.

/// Observer of progress. Work is reported from several threads.
pub trait Observer: Sync {
    /// `task` begins, which takes `total` units ("panorama"), `done` of them done by an earlier run.
    fn begin(&self, unit: &'static str, task: &str, done: usize, total: usize);

    /// This many more units of the task that began last are done.
    fn advance(&self, units: usize);

    /// Something worth knowing that stops nothing, in a sentence.
    fn note(&self, _sentence: &str) {}
}

/// Nobody observes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Observer for Silent {
    fn begin(&self, _: &'static str, _: &str, _: usize, _: usize) {}

    fn advance(&self, _: usize) {}
}
