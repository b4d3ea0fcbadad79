//! Lights in prefiltered levels and in harmonics: what is too narrow for a spectrum, in closed form. LIGHT (21).

use std::collections::HashMap;
use std::f64::consts::PI;

use veni_light::light::sh::{Basis, light_bands};
use veni_light::light::{CompactLight, Lights, lobe_gains};
use veni_light::vector::{unit, wide};

/// Steps of a table; one more entry, and one for what is rounded beyond it.
const STEPS: usize = 1024;
/// vec4s of a table.
const ROWS: usize = (STEPS + 2).div_ceil(4);
/// Degrees of a lobe; it keeps fewer from a roughness of 0.06 on.
const MOST_DEGREES: usize = 2047;
/// So many tables are kept; lights whose radius changes from frame to frame must not fill the memory.
const KEPT: usize = 64;

/// What the lobe of one level makes of lights, as tables of the chord between light and direction, which turns of a light leave as
/// they are. Keep it from frame to frame.
#[derive(Clone, Debug)]
pub struct Glints {
    alpha: f64,
    gains: Vec<f64>,
    tables: HashMap<u32, Table>,
}

/// Entry k is at the chord `width` sinh(k step).
#[derive(Clone, Debug)]
struct Table {
    inverse_width: f32,
    per_step: f32,
    values: Vec<f32>,
}

impl Glints {
    /// For the level of perceptual roughness `p`.
    ///
    /// # Panics
    /// Unless `p` is in (0, 1].
    pub fn new(p: f64) -> Self {
        Self { alpha: p * p, gains: lobe_gains(p, MOST_DEGREES), tables: HashMap::new() }
    }

    /// Binding 5 of [`level_source`](super::level_source): vec4u, 16 bytes each, for the `lights` of each latent
    /// ([`Field::lights`](veni_light::field::Field::lights)). One element of zeros where there are none.
    pub fn pack(&mut self, lights: &[Lights]) -> Vec<[u32; 4]> {
        let mut packed = vec![[0; 4]; lights.len().max(1)];
        let mut places: HashMap<u32, u32> = HashMap::new();
        for light in lights.iter().flat_map(|lights| lights.iter()) {
            places.entry(light.radius.to_bits()).or_insert_with(|| {
                let at = packed.len() as u32;
                packed.extend(self.table(light).rows());
                at
            });
        }
        for (latent, lights) in lights.iter().enumerate().filter(|(_, lights)| !lights.is_empty()) {
            packed[latent] = [packed.len() as u32, lights.len() as u32, 0, 0];
            for light in lights.iter() {
                let Table { inverse_width, per_step, .. } = *self.table(light);
                packed.push(row(light.direction, inverse_width.to_bits()));
                packed.push(row(light.irradiance, per_step.to_bits()));
                packed.push([places[&light.radius.to_bits()], 0, 0, 0]);
            }
        }
        packed
    }

    fn table(&mut self, light: &CompactLight) -> &Table {
        let key = light.radius.to_bits();
        if self.tables.len() >= KEPT && !self.tables.contains_key(&key) {
            self.tables.clear();
        }
        let Self { alpha, gains, tables } = self;
        tables.entry(key).or_insert_with(|| Table::new(*alpha, gains, light))
    }
}

impl Table {
    /// Σ (2l + 1)/4π g_l b_l P_l, of a light of energy 1.
    fn new(alpha: f64, gains: &[f64], light: &CompactLight) -> Self {
        let bands = light_bands(light, gains.len() - 1);
        let terms =
            gains.iter().zip(bands).enumerate().map(|(l, (g, b))| (2 * l + 1) as f64 / (4.0 * PI) * g * b);
        let terms: Vec<f64> = terms.collect();
        // dense within the lobe, which the light smooths to its own width, sparse beyond
        let width = (2.0 * alpha).hypot(f64::from(light.radius));
        let step = (2.0 / width).asinh() / STEPS as f64;
        let value = |k: usize| {
            let chord = (width * (step * k as f64).sinh()).min(2.0);
            // the last waves of a sum that was cut off may fall below 0
            series(&terms, -0.5 * chord * chord).max(0.0) as f32
        };
        Self {
            inverse_width: (1.0 / width) as f32,
            per_step: (1.0 / step) as f32,
            values: (0..4 * ROWS).map(|k| value(k.min(STEPS + 1))).collect(),
        }
    }

    fn rows(&self) -> impl Iterator<Item = [u32; 4]> {
        self.values.as_chunks::<4>().0.iter().map(|four| four.map(f32::to_bits))
    }
}

/// Σ terms_l P_l(1 + x): by differences of neighbours, which keep their digits where x is small.
fn series(terms: &[f64], x: f64) -> f64 {
    let (mut p, mut difference, mut sum) = (1.0, 0.0, 0.0);
    for (l, term) in terms.iter().enumerate() {
        sum += term * p;
        let l = l as f64;
        difference = (l * difference + (2.0 * l + 1.0) * x * p) / (l + 1.0);
        p += difference;
    }
    sum
}

