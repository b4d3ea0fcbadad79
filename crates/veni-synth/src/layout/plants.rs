//! Trees, bushes and woods.

use glam::{Vec2, Vec3};

use super::{Builder, Canopy};
use crate::material::Material;
use crate::solid::Shape;

/// Trees of one grove.
const GROVE: usize = 6;

impl Builder {
    pub(super) fn leaves(&mut self) -> Vec3 {
        if self.snow && self.draw.chance(0.6) {
            return Vec3::new(0.35, 0.36, 0.38);
        }
        let green = Vec3::new(0.095, 0.125, 0.05);
        let autumn = Vec3::new(0.24, 0.13, 0.05);
        let t = if self.draw.chance(0.12) { self.draw.unit() } else { 0.0 };
        green.lerp(autumn, t) * self.draw.log_range(0.6, 1.5)
    }

    pub(super) fn bark(&mut self) -> Vec3 {
        Vec3::new(0.12, 0.095, 0.075) * self.draw.log_range(0.6, 1.8)
    }

    pub(super) fn trees(&mut self, count: usize, near: f32, far: f32) {
        // some stand by themselves, some in groves whose crowns touch
        let (mut grove, mut spread) = (Vec2::ZERO, 0.0);
        for k in 0..count {
            let alone = self.spot(near, far.max(near + 1.0));
            if k % GROVE == 0 {
                (grove, spread) = (alone, self.draw.range(2.0, 9.0));
            }
            let off = Vec2::new(self.draw.normal(0.0, spread), self.draw.normal(0.0, spread));
            let at = if (grove + off).length() > near && (k / GROVE).is_multiple_of(2) {
                grove + off
            } else {
                alone
            };
            let height = self.draw.log_range(4.0, 18.0);
            if self.draw.chance(0.25) { self.conifer(at, height) } else { self.broadleaf(at, height) }
        }
    }

    pub(super) fn broadleaf(&mut self, at: Vec2, height: f32) {
        let albedo = self.leaves();
        let bark = self.bark();
        let radius = height * self.draw.range(0.012, 0.03) + 0.05;
        let clear = height * self.draw.range(0.05, 0.35);
        self.add(
            Shape::Trunk { centre: at, radius, low: 0.0, high: 0.7 * height },
            Material::Plain { albedo: bark, mottle: 0.5, size: 0.4 },
        );
        let spread = height * self.draw.range(0.18, 0.4);
        let open = self.draw.range(0.0, 0.35);
        let clumps = self.draw.count(5, 10);
        for _ in 0..clumps {
            let off = Vec2::from_angle(self.draw.azimuth()) * spread * self.draw.range(0.1, 0.85);
            let size = spread * self.draw.range(0.4, 0.75);
            let z = clear + (height - clear) * self.draw.range(0.15, 0.85);
            let tall = size * self.draw.range(0.6, 1.1);
            self.add(
                Shape::Crown { centre: (at + off).extend(z), radii: Vec3::new(size, size, tall) },
                Material::Leaves { albedo, open, size: 0.12 * spread + 0.25 },
            );
        }
    }

    pub(super) fn conifer(&mut self, at: Vec2, height: f32) {
        let albedo = self.leaves() * Vec3::new(0.7, 0.75, 0.9);
        let bark = self.bark();
        self.add(
            Shape::Trunk { centre: at, radius: 0.015 * height + 0.05, low: 0.0, high: 0.8 * height },
            Material::Plain { albedo: bark, mottle: 0.4, size: 0.4 },
        );
        let low = height * self.draw.range(0.05, 0.3);
        let radius = height * self.draw.range(0.14, 0.24);
        let open = self.draw.range(0.05, 0.4);
        self.add(
            Shape::Spire { centre: at, radius, low, high: height },
            Material::Leaves { albedo, open, size: 0.5 },
        );
    }

    pub(super) fn bushes(&mut self, count: usize, near: f32, far: f32) {
        for _ in 0..count {
            let at = self.spot(near, far.max(near + 1.0));
            let size = self.draw.log_range(0.3, 1.6).min(0.45 * at.length());
            let albedo = self.leaves();
            let open = self.draw.range(0.0, 0.3);
            self.add(
                Shape::Crown { centre: at.extend(0.4 * size), radii: Vec3::new(size, size, 0.9 * size) },
                Material::Leaves { albedo, open, size: 0.3 * size + 0.1 },
            );
        }
    }

    pub(super) fn forest(&mut self, fullness: f32) {
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
                Material::Plain { albedo: bark * shade, mottle: 0.5, size: 0.5 },
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
                        Material::Leaves { albedo: albedo * 0.8, open, size: 0.6 },
                    );
                } else {
                    let size = self.draw.range(1.2, 3.2);
                    let z = height * self.draw.range(0.35, 0.95);
                    self.add(
                        Shape::Crown { centre: at.extend(z), radii: Vec3::new(size, size, size) },
                        Material::Leaves { albedo, open, size: 0.5 },
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
}
