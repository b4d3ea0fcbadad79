//! What stands around the viewer, over many scenes of every setting: nothing where he stands, nothing in the air, lamps
//! at night only.

use super::*;
use crate::draw::Overrides;
use crate::scene::SkyKind;
use veni_image::luminance;

/// Scenes of every setting under this sky, this many of each.
fn scenes(sky: SkyKind, each: u64) -> impl Iterator<Item = Scene> {
    let of = move |setting| {
        let overrides = Overrides { sky: Some(sky), setting: Some(setting), ..Overrides::default() };
        (0..each).map(move |index| Scene::draw(21, index, &overrides))
    };
    Setting::ALL.into_iter().flat_map(of)
}

fn layouts(sky: SkyKind, each: u64) -> impl Iterator<Item = (Scene, Layout)> {
    scenes(sky, each).map(|scene| {
        let layout = layout(&scene);
        (scene, layout)
    })
}

fn name(scene: &Scene) -> String {
    format!("{} {} under a {} sky", scene.setting.name(), scene.index, scene.sky.name())
}

fn flat(v: Vec3) -> Vec2 {
    Vec2::new(v.x, v.y)
}

/// Whether a point lies in a solid.
fn inside(shape: &Shape, p: Vec3) -> bool {
    match shape {
        Shape::Hull { centre, axis, planes, .. } => {
            let off = flat(p) - *centre;
            let local = Vec3::new(off.dot(*axis), off.dot(axis.perp()), p.z);
            planes.iter().all(|(normal, offset)| normal.dot(local) < *offset)
        }
        Shape::Crown { centre, radii } => ((p - *centre) / *radii).length() < 1.0,
        Shape::Trunk { centre, radius, low, high } => {
            (flat(p) - *centre).length() < *radius && (*low..*high).contains(&p.z)
        }
        Shape::Spire { centre, radius, low, high } => {
            let across = radius * (high - p.z) / (high - low);
            (flat(p) - *centre).length() < across && (*low..*high).contains(&p.z)
        }
    }
}

/// Lowest and highest point of a hull: the corners of a box with a gable, if it is one.
fn extent(shape: &Shape) -> Option<[f32; 2]> {
    let Shape::Hull { planes, .. } = shape else { return None };
    let low = planes.iter().find(|(normal, _)| *normal == -Vec3::Z)?.1;
    // along the middle a gable is highest
    let tops = planes.iter().filter(|(normal, _)| normal.z > 0.0).map(|(normal, offset)| offset / normal.z);
    Some([-low, tops.fold(f32::INFINITY, f32::min)])
}

fn is_house(solid: &Solid) -> bool {
    matches!(solid.material, Material::Facade { .. })
}

fn is_leaves(solid: &Solid) -> bool {
    matches!(solid.material, Material::Leaves { .. })
}

#[test]
fn the_viewer_stands_in_nothing() {
    for (scene, layout) in layouts(SkyKind::Cloudy, 40) {
        // a head of 20 cm around the eye
        for k in 0..27 {
            let off = Vec3::new((k % 3) as f32, (k / 3 % 3) as f32, (k / 9) as f32) - 1.0;
            let p = Vec3::Z * scene.eye + 0.1 * off;
            let around = layout.solids.iter().find(|s| inside(&s.shape, p));
            assert!(around.is_none(), "{}: {p} is in {around:?}", name(&scene));
        }
        // leaves begin far above
        assert_eq!(layout.canopy.is_some(), scene.setting == Setting::Forest, "{}", name(&scene));
        assert!(layout.canopy.is_none_or(|c| c.height > scene.eye + 4.0), "{}", name(&scene));
    }
}

#[test]
fn a_pure_sky_is_empty() {
    for sky in SkyKind::ALL {
        for (scene, layout) in layouts(sky, 30).filter(|(s, _)| s.setting == Setting::PureSky) {
            let things = (layout.solids.len(), layout.lamps.len(), scene.ridges.len());
            assert_eq!(things, (0, 0, 0), "{}", name(&scene));
        }
    }
}

