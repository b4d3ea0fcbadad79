//! From a setting to the things that stand there.

mod houses;
mod lamps;
mod plants;
mod rocks;
#[cfg(test)]
mod tests;

use glam::{Vec2, Vec3};

use super::material::Material;
use super::random::{Draw, Part};
use super::scene::{Scene, Setting};
use super::solid::{Shape, Solid};

/// Leaves overhead, as a layer with holes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Canopy {
    /// Height above the ground.
    pub(super) height: f32,
    /// Noise above this is a hole.
    pub(super) threshold: f32,
    /// Size of its largest holes.
    pub(super) scale: f32,
    /// Albedo of the leaves.
    pub(super) albedo: Vec3,
    /// Where it ends.
    pub(super) radius: f32,
    pub(super) seed: u32,
}

/// A lamp: a small bright sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lamp {
    pub(super) position: Vec3,
    /// Luminous intensity in kcd, Rec. 709.
    pub(super) intensity: Vec3,
}

/// What stands around the viewer.
#[derive(Debug, Default)]
pub(super) struct Layout {
    pub(super) solids: Vec<Solid>,
    pub(super) canopy: Option<Canopy>,
    pub(super) lamps: Vec<Lamp>,
    /// Irradiance from the lamps of a town all around, klx.
    pub(super) street_light: Vec3,
}

/// Builds the surroundings; a function of the scene alone.
pub(super) fn layout(scene: &Scene) -> Layout {
    let mut builder = Builder {
        draw: Draw::new(scene.seed, scene.index, Part::Layout),
        lit: scene.lit,
        snow: scene.ground.surface == super::surface::GroundMaterial::Snow,
        bearing: Vec2::from_angle(scene.ground.bearing.to_radians()),
        layout: Layout::default(),
    };
    builder.place(scene.setting, scene.fullness);
    // under a pure sky there is no ground that lamps could stand on
    if scene.lit && scene.setting != Setting::PureSky {
        builder.distant_lamps();
        builder.street_light(scene.setting);
    }
    // a wall or crown may have come to stand where the viewer is
    builder.layout.solids.retain(|s| !covers_eye(s, scene.eye));
    builder.layout
}

struct Builder {
    draw: Draw,
    lit: bool,
    snow: bool,
    bearing: Vec2,
    layout: Layout,
}

impl Builder {
    fn place(&mut self, setting: Setting, fullness: f32) {
        let many = |least: f32, most: f32| (least + (most - least) * fullness) as usize;
        match setting {
            Setting::PureSky => return,
            Setting::Plain | Setting::Coast | Setting::Hills => {
                if self.draw.chance(0.7 * fullness) {
                    self.trees(many(1.0, 14.0), 6.0, 60.0);
                }
                if self.draw.chance(fullness) {
                    self.bushes(many(2.0, 20.0), 4.0, 40.0);
                }
                if setting != Setting::Plain && self.draw.chance(0.6) {
                    self.boulders(many(2.0, 16.0), 2.5, 25.0, 0.9);
                }
                if self.draw.chance(0.12) {
                    self.houses(1, 15.0, 50.0);
                }
            }
            Setting::Lake => {
                // on the dry side only
                self.trees(many(4.0, 26.0), 8.0, 50.0);
                self.bushes(many(4.0, 24.0), 4.0, 30.0);
                let shore = self.bearing;
                self.layout.solids.retain(|s| middle(s).dot(shore) < 1.0);
            }
            Setting::Park => {
                self.trees(many(6.0, 40.0), 3.5, 60.0);
                self.bushes(many(0.0, 16.0), 4.0, 40.0);
                if self.draw.chance(0.3) {
                    self.houses(2, 30.0, 60.0);
                }
                self.lamp_posts(many(1.0, 4.0), 6.0, 30.0);
            }
            Setting::Forest => self.forest(fullness),
            Setting::Village => {
                self.houses(many(3.0, 10.0), 10.0, 45.0);
                self.trees(many(3.0, 18.0), 4.0, 50.0);
                self.bushes(many(2.0, 16.0), 4.0, 30.0);
                self.lamp_posts(2, 6.0, 25.0);
            }
            Setting::Street => self.street(fullness),
            Setting::Square => {
                let radius = self.draw.log_range(14.0, 45.0);
                self.ring(radius, [7.0, 26.0], 0.92);
                self.trees(many(0.0, 8.0), 6.0, 0.7 * radius);
                self.vehicles(many(0.0, 8.0), 5.0, 0.7 * radius);
                self.lamp_posts(many(3.0, 9.0), 5.0, 0.8 * radius);
            }
            Setting::Courtyard => {
                let radius = self.draw.log_range(4.0, 12.0);
                self.ring(radius, [4.0, 16.0], 0.97);
                self.bushes(many(0.0, 6.0), 2.0, 0.8 * radius);
                if self.draw.chance(0.4) {
                    self.trees(1, 3.0, 0.8 * radius + 1.0);
                }
                self.lamp_posts(2, 2.0, 0.8 * radius);
            }
            Setting::Rocks => {
                self.boulders(many(14.0, 60.0), 2.0, 30.0, 2.2);
                let walls = self.draw.count(0, 4);
                for _ in 0..walls {
                    self.cliff();
                }
                self.bushes(many(0.0, 12.0), 4.0, 30.0);
            }
            Setting::Shelter => self.shelter(fullness),
        }
        // something close by, as in most photographs
        if self.draw.chance(0.25 * fullness) && !matches!(setting, Setting::Plain | Setting::Shelter) {
            self.trees(1, 2.2, 5.0);
        }
    }

    /// A point at a random azimuth; distances are even in area, with more of them close by.
    fn spot(&mut self, near: f32, far: f32) -> Vec2 {
        let t = self.draw.unit();
        let r = near + (far - near) * t.powf(0.8);
        Vec2::from_angle(self.draw.azimuth()) * r
    }

    fn add(&mut self, shape: Shape, material: Material) {
        let seed = self.draw.bits();
        self.layout.solids.push(Solid { shape, material, seed });
    }
}

fn middle(solid: &Solid) -> Vec2 {
    match &solid.shape {
        Shape::Hull { centre, .. } | Shape::Trunk { centre, .. } | Shape::Spire { centre, .. } => *centre,
        Shape::Crown { centre, .. } => Vec2::new(centre.x, centre.y),
    }
}

/// Whether the eye would be inside (with some air around it).
fn covers_eye(solid: &Solid, height: f32) -> bool {
    match &solid.shape {
        Shape::Hull { centre, axis, planes, .. } => {
            let eye = Vec3::new((-*centre).dot(*axis), axis.perp_dot(-*centre), height);
            planes.iter().all(|(normal, offset)| normal.dot(eye) < offset + 0.4)
        }
        Shape::Crown { centre, radii } => {
            ((Vec3::new(0.0, 0.0, height) - *centre) / (*radii + 0.3)).length_squared() < 1.0
        }
        Shape::Trunk { centre, radius, .. } | Shape::Spire { centre, radius, .. } => {
            centre.length() < radius + 0.3
        }
    }
}
