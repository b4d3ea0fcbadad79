//! From a scene to pixels.

use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;

use super::disc::add_discs;
use super::noise::cell;
use super::scene::Scene;
use super::scene_view::SceneView;
use veni_image::Panorama;
use veni_light::sphere::Equirect;

/// Samples of every pixel, along each side.
const COARSE: usize = 2;
/// Samples of a pixel whose first ones differ, along each side.
const FINE: usize = 4;
/// Ratio of luminances among the first samples beyond which a pixel is sampled again.
const CONTRAST: f32 = 1.35;
/// No pixel is darker than this, kcd/m²: a fiftieth of the darkest night sky.
const FLOOR: f32 = 4e-9;

/// Radiance of a scene in kcd/m² (linear Rec. 709) on a panorama's grid; z is up. A function of the scene and the grid:
/// threads change nothing.
pub fn render(scene: &Scene, grid: Equirect) -> Panorama {
    let view = SceneView::new(scene);
    let mut pixels = vec![Vec3::ZERO; grid.len()];
    pixels.par_chunks_mut(grid.width).enumerate().for_each(|(row, pixels)| {
        for (column, pixel) in pixels.iter_mut().enumerate() {
            *pixel = sample(&view, grid, column, row);
        }
    });
    add_discs(&view, grid, &mut pixels);
    let white = Vec3::from(scene.white);
    Panorama::new(grid, pixels.into_iter().map(|p| (p * white).max(Vec3::splat(FLOOR)).to_array()).collect())
}

/// The mean radiance of a pixel.
fn sample(view: &SceneView<'_>, grid: Equirect, column: usize, row: usize) -> Vec3 {
    let (mut sum, mut low, mut high) = (Vec3::ZERO, f32::INFINITY, 0f32);
    visit(view, grid, [column, row], COARSE, |radiance| {
        let level = SceneView::level(radiance);
        (low, high) = (low.min(level), high.max(level));
        sum += radiance;
    });
    if high <= CONTRAST * low {
        return sum / (COARSE * COARSE) as f32;
    }
    visit(view, grid, [column, row], FINE, |radiance| sum += radiance);
    sum / (COARSE * COARSE + FINE * FINE) as f32
}

/// Calls `take` with the radiance of n × n samples spread over a pixel, each at random in its own cell.
fn visit(
    view: &SceneView<'_>,
    grid: Equirect,
    [column, row]: [usize; 2],
    n: usize,
    mut take: impl FnMut(Vec3),
) {
    let footprint = PI / grid.height as f32 / n as f32;
    for k in 0..n * n {
        let key = (row * grid.width + column) as i32;
        let random = |what: i32| cell(key, 64 * what + k as i32, n as u32);
        let u = column as f32 + ((k % n) as f32 + random(1)) / n as f32;
        let v = row as f32 + ((k / n) as f32 + random(2)) / n as f32;
        let (sin_p, cos_p) = (PI - 2.0 * PI * u / grid.width as f32).sin_cos();
        let (sin_t, cos_t) = (PI * v / grid.height as f32).sin_cos();
        let direction = Vec3::new(sin_t * cos_p, sin_t * sin_p, cos_t);
        take(view.radiance(direction, footprint, random(3)));
    }
}
