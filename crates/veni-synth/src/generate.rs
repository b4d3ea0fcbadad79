//! Many scenes on all cores.

use std::ops::Range;

use rayon::prelude::*;

use super::draw::Overrides;
use super::render::render;
use super::scene::Scene;
use veni_image::Panorama;
use veni_light::sphere::Equirect;

/// Draws and renders the scenes `indices` of the set with this seed, in parallel and in no particular order, and hands
/// each to `take` as soon as it is done. `wanted` is asked before a scene is rendered.
///
/// # Errors
/// The first error of `take` in time; what is under way is finished, nothing new is begun.
pub fn generate<E: Send>(
    seed: u64,
    indices: Range<u64>,
    overrides: &Overrides,
    grid: Equirect,
    wanted: impl Fn(&Scene) -> bool + Sync,
    take: impl Fn(Scene, Panorama) -> Result<(), E> + Sync,
) -> Result<(), E> {
    indices.into_par_iter().try_for_each(|index| {
        let scene = Scene::draw(seed, index, overrides);
        if !wanted(&scene) {
            return Ok(());
        }
        let panorama = render(&scene, grid);
        take(scene, panorama)
    })
}
