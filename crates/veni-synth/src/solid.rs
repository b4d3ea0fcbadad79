//! Things near the viewer as a few kinds of solids, and rays against them.
//!
//! The viewer stands at x = y = 0, so a ray from the eye stays in one sector of azimuth, and all rays towards the sun
//! are parallel: two lists of candidates, by sector and by lane, replace a tree.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::material::Material;
use super::noise::fractal3;

/// A solid and its material.
#[derive(Clone, Debug)]
pub(super) struct Solid {
    pub(super) shape: Shape,
    pub(super) material: Material,
    pub(super) seed: u32,
}

/// Shapes, all standing upright.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    /// A convex body: where ⟨normal, p⟩ < offset for every plane. `radius` bounds it around `centre`.
    Hull { centre: Vec2, radius: f32, axis: Vec2, planes: Vec<(Vec3, f32)> },
    /// An ellipsoid.
    Crown { centre: Vec3, radii: Vec3 },
    /// A vertical cylinder from `low` to `high`.
    Trunk { centre: Vec2, radius: f32, low: f32, high: f32 },
    /// A cone from its widest place at `low` to its tip at `high`.
    Spire { centre: Vec2, radius: f32, low: f32, high: f32 },
}

/// Where a ray meets a solid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub(super) distance: f32,
    pub(super) normal: Vec3,
    pub(super) solid: usize,
}

/// Solids with their lists.
#[derive(Debug)]
pub(super) struct Solids {
    pub(super) all: Vec<Solid>,
    sectors: Vec<Vec<u32>>,
    /// For each source of light: the direction across, and the lanes.
    lanes: Vec<(Vec2, Vec<Vec<u32>>)>,
}

const SECTORS: usize = 128;
const LANES: usize = 96;
/// Lanes cover this far to either side, metres; what is beyond is in the outermost ones.
const LANE_REACH: f32 = 72.0;

impl Solids {
    /// `sources` are the directions that shadows are asked for.
    pub(super) fn new(all: Vec<Solid>, sources: &[Vec3]) -> Self {
        let mut sectors = vec![Vec::new(); SECTORS];
        let mut lanes: Vec<_> = sources
            .iter()
            .map(|s| (Vec2::new(-s.y, s.x).normalize_or(Vec2::X), vec![Vec::new(); LANES]))
            .collect();
        for (k, solid) in (0u32..).zip(&all) {
            let (centre, radius) = solid.shape.bound();
            let distance = centre.length();
            let half = if distance <= radius { PI } else { (radius / distance).asin() + 0.02 };
            let middle = centre.y.atan2(centre.x);
            let width = TAU / SECTORS as f32;
            let (from, to) =
                (((middle - half) / width).floor() as i32, ((middle + half) / width).floor() as i32);
            for s in from..=to.min(from + SECTORS as i32 - 1) {
                sectors[s.rem_euclid(SECTORS as i32) as usize].push(k);
            }
            for (across, lanes) in &mut lanes {
                let u = centre.dot(*across);
                for lane in &mut lanes[lane(u - radius)..=lane(u + radius)] {
                    lane.push(k);
                }
            }
        }
        Self { all, sectors, lanes }
    }

    /// The first solid that a ray from (near) the axis x = y = 0 meets within `reach`.
    pub(super) fn first(&self, origin: Vec3, direction: Vec3, reach: f32) -> Option<Hit> {
        let sector = (direction.y.atan2(direction.x) * (SECTORS as f32 / TAU)).floor() as i32;
        let mut best: Option<Hit> = None;
        let mut nearest = reach;
        for &k in &self.sectors[sector.rem_euclid(SECTORS as i32) as usize] {
            if let Some((distance, normal)) = self.all[k as usize].meet(origin, direction, nearest) {
                nearest = distance;
                best = Some(Hit { distance, normal, solid: k as usize });
            }
        }
        best
    }

    /// Whether the light of a source reaches a point.
    pub(super) fn lit(&self, point: Vec3, source: usize, direction: Vec3) -> bool {
        let (across, lanes) = &self.lanes[source];
        let u = Vec2::new(point.x, point.y).dot(*across);
        !lanes[lane(u)].iter().any(|&k| self.all[k as usize].meet(point, direction, 1e4).is_some())
    }
}

