//! Lamps, near and far.

use glam::{Vec2, Vec3};

use super::{Builder, Lamp};
use crate::material::Material;
use crate::scene::Setting;
use crate::solid::Shape;

impl Builder {
    pub(super) fn lamp_posts(&mut self, count: usize, near: f32, far: f32) {
        for _ in 0..count {
            let at = self.spot(near, far.max(near + 1.0));
            self.lamp_post(at);
        }
    }

    pub(super) fn lamp_post(&mut self, at: Vec2) {
        let height = self.draw.range(3.5, 7.5);
        let material = Material::Plain { albedo: Vec3::splat(0.08), mottle: 0.1, size: 1.0 };
        self.add(Shape::Trunk { centre: at, radius: 0.07, low: 0.0, high: height }, material);
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
    pub(super) fn distant_lamps(&mut self) {
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
    pub(super) fn street_light(&mut self, setting: Setting) {
        let level = self.draw.log_range(4e-4, 8e-3);
        let warm = self.draw.unit();
        let colour = Vec3::new(1.7, 0.85, 0.25).lerp(Vec3::new(1.1, 1.0, 0.8), warm);
        if matches!(
            setting,
            Setting::Street | Setting::Square | Setting::Courtyard | Setting::Village | Setting::Park
        ) {
            self.layout.street_light = level * colour;
        }
    }
}
