//! What solids look like.

use glam::Vec3;

use super::noise::{cell, fractal3};

/// What a solid looks like.
#[derive(Clone, Copy, Debug)]
pub(super) enum Material {
    /// One colour, mottled over `size` metres.
    Plain { albedo: Vec3, mottle: f32, size: f32 },
    /// Leaves: ragged, with holes, a little translucent. `open` is the share of holes.
    Leaves { albedo: Vec3, open: f32, size: f32 },
    /// A wall with windows, `floor` metres high and `bay` metres wide each; `lit` of them shine.
    Facade { albedo: Vec3, floor: f32, bay: f32, glass: f32, lit: f32 },
}

impl Material {
    /// Albedo at a point with this normal, what shines there by itself (as a share of a lit window), and how much of
    /// a mirror it is. `footprint` is the size of a sample,
    /// `seed` that of the solid.
    pub(super) fn paint(&self, point: Vec3, normal: Vec3, footprint: f32, seed: u32) -> (Vec3, f32, f32) {
        match *self {
            Material::Plain { albedo, mottle, size } => {
                let detail = (1.0 - footprint / size).clamp(0.0, 1.0);
                let v = if detail > 0.0 { detail * fractal3(point / size, 4, 0.6, seed) } else { 0.0 };
                (albedo * (mottle * v).exp(), 0.0, 0.0)
            }
            Material::Leaves { albedo, size, .. } => {
                let v = fractal3(point * (1.7 / size), 2, 0.7, seed ^ 0x1eaf);
                (albedo * (0.7 * v).exp(), 0.0, 0.0)
            }
            Material::Facade { albedo, floor, bay, glass, lit } => {
                let stain = 0.12 * fractal3(point * 0.3, 3, 0.6, seed);
                let wall = albedo * stain.exp();
                if normal.z.abs() > 0.3 {
                    // roof
                    return (wall * Vec3::new(0.75, 0.6, 0.52), 0.0, 0.0);
                }
                let along = point.x * -normal.y + point.y * normal.x;
                let (u, v) = (along / bay + 1000.0, point.z / floor);
                let (fu, fv) = (u.fract() - 0.5, v.fract() - 0.52);
                // a box filter over the window's edges
                let soft = |x: f32, half: f32, width: f32| ((half - x.abs()) / width + 0.5).clamp(0.0, 1.0);
                let side = glass.sqrt() * 0.5;
                let window = soft(fu, side, (footprint / bay).max(0.02))
                    * soft(fv, side * 1.15, (footprint / floor).max(0.02));
                let shop = if v < 1.0 { 0.7 } else { 1.0 };
                let shines = cell(u.floor() as i32, v.floor() as i32, seed) < lit;
                let curtain = 0.03 + 0.1 * cell(u.floor() as i32, v.floor() as i32, seed ^ 0xc0);
                let paint = (wall * shop).lerp(Vec3::splat(curtain), window);
                (paint, if shines { window } else { 0.0 }, window)
            }
        }
    }
}
