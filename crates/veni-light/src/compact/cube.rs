//! A disc on the texels of a cube map: its energy is right at any size. MODEL (72).

use std::f64::consts::PI;

use super::{CompactLight, Glow};
use crate::sphere::{CubeFace, Frame};
use crate::vector::{dot, sub};

/// Places along a side of a texel that the disc's edge crosses; more where the disc is smaller than a texel.
const PLACES: f64 = 16.0;
/// Most places along a side.
const MOST_PLACES: f64 = 256.0;

impl CompactLight {
    /// What each texel of a cube map of `size` whose faces are named by `frame` ([`CubeFace::direction`]) gains from the light:
    /// indices face after face, row-major, ascending, and radiance.
    pub(super) fn on_cube(&self, frame: Frame, size: usize) -> Vec<(usize, [f32; 3])> {
        if let Some(glow) = Glow::new(self) {
            return glow_on_cube(self, &glow, frame, size);
        }
        let texel = |(index, part): (usize, f64)| {
            let k = index % (size * size);
            let mut gained = [0.0; 3];
            self.add_part(part / CubeFace::solid_angle(size, k % size, k / size), &mut gained);
            (index, gained)
        };
        self.cube_parts(frame, size).into_iter().map(texel).collect()
    }

    /// What part of the light, as a disc, lies in which texel: parts that sum to 1.
    fn cube_parts(&self, frame: Frame, size: usize) -> Vec<(usize, f64)> {
        let towards = self.direction.map(f64::from);
        let half = (0.5 * f64::from(self.radius)).sin();
        let square = 4.0 * half * half;
        // half of a texel's diagonal, at most, at the middle of a face
        let angle = (f64::from(self.radius) + 2f64.sqrt() / size as f64).min(PI);
        let reach = 4.0 * (0.5 * angle).sin().powi(2);
        let apart = |d: [f64; 3]| d.iter().zip(towards).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let texel = 2.0 / size as f64;
        let places = (PLACES * texel / f64::from(self.radius).max(1e-9)).clamp(PLACES, MOST_PLACES).ceil();
        let (count, mut parts, mut nearest) = (places as usize, Vec::new(), (f64::INFINITY, 0));
        for (face, row, column) in near(self.direction, angle, frame, size) {
            let index = (face as usize * size + row) * size + column;
            let [a, b] = [column, row].map(|k| (k as f64 + 0.5) * texel - 1.0);
            let centre = apart(face.towards(frame, a, b));
            if centre < nearest.0 {
                nearest = (centre, index);
            }
            if centre > reach {
                continue;
            }
            let corners = [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)];
            let inside =
                |(i, j): &(f64, f64)| apart(face.towards(frame, a + i * texel, b + j * texel)) <= square;
            let part = if self.radius < 0.5 && corners.iter().all(inside) {
                CubeFace::solid_angle(size, column, row)
            } else {
                let place = |k: usize| ((k as f64 + 0.5) / places - 0.5) * texel;
                let mut covered = 0.0;
                for (i, j) in (0..count * count).map(|k| (place(k % count), place(k / count))) {
                    let (a, b) = (a + i, b + j);
                    if apart(face.towards(frame, a, b)) <= square {
                        covered += (1.0 + a * a + b * b).powf(-1.5);
                    }
                }
                covered * (texel / places).powi(2)
            };
            if part > 0.0 {
                parts.push((index, part));
            }
        }
        if parts.is_empty() {
            return vec![(nearest.1, 1.0)];
        }
        let total: f64 = parts.iter().map(|part| part.1).sum();
        parts.iter_mut().for_each(|part| part.1 /= total);
        parts
    }
}

/// The mean over each texel.
fn glow_on_cube(light: &CompactLight, glow: &Glow, frame: Frame, size: usize) -> Vec<(usize, [f32; 3])> {
    let texel = 2.0 / size as f64;
    let n = glow.places(texel);
    let mut gains = Vec::new();
    let angle = 2.0 * (0.5 * glow.reach(2.0 * texel)).min(1.0).asin();
    for (face, row, column) in near(light.direction, angle, frame, size) {
        let index = (face as usize * size + row) * size + column;
        let [a, b] = [column, row].map(|k| (k as f64 + 0.5) * texel - 1.0);
        if glow.beyond(face.towards(frame, a, b), 2.0 * texel) {
            continue;
        }
        let place = |k: usize| ((k as f64 + 0.5) / n as f64 - 0.5) * texel;
        let places = (0..n * n).map(|k| {
            let (a, b) = (a + place(k % n), b + place(k / n));
            (face.towards(frame, a, b), (1.0 + a * a + b * b).powf(-1.5))
        });
        let mut gained = [0.0; 3];
        glow.add_density(glow.mean(places), &mut gained);
        gains.push((index, gained));
    }
    gains
}

/// Face, row and column of every texel whose middle is within an angle of a direction, in order, and of others around them.
fn near(
    direction: [f32; 3],
    angle: f64,
    frame: Frame,
    size: usize,
) -> impl Iterator<Item = (CubeFace, usize, usize)> {
    let mut lookup = frame.from_native(direction).map(f64::from);
    if frame == Frame::Bevy {
        lookup[2] = -lookup[2];
    }
    let face = move |face: CubeFace| {
        let depth = face.lookup(0.0, 0.0);
        let [columns, rows] = [face.lookup(1.0, 0.0), face.lookup(0.0, 1.0)]
            .map(|place| places([dot(depth, lookup), dot(sub(place, depth), lookup)], angle, size));
        rows.flat_map(move |row| columns.clone().map(move |column| (face, row, column)))
    };
    CubeFace::ALL.into_iter().flat_map(face)
}

