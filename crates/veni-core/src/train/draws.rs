//! Which panoramas a batch takes.

use rand::Rng;

use crate::data::Dataset;
use crate::data::random::{Purpose, below, permutation, stream, uniform};
use crate::train::config::{Order, TrainConfig};

/// Draws panoramas, by their index in the training set. What is drawn is a pure function of the configuration and the
/// place in the run.
///
/// With `data.synthetic_share` = s, draw d of the run (from 0) is a generated scene when ⌊(d + 1)·s⌋ > ⌊d·s⌋: they
/// come as evenly as the share allows. Photographs and generated scenes have epochs of their own.
#[derive(Debug)]
pub(super) struct Draws {
    order: Order,
    seed: u64,
    batch: usize,
    share: f64,
    /// All panoramas, or the photographed ones where there is a share.
    photographed: Vec<usize>,
    generated: Vec<usize>,
}

impl Draws {
    /// Draws from `train` as `config` says.
    pub(super) fn new(config: &TrainConfig, train: &Dataset) -> Self {
        let pick = |wanted: &dyn Fn(bool) -> bool| {
            let items = train.items().iter().enumerate();
            items.filter(|(_, item)| wanted(item.generated)).map(|(index, _)| index).collect()
        };
        let share = config.data.synthetic_share;
        Self {
            order: config.order,
            seed: config.seed,
            batch: config.batch,
            share: share.unwrap_or(0.0),
            photographed: pick(&|generated| share.is_none() || !generated),
            generated: pick(&|generated| share.is_some() && generated),
        }
    }

    /// The panorama of slot `slot` of update `step` (from 1).
    pub(super) fn choice(&self, step: u64, slot: usize) -> usize {
        let drawn = (step - 1) * self.batch as u64 + slot as u64;
        let before = |draws: u64| (draws as f64 * self.share).floor() as u64;
        let (pool, rank, key) = if before(drawn + 1) > before(drawn) {
            (&self.generated, before(drawn), u64::MAX - 1)
        } else {
            (&self.photographed, drawn - before(drawn), u64::MAX)
        };
        let n = pool.len();
        match self.order {
            Order::Replacement => pool[below(&mut stream(self.seed, Purpose::Order, step, slot as u64), n)],
            Order::Shuffle => {
                let epoch = rank / n as u64;
                let order = permutation(&mut stream(self.seed, Purpose::Order, epoch, key), n);
                pool[order[(rank % n as u64) as usize]]
            }
        }
    }

    /// A second panorama for an augmentation that combines two: of either kind with the probability that a draw has.
    pub(super) fn partner(&self, rng: &mut impl Rng) -> usize {
        let generated = self.share > 0.0 && uniform(rng) < self.share;
        let pool = if generated { &self.generated } else { &self.photographed };
        pool[below(rng, pool.len())]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Item;
    use crate::sphere::Equirect;
    use crate::train::presets::Preset;

    /// Five photographs and seven generated scenes.
    fn draws(order: Order, share: Option<f64>) -> Draws {
        let grid = Equirect::new(2, 1);
        let item = |index: usize| Item {
            path: index.to_string().into(),
            log_radiance: vec![0.0; 6],
            log_exposure: 0.0,
            generated: index >= 5,
        };
        let mut config = Preset::Tiny.config(3);
        (config.order, config.batch) = (order, 4);
        config.data.synthetic_share = share;
        Draws::new(&config, &Dataset::new(grid, (0..12).map(item).collect()))
    }

    fn all(draws: &Draws, steps: u64) -> Vec<usize> {
        (1..=steps).flat_map(|step| (0..4).map(move |slot| draws.choice(step, slot))).collect()
    }

    #[test]
    fn without_a_share_every_panorama_comes_once_per_epoch() {
        let drawn = all(&draws(Order::Shuffle, None), 6);
        for epoch in drawn.chunks_exact(12) {
            let mut epoch = epoch.to_vec();
            epoch.sort_unstable();
            assert_eq!(epoch, (0..12).collect::<Vec<_>>());
        }
        assert_ne!(drawn[..12], drawn[12..]);
    }

    #[test]
    fn a_share_is_kept_in_every_stretch_and_each_kind_has_its_epochs() {
        for order in [Order::Shuffle, Order::Replacement] {
            let drawn = all(&draws(order, Some(0.25)), 280);
            for (at, window) in drawn.chunks_exact(4).enumerate() {
                assert_eq!(
                    window.iter().filter(|index| **index >= 5).count(),
                    1,
                    "{order:?} step {}",
                    at + 1
                );
            }
            if order == Order::Shuffle {
                let of = |generated| drawn.iter().copied().filter(move |index| (*index >= 5) == generated);
                for (generated, n) in [(false, 5), (true, 7)] {
                    for epoch in of(generated).collect::<Vec<_>>().chunks_exact(n) {
                        let mut epoch = epoch.to_vec();
                        epoch.sort_unstable();
                        epoch.dedup();
                        assert_eq!(epoch.len(), n);
                    }
                }
            }
        }
        assert!(all(&draws(Order::Shuffle, Some(0.0)), 30).iter().all(|index| *index < 5));
        assert!(all(&draws(Order::Shuffle, Some(1.0)), 30).iter().all(|index| *index >= 5));
    }

    #[test]
    fn partners_are_of_either_kind_by_the_share() {
        for (share, expected) in [(None, 7.0 / 12.0), (Some(0.25), 0.25), (Some(0.0), 0.0)] {
            let draws = draws(Order::Shuffle, share);
            let mut rng = stream(0, Purpose::Augment, 0, 0);
            let n = 4000;
            let generated = (0..n).filter(|_| draws.partner(&mut rng) >= 5).count() as f64 / f64::from(n);
            // five standard errors
            assert!(
                (generated - expected).abs() <= 5.0 * (0.25 / f64::from(n)).sqrt(),
                "{share:?}: {generated}"
            );
        }
    }
}
