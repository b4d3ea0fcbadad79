//! Generated scenes as training panoramas.

use std::path::Path;

use rayon::prelude::*;

use super::dataset::Item;
use crate::Result;
use veni_light::progress::Observer;
use veni_light::sphere::Equirect;
use veni_synth::{Overrides, Scene, render};

/// The grid on which generated scenes are rendered if their lights are to be taken out.
const SUN_GRID: Equirect = Equirect { width: 512, height: 256 };

/// Scenes 0..`count` of the set with this seed, in order; each goes through `keep` with its number.
pub(super) fn generated(
    count: usize,
    seed: u64,
    (grid, lights): (Equirect, usize),
    keep: impl Fn(usize, Item) -> Result<Item> + Sync,
    observer: &dyn Observer,
) -> Result<Vec<Item>> {
    let make = |index: usize| {
        // lights are found where a sun is a few pixels
        let full = if lights > 0 { SUN_GRID } else { grid };
        let panorama = render(&Scene::draw(seed, index as u64, &Overrides::default()), full);
        let path = format!("synth-{index:06}");
        let item = Item::split(Path::new(&path), panorama, grid, lights)?;
        let item = Item { generated: true, ..item };
        let item = keep(index, item)?;
        observer.advance(1);
        Ok(item)
    };
    (0..count).into_par_iter().map(make).collect()
}