#[test]
fn houses_stand_on_the_ground_as_high_as_houses_are() {
    let mut counts = std::collections::BTreeMap::<&str, Vec<usize>>::new();
    for (scene, layout) in layouts(SkyKind::Cloudy, 40) {
        let houses: Vec<_> = layout.solids.iter().filter(|s| is_house(s)).collect();
        for house in &houses {
            let [low, high] = extent(&house.shape).expect("a house is a box");
            // in a street 4.5 m · 0.55 at least, at a square 26 m · 1.5 and a roof of 4 m at most
            assert!(low == 0.0 && (2.47..43.1).contains(&high), "{}: {low} to {high} m", name(&scene));
        }
        counts.entry(scene.setting.name()).or_default().push(houses.len());
    }
    let most = |setting: Setting| *counts[setting.name()].iter().max().unwrap();
    let least = |setting: Setting| *counts[setting.name()].iter().min().unwrap();
    for setting in [Setting::PureSky, Setting::Lake, Setting::Forest, Setting::Rocks] {
        assert_eq!(most(setting), 0, "{}", setting.name());
    }
    assert!(least(Setting::Village) >= 2 && most(Setting::Village) <= 10);
    // two rows of 165 m, of houses of 6 to 26 m
    assert!(least(Setting::Street) >= 8 && most(Setting::Street) <= 58);
    assert!(least(Setting::Square) >= 3 && most(Setting::Square) <= 11);
}

#[test]
fn walls_close_a_courtyard_and_leave_a_street_open() {
    let walls = |layout: &mut Layout| {
        layout.solids.retain(is_house);
        crate::solid::Solids::new(std::mem::take(&mut layout.solids), &[])
    };
    let (mut closed, mut count) = (0.0, 0);
    for (scene, mut layout) in layouts(SkyKind::Cloudy, 30) {
        let eye = Vec3::Z * scene.eye;
        match scene.setting {
            Setting::Street => {
                let along = Vec2::from_angle(scene.ground.bearing.to_radians());
                let walls = walls(&mut layout);
                for towards in [along, -along] {
                    let hit = walls.first(eye, towards.extend(0.0), 100.0);
                    assert!(hit.is_none(), "{}: a wall across at {hit:?}", name(&scene));
                }
                let beside = [along.perp(), -along.perp()]
                    .map(|d| walls.first(eye, d.extend(0.0), 100.0).map_or(f32::INFINITY, |h| h.distance));
                // half widths of 4 to 13 m, the viewer aside by 0.4 of it, fronts 0.3 m before to 0.8 m behind the line
                assert!(
                    beside.iter().all(|d| *d > 2.0 && (*d < 19.1 || d.is_infinite())),
                    "{}: {beside:?}",
                    name(&scene)
                );
            }
            Setting::Courtyard => {
                let walls = walls(&mut layout);
                let up = 5f32.to_radians().tan();
                let around = (0..360).filter(|a| {
                    let direction = Vec2::from_angle((*a as f32).to_radians()).extend(up).normalize();
                    walls.first(eye, direction, 20.0).is_some()
                });
                closed += around.count() as f32 / 360.0;
                count += 1;
            }
            _ => {}
        }
    }
    // all but 3 houses of 100, and the gaps that set-back neighbours leave
    assert!(closed / count as f32 > 0.9, "{closed} of {count}");
}

