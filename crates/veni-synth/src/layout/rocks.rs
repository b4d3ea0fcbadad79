//! Boulders and rock walls.

use glam::{Vec2, Vec3};

use super::Builder;
use crate::material::Material;
use crate::solid::Shape;

impl Builder {
    pub(super) fn boulders(&mut self, count: usize, near: f32, far: f32, largest: f32) {
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
                Material::Plain { albedo: rock * shade, mottle: 0.5, size: 0.4 * size + 0.1 },
            );
        }
    }

    pub(super) fn cliff(&mut self) {
        let rock = Vec3::new(0.26, 0.21, 0.165) * self.draw.log_range(0.6, 1.3);
        let bearing = Vec2::from_angle(self.draw.azimuth());
        let distance = self.draw.log_range(4.0, 20.0);
        let depth = self.draw.range(2.0, 5.0);
        let (length, height) = (self.draw.range(4.0, 14.0), self.draw.log_range(3.0, 14.0));
        let axis = Vec2::from_angle(self.draw.normal(0.0, 0.3)).rotate(bearing.perp());
        self.add(
            Shape::block(bearing * (distance + depth), axis, Vec2::new(length, depth), [0.0, height, 0.0]),
            Material::Plain { albedo: rock, mottle: 0.6, size: 1.5 },
        );
    }
}