fn row([x, y, z]: [f32; 3], last: u32) -> [u32; 4] {
    [x.to_bits(), y.to_bits(), z.to_bits(), last]
}

/// Binding 6 of [`spectrum_source`](super::spectrum_source): per latent (`degree` + 1)² vec4f, what its `lights` add to the
/// coefficients c_lm at l² + l + m. One element of zeros where no latent has lights.
pub fn pack_light_harmonics(degree: usize, lights: &[Lights]) -> Vec<[f32; 4]> {
    if lights.iter().all(|lights| lights.is_empty()) {
        return vec![[0.0; 4]];
    }
    let basis = Basis::new(degree);
    let mut values = vec![0.0; basis.len()];
    let mut packed = Vec::with_capacity(lights.len() * basis.len());
    for lights in lights {
        let mut sum = vec![[0.0; 3]; basis.len()];
        for light in lights.iter() {
            basis.evaluate(unit(wide(light.direction)), &mut values);
            let bands = light_bands(light, degree);
            for (index, (sum, y)) in sum.iter_mut().zip(&values).enumerate() {
                let factor = bands[index.isqrt()] * y;
                *sum = [0, 1, 2].map(|c| sum[c] + factor * f64::from(light.irradiance[c]));
            }
        }
        packed.extend(sum.into_iter().map(|[r, g, b]| [r as f32, g as f32, b as f32, 0.0]));
    }
    packed
}

#[cfg(test)]
mod tests {
    use veni_light::light::Sh;

    use super::*;

    fn light(radius: f32) -> CompactLight {
        CompactLight::new([0.36, -0.48, 0.8], [3.0, 2.0, 1.0], radius)
    }

    #[test]
    fn series_are_legendre_polynomials() {
        for cos in [1.0, 0.999_999, 0.3, -1.0] {
            let x: f64 = cos;
            let p = [1.0, x, 0.5 * (3.0 * x * x - 1.0), 0.5 * (5.0 * x * x * x - 3.0 * x)];
            for l in 0..4 {
                let mut terms = [0.0; 4];
                terms[l] = 1.0;
                assert!((series(&terms, cos - 1.0) - p[l]).abs() < 1e-12, "{cos}, {l}");
            }
        }
    }

    /// A table holds the energy of its light: ∫ over the sphere is 1, d(cos) = c dc for the chord c.
    #[test]
    fn tables_hold_one_whatever_the_lobe_and_the_light() {
        for p in [0.1, 0.134, 0.3, 0.6, 1.0] {
            let mut glints = Glints::new(p);
            for radius in [0.0, 0.004_65, 0.02, 0.1, 0.5] {
                let table = glints.table(&light(radius)).clone();
                let n = 200_000;
                let at = |chord: f64| {
                    let x = (chord * f64::from(table.inverse_width)).asinh() * f64::from(table.per_step);
                    let (low, t) = (x as usize, x.fract());
                    f64::from(table.values[low]) * (1.0 - t) + f64::from(table.values[low + 1]) * t
                };
                let sum: f64 = (0..n)
                    .map(|k| {
                        let chord = 2.0 * (f64::from(k) + 0.5) / f64::from(n);
                        at(chord) * chord * 2.0 / f64::from(n) * 2.0 * PI
                    })
                    .sum();
                assert!((sum - 1.0).abs() < 2e-3, "p = {p}, r = {radius}: {sum}");
            }
        }
    }

    #[test]
    fn harmonics_of_discs_are_those_of_the_library() {
        let lights = [Lights::default(), Lights::new(Some(light(0.004_65)), [light(0.02)])];
        let packed = pack_light_harmonics(12, &lights);
        assert_eq!(packed.len(), 2 * 169);
        assert!(packed[..169].iter().all(|c| *c == [0.0; 4]));
        let expected = Sh::<12>::of_light(&lights[1][0]).plus(&Sh::of_light(&lights[1][1]));
        for (found, expected) in packed[169..].iter().zip(expected.coefficients()) {
            for (a, b) in found.iter().zip(expected) {
                assert!((f64::from(*a) - b).abs() < 1e-6, "{a} for {b}");
            }
        }
        assert_eq!(pack_light_harmonics(12, &lights[..1]), [[0.0; 4]]);
    }

    #[test]
    fn tables_are_shared_and_not_kept_for_ever() {
        let mut glints = Glints::new(0.5);
        assert_eq!(glints.pack(&[Lights::default()]), [[0; 4]]);
        let two = [Lights::new(Some(light(0.1)), []), Lights::new(Some(light(0.1)), [light(0.2)])];
        let packed = glints.pack(&two);
        assert_eq!(packed.len(), 2 + 2 * ROWS + 3 * 3);
        assert_eq!([packed[0], packed[1]].map(|[first, count, ..]| [first, count]), {
            let first = 2 + 2 * ROWS as u32;
            [[first, 1], [first + 3, 2]]
        });
        for k in 0..200u16 {
            glints.pack(&[Lights::new(Some(light(f32::from(k) * 1e-3)), [])]);
        }
        assert!(glints.tables.len() <= KEPT);
    }
}
