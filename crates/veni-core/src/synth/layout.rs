//! From a place to the things that stand there.

use glam::{Vec2, Vec3};

use super::random::{Draw, Stream};
use super::scene::{Place, Scene};
use super::solid::{Shape, Skin, Solid};

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
        draw: Draw::new(scene.seed, scene.index, Stream::Layout),
        lit: scene.lit,
        snow: scene.ground.surface == super::scene::Surface::Snow,
        bearing: Vec2::from_angle(scene.ground.bearing.to_radians()),
        layout: Layout::default(),
    };
    builder.place(scene.place, scene.fullness);
    if scene.lit {
        builder.distant_lamps();
        builder.street_light(scene.place);
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
    fn place(&mut self, place: Place, fullness: f32) {
        let many = |least: f32, most: f32| (least + (most - least) * fullness) as usize;
        match place {
            Place::PureSky => return,
            Place::Plain | Place::Coast | Place::Hills => {
                if self.draw.chance(0.7 * fullness) {
                    self.trees(many(1.0, 14.0), 6.0, 60.0);
                }
                if self.draw.chance(fullness) {
                    self.bushes(many(2.0, 20.0), 4.0, 40.0);
                }
                if place != Place::Plain && self.draw.chance(0.6) {
                    self.boulders(many(2.0, 16.0), 2.5, 25.0, 0.9);
                }
                if self.draw.chance(0.12) {
                    self.houses(1, 15.0, 50.0);
                }
            }
            Place::Lake => {
                // on the dry side only
                self.trees(many(4.0, 26.0), 8.0, 50.0);
                self.bushes(many(4.0, 24.0), 4.0, 30.0);
                let shore = self.bearing;
                self.layout.solids.retain(|s| middle(s).dot(shore) < 1.0);
            }
            Place::Park => {
                self.trees(many(6.0, 40.0), 3.5, 60.0);
                self.bushes(many(0.0, 16.0), 4.0, 40.0);
                if self.draw.chance(0.3) {
                    self.houses(2, 30.0, 60.0);
                }
                self.lamp_posts(many(1.0, 4.0), 6.0, 30.0);
            }
            Place::Forest => self.forest(fullness),
            Place::Village => {
                self.houses(many(3.0, 10.0), 10.0, 45.0);
                self.trees(many(3.0, 18.0), 4.0, 50.0);
                self.bushes(many(2.0, 16.0), 4.0, 30.0);
                self.lamp_posts(2, 6.0, 25.0);
            }
            Place::Street => self.street(fullness),
            Place::Square => {
                let radius = self.draw.log_range(16.0, 50.0);
                self.ring(radius, [6.0, 26.0], 0.92);
                self.trees(many(0.0, 8.0), 6.0, 0.7 * radius);
                self.vehicles(many(0.0, 8.0), 5.0, 0.7 * radius);
                self.lamp_posts(many(3.0, 9.0), 5.0, 0.8 * radius);
            }
            Place::Courtyard => {
                let radius = self.draw.log_range(4.0, 12.0);
                self.ring(radius, [4.0, 16.0], 0.97);
                self.bushes(many(0.0, 6.0), 2.0, 0.8 * radius);
                if self.draw.chance(0.4) {
                    self.trees(1, 3.0, 0.8 * radius + 1.0);
                }
                self.lamp_posts(2, 2.0, 0.8 * radius);
            }
            Place::Rocks => {
                self.boulders(many(14.0, 60.0), 2.0, 30.0, 2.2);
                let walls = self.draw.count(0, 4);
                for _ in 0..walls {
                    self.cliff();
                }
                self.bushes(many(0.0, 12.0), 4.0, 30.0);
            }
            Place::Shelter => self.shelter(fullness),
        }
        // something close by, as in most photographs
        if self.draw.chance(0.25 * fullness) && !matches!(place, Place::Plain | Place::Shelter) {
            self.trees(1, 2.2, 5.0);
        }
    }

    /// A point at a random azimuth; distances are even in area, with more of them close by.
    fn spot(&mut self, near: f32, far: f32) -> Vec2 {
        let t = self.draw.unit();
        let r = near + (far - near) * t.powf(0.8);
        Vec2::from_angle(self.draw.azimuth()) * r
    }

    fn add(&mut self, shape: Shape, skin: Skin) {
        let seed = self.draw.bits();
        self.layout.solids.push(Solid { shape, skin, seed });
    }

    fn leaves(&mut self) -> Vec3 {
        if self.snow && self.draw.chance(0.6) {
            return Vec3::new(0.35, 0.36, 0.38);
        }
        let green = Vec3::new(0.095, 0.125, 0.05);
        let autumn = Vec3::new(0.24, 0.13, 0.05);
        let t = if self.draw.chance(0.12) { self.draw.unit() } else { 0.0 };
        green.lerp(autumn, t) * self.draw.log_range(0.6, 1.5)
    }

    fn bark(&mut self) -> Vec3 {
        Vec3::new(0.12, 0.095, 0.075) * self.draw.log_range(0.6, 1.8)
    }

    fn trees(&mut self, count: usize, near: f32, far: f32) {
        for _ in 0..count {
            let at = self.spot(near, far.max(near + 1.0));
            let height = self.draw.log_range(4.0, 18.0);
            if self.draw.chance(0.25) { self.conifer(at, height) } else { self.broadleaf(at, height) }
        }
    }

    fn broadleaf(&mut self, at: Vec2, height: f32) {
        let albedo = self.leaves();
        let bark = self.bark();
        let radius = height * self.draw.range(0.012, 0.03) + 0.05;
        let clear = height * self.draw.range(0.15, 0.4);
        self.add(
            Shape::Trunk { centre: at, radius, low: 0.0, high: 0.7 * height },
            Skin::Plain { albedo: bark, mottle: 0.5, size: 0.4 },
        );
        let spread = height * self.draw.range(0.18, 0.4);
        let open = self.draw.range(0.0, 0.45);
        let clumps = self.draw.count(4, 9);
        for _ in 0..clumps {
            let off = Vec2::from_angle(self.draw.azimuth()) * spread * self.draw.range(0.1, 0.85);
            let size = spread * self.draw.range(0.35, 0.65);
            let z = clear + (height - clear) * self.draw.range(0.15, 0.85);
            let tall = size * self.draw.range(0.6, 1.1);
            self.add(
                Shape::Crown { centre: (at + off).extend(z), radii: Vec3::new(size, size, tall) },
                Skin::Leaves { albedo, open, size: 0.12 * spread + 0.25 },
            );
        }
    }

    fn conifer(&mut self, at: Vec2, height: f32) {
        let albedo = self.leaves() * Vec3::new(0.7, 0.75, 0.9);
        let bark = self.bark();
        self.add(
            Shape::Trunk { centre: at, radius: 0.015 * height + 0.05, low: 0.0, high: 0.8 * height },
            Skin::Plain { albedo: bark, mottle: 0.4, size: 0.4 },
        );
        let low = height * self.draw.range(0.05, 0.3);
        let radius = height * self.draw.range(0.14, 0.24);
        let open = self.draw.range(0.05, 0.4);
        self.add(
            Shape::Spire { centre: at, radius, low, high: height },
            Skin::Leaves { albedo, open, size: 0.5 },
        );
    }

    fn bushes(&mut self, count: usize, near: f32, far: f32) {
        for _ in 0..count {
            let at = self.spot(near, far.max(near + 1.0));
            let size = self.draw.log_range(0.3, 1.6).min(0.45 * at.length());
            let albedo = self.leaves();
            let open = self.draw.range(0.0, 0.3);
            self.add(
                Shape::Crown { centre: at.extend(0.4 * size), radii: Vec3::new(size, size, 0.9 * size) },
                Skin::Leaves { albedo, open, size: 0.3 * size + 0.1 },
            );
        }
    }

    fn boulders(&mut self, count: usize, near: f32, far: f32, largest: f32) {
        let rock = Vec3::new(0.23, 0.205, 0.175) * self.draw.log_range(0.5, 1.4);
        for _ in 0..count {
            let at = self.spot(near, far);
            let size = self.draw.log_range(0.15, largest).min(0.5 * at.length());
            let mut planes = vec![];
            for _ in 0..11 {
                let z = self.draw.range(-0.3, 1.0);
                let a = Vec2::from_angle(self.draw.azimuth()) * (1.0 - z * z).sqrt();
                let normal = a.extend(z);
                planes.push((normal, size * self.draw.range(0.6, 1.0)));
            }
            // whatever the random planes leave open
            planes.extend([(Vec3::Z, 1.1 * size), (-Vec3::Z, 0.2), (Vec3::X, size), (-Vec3::X, size)]);
            planes.extend([(Vec3::Y, size), (-Vec3::Y, size)]);
            let axis = Vec2::from_angle(self.draw.azimuth());
            let shade = self.draw.log_range(0.7, 1.3);
            self.add(
                Shape::Hull { centre: at, radius: 1.45 * size, axis, planes },
                Skin::Plain { albedo: rock * shade, mottle: 0.5, size: 0.4 * size + 0.1 },
            );
        }
    }

    fn cliff(&mut self) {
        let rock = Vec3::new(0.26, 0.21, 0.165) * self.draw.log_range(0.6, 1.3);
        let bearing = Vec2::from_angle(self.draw.azimuth());
        let distance = self.draw.log_range(4.0, 20.0);
        let depth = self.draw.range(2.0, 5.0);
        let (length, height) = (self.draw.range(4.0, 14.0), self.draw.log_range(3.0, 14.0));
        let axis = Vec2::from_angle(self.draw.normal(0.0, 0.3)).rotate(bearing.perp());
        self.add(
            Shape::block(bearing * (distance + depth), axis, Vec2::new(length, depth), [0.0, height, 0.0]),
            Skin::Plain { albedo: rock, mottle: 0.6, size: 1.5 },
        );
    }

    fn plaster(&mut self) -> Vec3 {
        let tones = [
            (3.0, Vec3::new(0.55, 0.50, 0.43)),
            (2.0, Vec3::new(0.42, 0.33, 0.24)),
            (1.5, Vec3::new(0.30, 0.15, 0.10)),
            (2.0, Vec3::new(0.38, 0.37, 0.36)),
            (1.0, Vec3::new(0.18, 0.18, 0.19)),
            (1.0, Vec3::new(0.52, 0.38, 0.18)),
        ];
        self.draw.weighted(&tones) * self.draw.log_range(0.7, 1.25)
    }

    fn facade(&mut self) -> Skin {
        let albedo = self.plaster();
        let lit = if self.lit { self.draw.range(0.05, 0.4) } else { 0.0 };
        Skin::Facade {
            albedo,
            floor: self.draw.range(2.8, 3.8),
            bay: self.draw.range(1.8, 4.0),
            glass: self.draw.range(0.15, 0.45),
            lit,
        }
    }

    fn houses(&mut self, count: usize, near: f32, far: f32) {
        for _ in 0..count {
            let half = Vec2::new(self.draw.range(4.0, 8.0), self.draw.range(3.0, 5.5));
            let at = self.spot(near.max(half.length() + 2.0), far);
            let height = self.draw.range(2.6, 7.0);
            let axis = Vec2::from_angle(self.draw.azimuth());
            let ridge = if self.draw.chance(0.85) { self.draw.range(1.5, 4.0) } else { 0.0 };
            let skin = self.facade();
            self.add(Shape::block(at, axis, half, [0.0, height, ridge]), skin);
        }
    }

    /// Houses in a ring; `closed` of it is built up.
    fn ring(&mut self, radius: f32, heights: [f32; 2], closed: f32) {
        let count = self.draw.count(5, 11);
        let level = self.draw.log_range(heights[0], heights[1]);
        let first = self.draw.azimuth();
        for k in 0..count {
            if self.draw.chance(1.0 - closed) {
                continue;
            }
            let bearing = Vec2::from_angle(first + k as f32 / count as f32 * std::f32::consts::TAU);
            let depth = self.draw.range(4.0, 7.0);
            // wide enough to touch its neighbours, seen from outside the corner
            let length = (radius + 0.5 * depth) * (std::f32::consts::PI / count as f32).tan() * 1.15;
            let distance = radius * self.draw.range(0.95, 1.2);
            let height = level * self.draw.log_range(0.6, 1.5);
            let ridge = if self.draw.chance(0.4) { self.draw.range(1.0, 4.0) } else { 0.0 };
            let skin = self.facade();
            self.add(
                Shape::block(
                    bearing * (distance + depth),
                    bearing.perp(),
                    Vec2::new(length, depth),
                    [0.0, height, ridge],
                ),
                skin,
            );
        }
    }

    fn street(&mut self, fullness: f32) {
        let along = self.bearing;
        let across = along.perp();
        let width = self.draw.log_range(4.0, 13.0);
        let level = self.draw.log_range(4.5, 24.0);
        let off = self.draw.range(-0.4, 0.4) * width;
        for side in [1.0f32, -1.0] {
            let mut at = self.draw.range(-95.0, -80.0);
            while at < 85.0 {
                let length = self.draw.range(6.0, 26.0);
                if !self.draw.chance(0.08) {
                    let depth = self.draw.range(4.0, 8.0);
                    let height = level * self.draw.log_range(0.55, 1.6);
                    let back = width + self.draw.range(-0.3, 0.8) + depth;
                    let ridge = if self.draw.chance(0.35) { self.draw.range(1.0, 4.0) } else { 0.0 };
                    let centre = along * (at + 0.5 * length) + across * (side * back + off);
                    let skin = self.facade();
                    self.add(
                        Shape::block(centre, along, Vec2::new(0.5 * length, depth), [0.0, height, ridge]),
                        skin,
                    );
                }
                at += length + if self.draw.chance(0.15) { self.draw.range(2.0, 10.0) } else { 0.0 };
            }
            // cars along the kerb, trees and lamps
            let kerb = (width - self.draw.range(1.5, 2.5)) * side + off;
            let cars = (fullness * 12.0) as usize;
            for _ in 0..cars {
                let s = self.draw.range(-45.0, 45.0);
                if s.abs() > 3.0 && kerb.abs() > 1.5 {
                    self.car(along * s + across * kerb, along);
                }
            }
            let trees = if self.draw.chance(0.4) { (fullness * 7.0) as usize } else { 0 };
            for k in 0..trees {
                let s = -40.0 + 80.0 * (k as f32 + 0.5) / trees as f32;
                let height = self.draw.range(5.0, 10.0);
                self.broadleaf(along * s + across * kerb, height);
            }
            for k in 0..4 {
                self.lamp_post(along * (-36.0 + 24.0 * k as f32 + 6.0 * side) + across * kerb);
            }
        }
    }

    fn car(&mut self, at: Vec2, axis: Vec2) {
        let paints = [
            (3.0, Vec3::splat(0.03)),
            (3.0, Vec3::splat(0.30)),
            (2.0, Vec3::splat(0.65)),
            (1.0, Vec3::new(0.25, 0.02, 0.02)),
            (1.0, Vec3::new(0.03, 0.06, 0.2)),
        ];
        let albedo = self.draw.weighted(&paints);
        let skin = Skin::Plain { albedo, mottle: 0.05, size: 1.0 };
        self.add(Shape::block(at, axis, Vec2::new(2.1, 0.85), [0.2, 0.9, 0.0]), skin);
        let glass = Skin::Plain { albedo: Vec3::splat(0.05), mottle: 0.05, size: 1.0 };
        self.add(Shape::block(at - 0.2 * axis, axis, Vec2::new(1.2, 0.75), [0.9, 1.45, 0.0]), glass);
    }

    fn vehicles(&mut self, count: usize, near: f32, far: f32) {
        for _ in 0..count {
            let at = self.spot(near, far.max(near + 1.0));
            let axis = Vec2::from_angle(self.draw.azimuth());
            self.car(at, axis);
        }
    }

    fn lamp_posts(&mut self, count: usize, near: f32, far: f32) {
        for _ in 0..count {
            let at = self.spot(near, far.max(near + 1.0));
            self.lamp_post(at);
        }
    }

    fn lamp_post(&mut self, at: Vec2) {
        let height = self.draw.range(3.5, 7.5);
        let skin = Skin::Plain { albedo: Vec3::splat(0.08), mottle: 0.1, size: 1.0 };
        self.add(Shape::Trunk { centre: at, radius: 0.07, low: 0.0, high: height }, skin);
        if !self.lit {
            return;
        }
        // sodium vapour, warm and neutral white
        let colours = [
            (2.0, Vec3::new(1.9, 0.75, 0.12)),
            (2.0, Vec3::new(1.5, 0.92, 0.45)),
            (1.0, Vec3::new(1.02, 1.0, 0.92)),
        ];
        let colour = self.draw.weighted(&colours);
        // 2000 to 12000 lm into the lower half
        let intensity = colour * self.draw.log_range(0.3, 1.9);
        self.layout.lamps.push(Lamp { position: at.extend(height + 0.15), intensity });
    }

    /// The lights of a road or a village far off.
    fn distant_lamps(&mut self) {
        let count = self.draw.count(0, 40);
        let spread = self.draw.range(0.2, 3.1);
        let middle = self.draw.azimuth();
        for _ in 0..count {
            let distance = self.draw.log_range(60.0, 400.0);
            let at = Vec2::from_angle(middle + self.draw.range(-spread, spread)) * distance;
            let warm = self.draw.unit();
            let colour = Vec3::new(1.9, 0.75, 0.12).lerp(Vec3::new(1.1, 1.0, 0.8), warm);
            let position = at.extend(self.draw.range(4.0, 9.0));
            let intensity = colour * self.draw.log_range(0.3, 3.0);
            self.layout.lamps.push(Lamp { position, intensity });
        }
    }

    /// A few lux, as on any lit street.
    fn street_light(&mut self, place: Place) {
        let level = self.draw.log_range(4e-4, 8e-3);
        let warm = self.draw.unit();
        let colour = Vec3::new(1.7, 0.85, 0.25).lerp(Vec3::new(1.1, 1.0, 0.8), warm);
        if matches!(place, Place::Street | Place::Square | Place::Courtyard | Place::Village | Place::Park) {
            self.layout.street_light = level * colour;
        }
    }

    fn forest(&mut self, fullness: f32) {
        let count = (30.0 + 110.0 * fullness) as usize;
        let bark = self.bark();
        let conifers = self.draw.chance(0.4);
        for _ in 0..count {
            let at = self.spot(1.8, 42.0);
            let height = self.draw.range(10.0, 22.0);
            let radius = self.draw.log_range(0.08, 0.42).min(0.2 * at.length());
            let shade = self.draw.log_range(0.7, 1.4);
            self.add(
                Shape::Trunk { centre: at, radius, low: 0.0, high: height },
                Skin::Plain { albedo: bark * shade, mottle: 0.5, size: 0.5 },
            );
            if at.length() > 6.0 && self.draw.chance(0.55) {
                let albedo = self.leaves();
                let open = self.draw.range(0.1, 0.5);
                if conifers {
                    self.add(
                        Shape::Spire {
                            centre: at,
                            radius: 0.17 * height,
                            low: 0.3 * height,
                            high: 1.1 * height,
                        },
                        Skin::Leaves { albedo: albedo * 0.8, open, size: 0.6 },
                    );
                } else {
                    let size = self.draw.range(1.2, 3.2);
                    let z = height * self.draw.range(0.35, 0.95);
                    self.add(
                        Shape::Crown { centre: at.extend(z), radii: Vec3::new(size, size, size) },
                        Skin::Leaves { albedo, open, size: 0.5 },
                    );
                }
            }
        }
        self.bushes((fullness * 34.0) as usize, 2.0, 30.0);
        self.trees((fullness * 16.0) as usize, 20.0, 60.0);
        let albedo = self.leaves();
        self.layout.canopy = Some(Canopy {
            height: self.draw.range(7.0, 15.0),
            threshold: self.draw.range(-0.15, 0.7) * (0.4 + 0.6 * fullness),
            scale: self.draw.range(1.0, 3.0),
            albedo,
            radius: 70.0,
            seed: self.draw.bits(),
        });
    }

    /// A roof with pillars or walls under it.
    fn shelter(&mut self, fullness: f32) {
        let axis = self.bearing;
        let height = self.draw.log_range(2.6, 6.0);
        let half = Vec2::new(self.draw.log_range(4.0, 14.0), self.draw.log_range(3.0, 8.0));
        let off =
            axis * self.draw.range(-0.7, 0.7) * half.x + axis.perp() * self.draw.range(-0.8, 0.8) * half.y;
        let albedo = self.plaster() * 0.8;
        let skin = Skin::Plain { albedo, mottle: 0.3, size: 2.0 };
        let thick = self.draw.range(0.3, 1.2);
        self.add(Shape::block(off, axis, half, [height, height + thick, 0.0]), skin);
        let closed = self.draw.range(0.1, 0.8);
        for (dir, reach, length) in [
            (axis, half.x, half.y),
            (-axis, half.x, half.y),
            (axis.perp(), half.y, half.x),
            (-axis.perp(), half.y, half.x),
        ] {
            let middle = off + dir * reach;
            if self.draw.chance(closed * 0.75) {
                self.add(Shape::block(middle, dir.perp(), Vec2::new(length, 0.15), [0.0, height, 0.0]), skin);
            } else {
                let pillars = self.draw.count(2, 5);
                for k in 0..pillars {
                    let s = (k as f32 / (pillars - 1) as f32 * 2.0 - 1.0) * length;
                    let at = middle + dir.perp() * s;
                    if at.length() > 0.8 {
                        let radius = self.draw.range(0.12, 0.4).min(0.3 * at.length());
                        self.add(Shape::Trunk { centre: at, radius, low: 0.0, high: height }, skin);
                    }
                }
            }
        }
        self.trees((fullness * 12.0) as usize, half.length() + 2.0, 50.0);
        if self.draw.chance(0.5) {
            self.houses((fullness * 5.0) as usize, half.length() + 8.0, 50.0);
        }
        self.lamp_posts(2, half.length(), half.length() + 15.0);
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
