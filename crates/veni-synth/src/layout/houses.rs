//! Houses, streets, cars and roofs.

use glam::{Vec2, Vec3};

use super::Builder;
use crate::material::Material;
use crate::solid::Shape;

impl Builder {
    pub(super) fn plaster(&mut self) -> Vec3 {
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

    pub(super) fn facade(&mut self) -> Material {
        let albedo = self.plaster();
        let lit = if self.lit { self.draw.range(0.05, 0.4) } else { 0.0 };
        Material::Facade {
            albedo,
            floor: self.draw.range(2.8, 3.8),
            bay: self.draw.range(1.8, 4.0),
            glass: self.draw.range(0.15, 0.45),
            lit,
        }
    }

    pub(super) fn houses(&mut self, count: usize, near: f32, far: f32) {
        for _ in 0..count {
            let half = Vec2::new(self.draw.range(4.0, 8.0), self.draw.range(3.0, 5.5));
            let at = self.spot(near.max(half.length() + 2.0), far);
            let height = self.draw.range(2.6, 7.0);
            let axis = Vec2::from_angle(self.draw.azimuth());
            let ridge = if self.draw.chance(0.85) { self.draw.range(1.5, 4.0) } else { 0.0 };
            let material = self.facade();
            self.add(Shape::block(at, axis, half, [0.0, height, ridge]), material);
        }
    }

    /// Houses in a ring; `closed` of it is built up.
    pub(super) fn ring(&mut self, radius: f32, heights: [f32; 2], closed: f32) {
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
            let material = self.facade();
            self.add(
                Shape::block(
                    bearing * (distance + depth),
                    bearing.perp(),
                    Vec2::new(length, depth),
                    [0.0, height, ridge],
                ),
                material,
            );
        }
    }

    pub(super) fn street(&mut self, fullness: f32) {
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
                    let material = self.facade();
                    self.add(
                        Shape::block(centre, along, Vec2::new(0.5 * length, depth), [0.0, height, ridge]),
                        material,
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

    pub(super) fn car(&mut self, at: Vec2, axis: Vec2) {
        let paints = [
            (3.0, Vec3::splat(0.03)),
            (3.0, Vec3::splat(0.30)),
            (2.0, Vec3::splat(0.65)),
            (1.0, Vec3::new(0.25, 0.02, 0.02)),
            (1.0, Vec3::new(0.03, 0.06, 0.2)),
        ];
        let albedo = self.draw.weighted(&paints);
        let material = Material::Plain { albedo, mottle: 0.05, size: 1.0 };
        self.add(Shape::block(at, axis, Vec2::new(2.1, 0.85), [0.2, 0.9, 0.0]), material);
        let glass = Material::Plain { albedo: Vec3::splat(0.05), mottle: 0.05, size: 1.0 };
        self.add(Shape::block(at - 0.2 * axis, axis, Vec2::new(1.2, 0.75), [0.9, 1.45, 0.0]), glass);
    }

    pub(super) fn vehicles(&mut self, count: usize, near: f32, far: f32) {
        for _ in 0..count {
            let at = self.spot(near, far.max(near + 1.0));
            let axis = Vec2::from_angle(self.draw.azimuth());
            self.car(at, axis);
        }
    }

    /// A roof with pillars or walls under it.
    pub(super) fn shelter(&mut self, fullness: f32) {
        let axis = self.bearing;
        let height = self.draw.log_range(2.6, 6.0);
        let half = Vec2::new(self.draw.log_range(4.0, 14.0), self.draw.log_range(3.0, 8.0));
        let off =
            axis * self.draw.range(-0.7, 0.7) * half.x + axis.perp() * self.draw.range(-0.8, 0.8) * half.y;
        let albedo = self.plaster() * 0.8;
        let material = Material::Plain { albedo, mottle: 0.3, size: 2.0 };
        let thick = self.draw.range(0.3, 1.2);
        self.add(Shape::block(off, axis, half, [height, height + thick, 0.0]), material);
        let closed = self.draw.range(0.1, 0.8);
        for (dir, reach, length) in [
            (axis, half.x, half.y),
            (-axis, half.x, half.y),
            (axis.perp(), half.y, half.x),
            (-axis.perp(), half.y, half.x),
        ] {
            let middle = off + dir * reach;
            if self.draw.chance(closed * 0.75) {
                self.add(
                    Shape::block(middle, dir.perp(), Vec2::new(length, 0.15), [0.0, height, 0.0]),
                    material,
                );
            } else {
                let pillars = self.draw.count(2, 5);
                for k in 0..pillars {
                    let s = (k as f32 / (pillars - 1) as f32 * 2.0 - 1.0) * length;
                    let at = middle + dir.perp() * s;
                    if at.length() > 0.8 {
                        let radius = self.draw.range(0.12, 0.4).min(0.3 * at.length());
                        self.add(Shape::Trunk { centre: at, radius, low: 0.0, high: height }, material);
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
