//! One candidate at one scale: what surrounds it, what exceeds that, and where the middle of the excess is.

use super::level::{Cell, View};
use crate::luminance::{LUMINANCE, luminance};
use crate::vector::{angle, dot, normalised};

/// Excess below this part of the largest does not move the centre: what is around a light is lit by it, and not evenly.
const CORE: f64 = 0.25;
/// Centres closer than this are the same, radians (1e-4°).
const SAME: f64 = 1.75e-6;
/// Most steps of the centre.
const STEPS: usize = 12;

/// A cap, and the light in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    /// The middle of the core.
    pub(super) centre: [f64; 3],
    /// Radius of the cap, radians.
    pub(super) scale: f64,
    /// Per channel the median of the ring from the radius to twice the radius.
    pub(super) background: [f32; 3],
    /// Integral of the luminance above the background over the cap.
    pub(super) excess: f64,
    /// Largest luminance above the background.
    pub(super) peak: f64,
}

impl Measured {
    /// The peak over the background.
    pub(super) fn contrast(&self) -> f64 {
        self.peak / self.background_luminance().max(f64::MIN_POSITIVE)
    }

    /// Radius of a disc of the peak's luminance with all of the excess: cos r = 1 − X/(2πY).
    pub(super) fn filled(&self) -> f64 {
        (1.0 - self.excess / (2.0 * std::f64::consts::PI * self.peak)).clamp(-1.0, 1.0).acos()
    }

    /// Luminance of the background.
    pub(super) fn background_luminance(&self) -> f64 {
        f64::from(luminance(self.background))
    }
}

/// Measures the cap of radius `scale` about `start`, moving it to the middle of what it finds. None where nothing exceeds the
/// background.
pub(super) fn measure(view: View<'_>, start: [f64; 3], scale: f64) -> Option<Measured> {
    let mut centre = start;
    let mut surrounded = start;
    let mut background = ring(view, centre, scale);
    let mut cells = Vec::new();
    let mut step = 0;
    loop {
        // the ring is a median: small steps do not change it
        if angle(surrounded, centre) > 0.1 * scale {
            (surrounded, background) = (centre, ring(view, centre, scale));
        }
        cells.clear();
        view.cap(centre, scale, |cell| cells.push(cell));
        let level = f64::from(luminance(background));
        let over = |cell: &Cell| (f64::from(luminance(cell.radiance)) - level).max(0.0);
        let peak = cells.iter().map(over).fold(0.0, f64::max);
        if peak <= 0.0 {
            return None;
        }
        let mut sum = [0.0; 3];
        for cell in cells.iter().filter(|cell| over(cell) > CORE * peak) {
            let weight = over(cell) * cell.solid_angle;
            sum = [0, 1, 2].map(|c| sum[c] + weight * cell.direction[c]);
        }
        let next = normalised(sum)?;
        let moved = angle(centre, next);
        centre = next;
        step += 1;
        if moved < SAME || step == STEPS {
            let excess = cells.iter().map(|cell| over(cell) * cell.solid_angle).sum();
            return Some(Measured { centre, scale, background, excess, peak });
        }
    }
}

/// Per channel the median over the ring from `radius` to twice that, weighted by solid angle.
fn ring(view: View<'_>, centre: [f64; 3], radius: f64) -> [f32; 3] {
    let inner = radius.cos();
    let mut values: [Vec<(f32, f64)>; 3] = Default::default();
    view.cap(centre, 2.0 * radius, |cell| {
        if dot(cell.direction, centre) < inner {
            for (values, value) in values.iter_mut().zip(cell.radiance) {
                values.push((value, cell.solid_angle));
            }
        }
    });
    values.map(|values| quantile(values, 0.5))
}

/// The value below which a part of the weight lies; 0 of nothing. Of the two halves only the one that holds it is looked at again.
pub(super) fn quantile(mut values: Vec<(f32, f64)>, part: f64) -> f32 {
    let mut below = part * values.iter().map(|v| v.1).sum::<f64>();
    let mut rest = values.as_mut_slice();
    while rest.len() > 1 {
        let half = rest.len() / 2;
        let (lower, middle, upper) = rest.select_nth_unstable_by(half, |a, b| a.0.total_cmp(&b.0));
        let weight: f64 = lower.iter().map(|v| v.1).sum();
        if weight >= below {
            rest = lower;
        } else if weight + middle.1 >= below || upper.is_empty() {
            return middle.0;
        } else {
            below -= weight + middle.1;
            rest = upper;
        }
    }
    rest.first().map_or(0.0, |v| v.0)
}

/// A light's own middle, within its core: the centroid of what exceeds the median of a ring of two cells about the core. It
/// leaves out an aureole that is brighter on one side, and takes in the fainter pixels at a disc's rim.
pub(super) fn core_centre(view: View<'_>, measured: &Measured) -> Option<([f64; 3], f64)> {
    let cell = view.level().cell_angle();
    let mut area = 0.0;
    let level = measured.background_luminance();
    view.cap(measured.centre, measured.scale, |c| {
        if f64::from(luminance(c.radiance)) - level > CORE * measured.peak {
            area += c.solid_angle;
        }
    });
    let radius = (area / std::f64::consts::PI).sqrt() + 1.5 * cell;
    let mut centre = measured.centre;
    let mut spread = 0.0;
    for _ in 0..STEPS {
        let mut ring = Vec::new();
        let mut inside = Vec::new();
        view.cap(centre, radius + 2.0 * cell, |c| {
            let y = luminance(c.radiance);
            if angle(c.direction, centre) > radius {
                ring.push((y, c.solid_angle));
            } else {
                inside.push((c, y));
            }
        });
        let base = f64::from(quantile(ring, 0.5));
        let mut sum = [0.0; 3];
        let mut total = 0.0;
        for (c, y) in &inside {
            let weight = (f64::from(*y) - base).max(0.0) * c.solid_angle;
            total += weight;
            sum = [0, 1, 2].map(|k| sum[k] + weight * c.direction[k]);
        }
        let next = normalised(sum)?;
        let moved = angle(next, centre);
        centre = next;
        spread = inside
            .iter()
            .map(|(c, y)| {
                (f64::from(*y) - base).max(0.0) * c.solid_angle * angle(c.direction, centre).powi(2)
            })
            .sum::<f64>()
            / total;
        if moved < SAME {
            break;
        }
    }
    Some((centre, spread))
}

/// Luminance of an integral.
pub(super) fn luminance_of(energy: [f64; 3]) -> f64 {
    energy.iter().zip(LUMINANCE).map(|(e, w)| e * f64::from(w)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_is_where_the_sorted_weights_reach_its_part() {
        let mut state = 7u64;
        let mut number = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / (1u64 << 24) as f64
        };
        for n in [1, 2, 3, 10, 101, 5000] {
            // values repeat, weights differ
            let values: Vec<_> = (0..n).map(|_| ((30.0 * number()).floor() as f32, 0.5 + number())).collect();
            let mut sorted = values.clone();
            sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
            let total: f64 = values.iter().map(|v| v.1).sum();
            for part in [0.1, 0.5, 0.9, 0.98] {
                let mut sum = 0.0;
                let expected = sorted.iter().find(|v| {
                    sum += v.1;
                    sum >= part * total
                });
                assert_eq!(quantile(values.clone(), part), expected.unwrap().0, "{part} of {n}");
            }
        }
        assert_eq!(quantile(Vec::new(), 0.5), 0.0);
    }
}