fn lane(u: f32) -> usize {
    (((u / LANE_REACH + 1.0) * 0.5 * LANES as f32).max(0.0) as usize).min(LANES - 1)
}

impl Shape {
    /// A box: half sizes along and across `axis`, from `low` to `high`; with `ridge` > 0 a gable roof that much
    /// higher, its ridge along the axis.
    pub(super) fn block(centre: Vec2, axis: Vec2, half: Vec2, [low, high, ridge]: [f32; 3]) -> Self {
        let mut planes = vec![
            (Vec3::X, half.x),
            (-Vec3::X, half.x),
            (Vec3::Y, half.y),
            (-Vec3::Y, half.y),
            (-Vec3::Z, -low),
        ];
        if ridge > 0.0 {
            for side in [1.0, -1.0] {
                let normal = Vec3::new(0.0, side * ridge, half.y).normalize();
                // through the ridge
                planes.push((normal, normal.z * (high + ridge)));
            }
        } else {
            planes.push((Vec3::Z, high));
        }
        Self::Hull { centre, radius: half.length(), axis, planes }
    }

    /// A circle on the ground that contains it.
    fn bound(&self) -> (Vec2, f32) {
        match self {
            Self::Hull { centre, radius, .. }
            | Self::Trunk { centre, radius, .. }
            | Self::Spire { centre, radius, .. } => (*centre, *radius),
            Self::Crown { centre, radii } => (Vec2::new(centre.x, centre.y), radii.x.max(radii.y)),
        }
    }
}

impl Solid {
    /// Distance and outward normal where a ray enters, if before `reach`.
    fn meet(&self, origin: Vec3, direction: Vec3, reach: f32) -> Option<(f32, Vec3)> {
        let (near, far) = self.span(origin, direction)?;
        if far.0 <= 1e-3 || near.0 >= reach {
            return None;
        }
        let Material::Leaves { open, size, .. } = self.material else {
            return (near.0 > 1e-3).then_some(near);
        };
        // leaves: solid where the noise says so, at the near and at the far side
        for (t, normal) in [near, far] {
            if t > 1e-3 && t < reach {
                let grazing = 1.0 - normal.dot(direction).abs();
                let p = origin + t * direction;
                let holes = open + 0.5 * grazing * grazing * grazing - 0.35;
                if fractal3(p / size, 3, 0.6, self.seed) > holes {
                    return Some((t, normal));
                }
            }
        }
        None
    }