/// Columns (or rows) of a face that may be within an angle of a direction, of which `[depth, along]` are the components along the
/// face's axis and its columns: an angle of asin(sin(angle)/ρ) at most to either side, ρ the length of the two.
fn places([depth, along]: [f64; 2], angle: f64, size: usize) -> std::ops::Range<usize> {
    let (middle, sine) = (along.atan2(depth), angle.sin() / depth.hypot(along));
    // all of them where the axis across both lies within the angle; NaN where the direction is that axis
    if angle >= 0.5 * PI || sine >= 1.0 || sine.is_nan() {
        return 0..size;
    }
    let aside = sine.asin();
    let [low, high] = [middle - aside, middle + aside].map(|edge| edge.clamp(-0.25 * PI, 0.25 * PI).tan());
    if middle - aside > 0.25 * PI || middle + aside < -0.25 * PI {
        return 0..0;
    }
    // one more to either side, for what is rounded
    let place = |at: f64| 0.5 * (at + 1.0) * size as f64;
    (place(low).floor().max(1.0) as usize - 1)..(place(high).ceil() as usize + 1).min(size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_sum_to_one_where_the_light_is() {
        for frame in Frame::ALL {
            for (direction, radius) in [
                ([0.6, 0.0, 0.8], 0.0),
                ([0.6, 0.0, 0.8], CompactLight::SUN_RADIUS),
                ([0.57735, 0.57735, 0.57735], 0.05),
                ([-0.48, 0.64, -0.6], 0.4),
                ([0.0, 0.0, 1.0], 0.9),
            ] {
                for size in [1, 8, 33] {
                    let parts = CompactLight::new(direction, [1.0; 3], radius).cube_parts(frame, size);
                    let sum: f64 = parts.iter().map(|part| part.1).sum();
                    assert!((sum - 1.0).abs() < 1e-12, "{frame:?} {direction:?} {radius} {size}: {sum}");
                    assert!(parts.windows(2).all(|pair| pair[0].0 < pair[1].0));
                    // the mean direction of the parts is the light's
                    let mut mean = [0.0; 3];
                    for (index, part) in parts {
                        let (face, texel) = (CubeFace::ALL[index / (size * size)], index % (size * size));
                        let d = face.direction(frame, size, texel % size, texel / size);
                        mean = [0, 1, 2].map(|c| mean[c] + part * f64::from(d[c]));
                    }
                    let length = mean.iter().map(|c| c * c).sum::<f64>().sqrt();
                    let cosine: f64 =
                        mean.iter().zip(direction).map(|(a, b)| a / length * f64::from(b)).sum();
                    let most = if size == 1 { 1.0 } else { 1.5 / size as f64 };
                    assert!(
                        cosine.min(1.0).acos() < most,
                        "{frame:?} {direction:?} {radius} {size}: {cosine}"
                    );
                }
            }
        }
    }

    #[test]
    fn no_texel_near_a_direction_is_left_out() {
        for frame in Frame::ALL {
            for direction in
                [[0.6, 0.0, 0.8], [0.0, 0.0, -1.0], [0.57735, -0.57735, 0.57735], [-0.96, 0.28, 0.0]]
            {
                for (angle, size) in [(0.1, 32), (0.02, 64), (0.7, 16), (1.5, 8), (3.0, 4), (0.9, 1)] {
                    let found: Vec<_> = near(direction, angle, frame, size).collect();
                    assert!(
                        found.is_sorted_by_key(|(face, row, column)| (*face as usize, *row, *column))
                            && found.len() <= 6 * size * size
                    );
                    assert!(angle > 0.1 || found.len() < size * size, "{} of {size}", found.len());
                    for (k, face) in CubeFace::ALL.into_iter().enumerate() {
                        for (row, column) in (0..size * size).map(|at| (at / size, at % size)) {
                            let d = face.direction(frame, size, column, row);
                            let cosine: f32 = d.iter().zip(direction).map(|(a, b): (&f32, f32)| a * b).sum();
                            let within = f64::from(cosine.clamp(-1.0, 1.0)).acos() < angle;
                            let there = found.contains(&(face, row, column));
                            assert!(
                                there || !within,
                                "{frame:?} {direction:?} {angle} {size}: {k} {row} {column}"
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_texel_in_the_disc_has_its_radiance() {
        let (size, light) = (64, CompactLight::new([0.6, 0.0, 0.8], [1.0; 3], 0.1));
        let parts = light.cube_parts(Frame::Blender, size);
        let radiance = parts.iter().map(|(index, part)| {
            let texel = index % (size * size);
            part / CubeFace::solid_angle(size, texel % size, texel / size)
        });
        let most = radiance.fold(0.0, f64::max);
        assert!((most / f64::from(light.radiance()[0]) - 1.0).abs() < 2e-3, "{most}");
    }

    #[test]
    fn wide_lights_have_their_energy() {
        for size in [4, 32] {
            let light = CompactLight::new([0.6, 0.0, 0.8], [2.0, 1.0, 0.5], 0.3);
            let mut sum = 0.0;
            for (index, gained) in light.on_cube(Frame::Bevy, size) {
                let k = index % (size * size);
                sum += f64::from(gained[0]) * CubeFace::solid_angle(size, k % size, k / size);
            }
            assert!((sum / 2.0 - 1.0).abs() < 1e-3, "{size}: {sum}");
        }
    }
}