#[test]
fn plants_and_cars_stand_on_the_ground() {
    let (mut crowns, mut bare) = (0, 0);
    for (scene, layout) in layouts(SkyKind::Cloudy, 40) {
        let trunks: Vec<_> = layout
            .solids
            .iter()
            .filter_map(|s| match s.shape {
                Shape::Trunk { centre, radius, low, high } => {
                    assert!(low == 0.0 && high > 1.0 && radius < 0.75, "{}: {s:?}", name(&scene));
                    Some((centre, high))
                }
                _ => None,
            })
            .collect();
        for solid in &layout.solids {
            let stands = match &solid.shape {
                // a cone of needles around its trunk
                Shape::Spire { centre, .. } => trunks.iter().any(|(at, _)| at == centre),
                // a bush, or a part of a crown within 0.34 of a tree's height of a trunk of 0.7 of it
                Shape::Crown { centre, radii } => {
                    centre.z <= radii.z
                        || trunks
                            .iter()
                            .any(|(at, high)| (flat(*centre) - *at).length() <= 0.34 / 0.7 * high + 0.01)
                }
                // boxes on the ground, on wheels, on a car, on the pillars of a roof; and boulders
                Shape::Hull { .. } => {
                    let low = extent(&solid.shape).map_or(0.0, |[low, _]| low);
                    low <= 0.2
                        || low == 0.9
                        || scene.setting == Setting::Shelter && (2.6..=6.0).contains(&low)
                }
                Shape::Trunk { .. } => true,
            };
            if is_leaves(solid) && matches!(solid.shape, Shape::Crown { .. }) {
                crowns += 1;
                bare += usize::from(!stands);
            } else {
                assert!(stands, "{}: {solid:?}", name(&scene));
            }
        }
        if scene.setting == Setting::Lake {
            let shore = Vec2::from_angle(scene.ground.bearing.to_radians());
            // no more than the one tree that may stand close by
            let wet: Vec<_> =
                layout.solids.iter().map(middle).filter(|middle| middle.dot(shore) >= 1.0).collect();
            let apart = |a: Vec2, b: Vec2| (a - b).length() < 2.0 * 0.34 * 18.0;
            assert!(wet.iter().all(|m| apart(*m, wet[0])), "{}: {wet:?}", name(&scene));
        }
    }
    // a trunk that the viewer would stand in is gone, its crown is not
    assert!(crowns > 1000 && bare * 200 < crowns, "{bare} of {crowns}");
}

#[test]
fn lamps_are_lit_at_night_only_and_as_bright_as_lamps_are() {
    let settled = [Setting::Street, Setting::Square, Setting::Courtyard, Setting::Village, Setting::Park];
    let windows = |layout: &Layout| {
        let lit = |s: &Solid| matches!(s.material, Material::Facade { lit, .. } if lit > 0.0);
        layout.solids.iter().filter(|s| lit(s)).count()
    };
    for sky in SkyKind::ALL {
        for (scene, layout) in layouts(sky, 20) {
            let dark = scene.sun_elevation < 0.5;
            assert!(dark || !scene.lit, "{}", name(&scene));
            assert!(scene.lit || !dark || !settled.contains(&scene.setting), "{}", name(&scene));
            if !scene.lit {
                let burning = (layout.lamps.len(), windows(&layout), layout.street_light);
                assert_eq!(burning, (0, 0, Vec3::ZERO), "{}", name(&scene));
                continue;
            }
            let houses = layout.solids.iter().filter(|s| is_house(s)).count();
            assert_eq!(windows(&layout), houses, "{}", name(&scene));
            // 0.4 to 8 lx
            let street = luminance(layout.street_light.to_array());
            let range = if settled.contains(&scene.setting) { 3.8e-4..8.4e-3 } else { 0.0..1e-9 };
            assert!(range.contains(&street), "{}: {street} klx", name(&scene));
            for lamp in &layout.lamps {
                let (distance, candela) =
                    (flat(lamp.position).length(), luminance(lamp.intensity.to_array()));
                let far = distance >= 60.0;
                // 2000 to 12000 lm into the half space below, 2π sr; far ones to 20000 lm
                assert!(
                    (0.28..if far { 3.05 } else { 1.95 }).contains(&candela),
                    "{}: {candela} kcd",
                    name(&scene)
                );
                let top = if far { 9.0 } else { 7.65 };
                assert!((3.6..=top).contains(&lamp.position.z), "{}: {lamp:?}", name(&scene));
                let on_post = layout.solids.iter().any(|s| {
                    matches!(s.shape, Shape::Trunk { centre, high, .. }
                        if centre == flat(lamp.position) && (high + 0.15 - lamp.position.z).abs() < 1e-5)
                });
                assert!(far || on_post || distance < 0.4, "{}: {lamp:?}", name(&scene));
            }
        }
    }
}
