//! Work over many items: what is kept is read, the rest is computed by several threads and kept one by one.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::Evaluation;
use crate::store::Key;
use crate::{Error, Result};
use veni_data::Part;
use veni_data::parallel::parallel;
use veni_light::digest::Digest;

/// Results that are kept: one key per `unit` of `task`, and how to compute what there is nothing of.
pub(super) struct Work<'a, T> {
    unit: &'static str,
    task: String,
    keys: Vec<Key>,
    compute: Box<dyn Fn(usize) -> Result<T> + Sync + 'a>,
}

impl<'a, T: Serialize + DeserializeOwned + Send> Work<'a, T> {
    /// `compute` gets the index of a key.
    pub(super) fn new(
        unit: &'static str,
        task: String,
        keys: Vec<Key>,
        compute: impl Fn(usize) -> Result<T> + Sync + 'a,
    ) -> Self {
        Self { unit, task, keys, compute: Box::new(compute) }
    }

    /// The value of every key, in order.
    pub(super) fn all(&self, run: &Evaluation<'_>) -> Result<Vec<T>> {
        let keys: Vec<_> = (0..self.keys.len()).collect();
        let values = self.values(run, &keys)?.into_iter().collect::<Option<Vec<_>>>();
        values.ok_or_else(|| Error::invalid(format!("{}: a result is missing", self.task)))
    }

    /// Keeps the values of a share of the keys.
    pub(super) fn keep(&self, run: &Evaluation<'_>, part: Part) -> Result<()> {
        let keys: Vec<_> = (0..self.keys.len()).filter(|index| part.has(*index)).collect();
        self.values(run, &keys).map(drop)
    }

    fn values(&self, run: &Evaluation<'_>, chosen: &[usize]) -> Result<Vec<Option<T>>> {
        let get = |index: &usize| run.store.get::<T>(&self.keys[*index]);
        let mut values = chosen.iter().map(get).collect::<Result<Vec<_>>>()?;
        let missing: Vec<usize> = (0..chosen.len()).filter(|at| values[*at].is_none()).collect();
        run.observer.begin(self.unit, &self.task, chosen.len() - missing.len(), chosen.len());
        let computed = parallel(missing.len(), |at| {
            let index = chosen[missing[at]];
            let value = (self.compute)(index)?;
            run.store.put(&self.keys[index], &value)?;
            run.observer.advance(1);
            Ok(value)
        })?;
        for (at, value) in missing.into_iter().zip(computed) {
            values[at] = Some(value);
        }
        Ok(values)
    }
}

/// Identity of each panorama: its values and its size.
pub(super) fn images(run: &Evaluation<'_>) -> Vec<Value> {
    let grid = run.data.grid();
    let digest = |values: &[f32]| Digest::of(bytemuck::cast_slice::<_, u8>(values));
    let identity = |values: &[f32]| json!([grid.width, grid.height, digest(values)]);
    run.data.items().iter().map(|item| identity(&item.log_radiance)).collect()
}