    /// Where a ray enters and leaves, with normals.
    fn span(&self, origin: Vec3, direction: Vec3) -> Option<((f32, Vec3), (f32, Vec3))> {
        match &self.shape {
            Shape::Hull { centre, axis, planes, .. } => {
                let turn = |v: Vec3| {
                    let p = Vec2::new(v.x, v.y);
                    Vec3::new(p.dot(*axis), axis.perp_dot(p), v.z)
                };
                let (o, d) = (turn(origin - centre.extend(0.0)), turn(direction));
                let (mut near, mut far) = ((f32::NEG_INFINITY, Vec3::Z), (f32::INFINITY, Vec3::Z));
                for &(normal, offset) in planes {
                    let (speed, gap) = (normal.dot(d), offset - normal.dot(o));
                    if speed.abs() < 1e-9 {
                        if gap < 0.0 {
                            return None;
                        }
                    } else if speed < 0.0 {
                        if gap / speed > near.0 {
                            near = (gap / speed, normal);
                        }
                    } else if gap / speed < far.0 {
                        far = (gap / speed, normal);
                    }
                }
                let back = |n: Vec3| (*axis * n.x + axis.perp() * n.y).extend(n.z);
                (near.0 < far.0).then(|| ((near.0, back(near.1)), (far.0, back(far.1))))
            }
            Shape::Crown { centre, radii } => {
                let (o, d) = ((origin - *centre) / *radii, direction / *radii);
                let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - 1.0);
                let root = b * b - a * c;
                if root <= 0.0 {
                    return None;
                }
                let root = root.sqrt();
                let at = |t: f32| (t, ((o + t * d) / *radii).normalize());
                Some((at((-b - root) / a), at((-b + root) / a)))
            }
            Shape::Trunk { centre, radius, low, high } => {
                let o = Vec2::new(origin.x, origin.y) - *centre;
                let d = Vec2::new(direction.x, direction.y);
                let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - radius * radius);
                let root = b * b - a * c;
                if root <= 0.0 || a < 1e-12 {
                    return None;
                }
                let at = |t: f32| (t, ((o + t * d) / *radius).extend(0.0));
                let within = |t: f32| (*low..*high).contains(&(origin.z + t * direction.z));
                let (t0, t1) = ((-b - root.sqrt()) / a, (-b + root.sqrt()) / a);
                (within(t0) || within(t1)).then(|| (at(if within(t0) { t0 } else { t1 }), at(t1)))
            }
            Shape::Spire { centre, radius, low, high } => {
                // r = k (high − z)
                let k = radius / (high - low);
                let o = origin - centre.extend(*high);
                let q = |u: Vec3, v: Vec3| u.x * v.x + u.y * v.y - k * k * u.z * v.z;
                let (a, b, c) = (q(direction, direction), q(o, direction), q(o, o));
                let root = b * b - a * c;
                if root <= 0.0 || a.abs() < 1e-9 {
                    return None;
                }
                let at = |t: f32| {
                    let p = o + t * direction;
                    (t, Vec3::new(p.x, p.y, -k * k * p.z).normalize_or(Vec3::Z))
                };
                let within = |t: f32| (*low - *high..0.0).contains(&(o.z + t * direction.z));
                let (s, t) = ((-b - root.sqrt()) / a, (-b + root.sqrt()) / a);
                let (t0, t1) = (s.min(t), s.max(t));
                match (within(t0) && t0 > 1e-3, within(t1) && t1 > 1e-3) {
                    (true, true) => Some((at(t0), at(t1))),
                    (true, false) => Some((at(t0), at(t0))),
                    (false, true) => Some((at(t1), at(t1))),
                    (false, false) => None,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_shapes_where_they_are() {
        let plain = Material::Plain { albedo: Vec3::ONE, mottle: 0.0, size: 1.0 };
        let at = Vec2::new(10.0, 0.0);
        let shapes = [
            Shape::block(at, Vec2::Y, Vec2::new(3.0, 2.0), [0.0, 5.0, 0.0]),
            Shape::block(at, Vec2::Y, Vec2::new(3.0, 2.0), [0.0, 5.0, 2.0]),
            Shape::Crown { centre: Vec3::new(10.0, 0.0, 1.0), radii: Vec3::new(2.0, 3.0, 4.0) },
            Shape::Trunk { centre: at, radius: 2.0, low: 0.0, high: 5.0 },
            Shape::Spire { centre: at, radius: 4.0, low: -1.0, high: 3.0 },
        ];
        for shape in shapes {
            let text = format!("{shape:?}");
            let sun = Vec3::new(0.6, 0.0, 0.8);
            let solids = Solids::new(vec![Solid { shape, material: plain, seed: 0 }], &[sun]);
            let hit = solids.first(Vec3::Z, Vec3::X, 1e4).unwrap_or_else(|| panic!("missed {text}"));
            assert!((hit.distance - 8.0).abs() < 1e-3, "{text}: {hit:?}");
            assert!(hit.normal.x < -0.6 && (hit.normal.length() - 1.0).abs() < 1e-3, "{text}: {hit:?}");
            assert!(
                solids.first(Vec3::Z, -Vec3::X, 1e4).is_none()
                    && solids.first(Vec3::Z, Vec3::X, 7.0).is_none()
            );
            assert!(solids.first(Vec3::Z, Vec3::new(0.5, 0.0, 0.87), 1e4).is_none(), "{text}");
            // in its shadow, and beside it
            assert!(!solids.lit(Vec3::new(7.5, 0.0, -4.0), 0, sun), "{text}");
            assert!(solids.lit(Vec3::new(9.0, 9.0, 0.0), 0, sun), "{text}");
        }
    }
}
