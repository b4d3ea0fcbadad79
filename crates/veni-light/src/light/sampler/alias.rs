//! Walker's alias table: one of n things by its weight, in constant time.

use std::sync::Arc;

/// One cell: with probability `keep` it is its own thing, else `other`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    pub(super) keep: f32,
    pub(super) other: u32,
}

/// A table with a power of two of cells, so that a random f32 falls into each equally often. Clones share it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Alias {
    cells: Arc<Vec<Cell>>,
}

impl Alias {
    /// For weights of which one is positive at least. One sweep over light and heavy things, each in order: the same table every
    /// time, and no jumps in memory.
    pub(super) fn new(weights: &[f64]) -> Self {
        let n = weights.len().next_power_of_two();
        let mean = weights.iter().sum::<f64>() / n as f64;
        let weight = |k: usize| weights.get(k).copied().unwrap_or(0.0);
        let next = |from: usize, heavy: bool| (from..n).find(|k| (weight(*k) > mean) == heavy);
        let heaviest =
            (0..weights.len()).fold(0, |best, k| if weights[k] > weights[best] { k } else { best });
        // what rounding leaves over keeps itself, unless it must not be drawn
        let mut cells: Vec<Cell> = (0..n)
            .map(|k| {
                if weight(k) > 0.0 {
                    Cell { keep: 1.0, other: k as u32 }
                } else {
                    Cell { keep: 0.0, other: heaviest as u32 }
                }
            })
            .collect();
        let (mut light, mut heavy) = (next(0, false), next(0, true));
        let mut left = heavy.map_or(0.0, weight);
        while let Some(j) = heavy {
            if left > mean {
                let Some(i) = light else { break };
                cells[i] = Cell { keep: (weight(i) / mean) as f32, other: j as u32 };
                left -= mean - weight(i);
                light = next(i + 1, false);
            } else {
                heavy = next(j + 1, true);
                let Some(k) = heavy else { break };
                cells[j] = Cell { keep: (left / mean) as f32, other: k as u32 };
                left += weight(k) - mean;
            }
        }
        Self { cells: Arc::new(cells) }
    }

    /// The thing that `u` and `v`, uniform in [0, 1), choose, and what `v` still holds, uniform again.
    #[inline]
    pub(super) fn choose(&self, u: f32, v: f32) -> (usize, f32) {
        // u has 24 bits: of a larger table, v gives the rest
        let (first, more) = (self.cells.len().min(BITS), self.cells.len() / BITS);
        let mut k = ((u * first as f32) as usize).min(first - 1);
        let mut v = v;
        if more > 1 {
            let low = v * more as f32;
            k = k * more + low as usize;
            v = low - low.floor();
        }
        let Cell { keep, other } = self.cells[k];
        if v < keep {
            (k, (v / keep).min(BELOW_ONE))
        } else {
            (other as usize, ((v - keep) / (1.0 - keep)).min(BELOW_ONE))
        }
    }

    /// All cells: what a shader needs.
    pub(super) fn cells(&self) -> &[Cell] {
        &self.cells
    }
}

/// The number of values in [0, 1) that a random f32 tells apart.
const BITS: usize = 1 << 24;
/// The largest f32 below 1.
pub(super) const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_the_weights_it_was_made_of() {
        let mut state = 1u64;
        for n in [1, 2, 3, 7, 64, 1000] {
            let weights: Vec<f64> = (0..n)
                .map(|k| {
                    state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                    let x = (state >> 40) as f64 / (1u64 << 24) as f64;
                    if k % 5 == 3 {
                        0.0
                    } else if k % 11 == 0 {
                        1e5 * x + 1e-3
                    } else {
                        x + 1e-3
                    }
                })
                .collect();
            let table = Alias::new(&weights);
            let mut found = vec![0.0; table.cells.len()];
            for (k, cell) in table.cells.iter().enumerate() {
                found[k] += f64::from(cell.keep);
                found[cell.other as usize] += 1.0 - f64::from(cell.keep);
            }
            let total: f64 = weights.iter().sum();
            for (k, found) in found.iter().enumerate() {
                let expected = weights.get(k).copied().unwrap_or(0.0) / total * table.cells.len() as f64;
                assert!(
                    (found - expected).abs() < 1e-6 * expected.max(1.0),
                    "{k} of {n}: {found} for {expected}"
                );
                assert!(expected > 0.0 || *found == 0.0, "{k} of {n} must not be drawn");
            }
        }
    }

    #[test]
    fn what_is_left_of_v_is_uniform() {
        let table = Alias::new(&[0.1, 0.5, 0.2, 0.2]);
        for u in [0.0, 0.3, 0.6, 0.99] {
            for v in [0.0, 0.39, 0.4, 0.41, 0.79, BELOW_ONE] {
                let (k, rest) = table.choose(u, v);
                assert!(k < 4 && (0.0..1.0).contains(&rest), "{u} {v}: {k} {rest}");
            }
        }
    }
}
