//! Which panoramas a batch takes. MODEL (33).

use std::sync::{Mutex, PoisonError};

use crate::train::config::{Order, TrainConfig};
use veni_data::Dataset;
use veni_light::random::{Purpose, Stream, stream};

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
    photographed: Pool,
    generated: Pool,
}

/// Panoramas that are drawn from together.
#[derive(Debug)]
struct Pool {
    panoramas: Vec<usize>,
    /// Part of the key of its orders.
    key: u64,
    /// The epoch drawn from last, and its order: a batch asks for one panorama at a time, and to shuffle takes time and
    /// memory in proportion to all of them.
    order: Mutex<Option<(u64, Vec<usize>)>>,
}

impl Pool {
    fn new(panoramas: Vec<usize>, key: u64) -> Self {
        Self { panoramas, key, order: Mutex::default() }
    }

    /// The panorama of draw `rank` (from 0), when each comes once per epoch.
    fn shuffled(&self, seed: u64, rank: u64) -> usize {
        let n = self.panoramas.len() as u64;
        let (epoch, place) = (rank / n, (rank % n) as usize);
        let mut kept = self.order.lock().unwrap_or_else(PoisonError::into_inner);
        let order = match kept.take() {
            Some((of, order)) if of == epoch => order,
            _ => stream(seed, Purpose::Order, epoch, self.key).permutation(n as usize),
        };
        let index = order[place];
        *kept = Some((epoch, order));
        self.panoramas[index]
    }

    fn any(&self, rng: &mut Stream) -> usize {
        self.panoramas[rng.below(self.panoramas.len())]
    }
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
            photographed: Pool::new(pick(&|generated| share.is_none() || !generated), u64::MAX),
            generated: Pool::new(pick(&|generated| share.is_some() && generated), u64::MAX - 1),
        }
    }

    /// The panorama of slot `slot` of update `step` (from 1).
    pub(super) fn choice(&self, step: u64, slot: usize) -> usize {
        let drawn = (step - 1) * self.batch as u64 + slot as u64;
        let before = |draws: u64| (draws as f64 * self.share).floor() as u64;
        let (pool, rank) = if before(drawn + 1) > before(drawn) {
            (&self.generated, before(drawn))
        } else {
            (&self.photographed, drawn - before(drawn))
        };
        match self.order {
            Order::Replacement => pool.any(&mut stream(self.seed, Purpose::Order, step, slot as u64)),
            Order::Shuffle => pool.shuffled(self.seed, rank),
        }
    }

    /// A second panorama for an augmentation that combines two: of either kind with the probability that a draw has.
    pub(super) fn partner(&self, rng: &mut Stream) -> usize {
        let generated = self.share > 0.0 && rng.uniform() < self.share;
        if generated { &self.generated } else { &self.photographed }.any(rng)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::presets::Preset;
    use veni_data::Item;
    use veni_light::sphere::Equirect;

    /// Five photographs and seven generated scenes.
    fn draws(order: Order, share: Option<f64>) -> Draws {
        let grid = Equirect::new(2, 1);
        let item = |index: usize| Item {
            path: index.to_string().into(),
            log_radiance: vec![0.0; 6].into(),
            log_exposure: 0.0,
            lights: veni_light::light::Lights::default(),
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
    fn draws_do_not_depend_on_what_was_drawn_before() {
        for (order, share) in
            [(Order::Shuffle, None), (Order::Shuffle, Some(0.3)), (Order::Replacement, None)]
        {
            let forwards = all(&draws(order, share), 12);
            let again = draws(order, share);
            let backwards: Vec<_> =
                (1..=12).rev().flat_map(|step| [3, 2, 1, 0].map(|slot| again.choice(step, slot))).collect();
            assert!(forwards.iter().eq(backwards.iter().rev()), "{order:?}");
        }
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
