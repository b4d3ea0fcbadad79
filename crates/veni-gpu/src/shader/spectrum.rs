//! The kernels of harmonics and levels as text, and the tables that they read.

use std::f64::consts::PI;

use veni_light::light::gauss_legendre;
use veni_light::light::sh::Basis;

use super::StorageFormat;

/// Names of the entry points of [`spectrum_source`], in the order in which they run: both over 64 invocations of x, and latents
/// along z.
pub const SPECTRUM_ENTRY_POINTS: [&str; 2] = ["veni_waves", "veni_degrees"];
/// Name of the entry point of [`level_source`]: 8 × 8 texels a workgroup, six faces of each latent along z.
pub const LEVEL_ENTRY_POINT: &str = "veni_level";
/// The largest degree: beyond it, f32 does not hold the factors of the recurrence beside a pole.
pub const MAX_DEGREE: usize = 128;

/// The module that turns radiance on rings into harmonics. Group 0: a uniform of three u32 (rings, columns, degree; 16 bytes);
/// phases, Legendre functions and radiance (without lights), read-only; waves (2 · rings · (degree + 1) vec4f per latent) and
/// coefficients ((degree + 1)² vec4f per latent), written; those of the lights ([`pack_light_harmonics`](super::pack_light_harmonics)),
/// read-only; and the coefficients with the lights, written.
pub fn spectrum_source() -> &'static str {
    include_str!("../../shaders/spectrum.wgsl")
}

/// The module that turns harmonics into a level. Group 0: the uniform [`Level`](super::Level); steps, gains and coefficients (without
/// lights), read-only; a write-only storage texture (2D array of six layers per latent); lights ([`Glints`](super::Glints)), read-only.
pub fn level_source(format: StorageFormat) -> String {
    let level = include_str!("../../shaders/level.wgsl").replace("VENI_FORMAT", format.wgsl());
    [&level, include_str!("../../shaders/cube.wgsl")].join("\n")
}

/// A decoded field has something up to degrees in the hundreds: fewer rings take it for something else.
const LEAST_RINGS: usize = 64;

/// Where radiance is asked for, and the factors of the sums, for harmonics of all degrees up to L.
#[derive(Clone, Debug)]
pub struct SpectrumTables {
    /// L.
    pub degree: usize,
    /// Rings of latitude, from the top.
    pub rings: usize,
    /// Directions of a ring, counter-clockwise from +x.
    pub columns: usize,
    /// Native unit directions, ring after ring, as [`Directions::Buffer`](super::Directions::Buffer) reads them.
    pub directions: Vec<[f32; 4]>,
    /// cos and sin of 2πk/columns.
    pub phases: Vec<[f32; 2]>,
    /// w_j Y_lm(θ_j, 0) for m ≥ 0, at (l(l+1)/2 + m)·rings + j: Gauss's weights times 2π/columns.
    pub legendre: Vec<f32>,
    /// a and b of q_l = a (z q_{l−1} − b q_{l−2}), at l(l+1)/2 + m.
    pub steps: Vec<[f32; 2]>,
}

impl SpectrumTables {
    /// For harmonics up to `degree`, with two rings per degree and 64 at least: what the light has up to three times the degree leaves
    /// no trace in them.
    ///
    /// # Panics
    /// If `degree` exceeds [`MAX_DEGREE`].
    pub fn new(degree: usize) -> Self {
        Self::with_rings(degree, (2 * (degree + 1)).max(LEAST_RINGS))
    }

    /// The same with a number of rings of one's choice.
    ///
    /// # Panics
    /// If `degree` exceeds [`MAX_DEGREE`], or there are fewer rings than degrees.
    pub fn with_rings(degree: usize, rings: usize) -> Self {
        assert!(degree <= MAX_DEGREE, "degree {degree} is beyond {MAX_DEGREE}");
        assert!(rings > degree, "{rings} rings do not hold degree {degree}");
        let columns = 2 * rings;
        let basis = Basis::new(degree);
        let (nodes, mut values) = (gauss_legendre(rings), vec![0.0; basis.len()]);
        let mut legendre = vec![0.0; (degree + 1) * (degree + 2) / 2 * rings];
        let mut directions = Vec::with_capacity(rings * columns);
        let phase = |k: usize| (2.0 * PI * k as f64 / columns as f64).sin_cos();
        for (j, (z, weight)) in nodes.into_iter().enumerate() {
            let r = (1.0 - z * z).sqrt();
            basis.evaluate([r, 0.0, z], &mut values);
            for l in 0..=degree {
                for m in 0..=l {
                    let value = weight * 2.0 * PI / columns as f64 * values[l * l + l + m];
                    legendre[(l * (l + 1) / 2 + m) * rings + j] = value as f32;
                }
            }
            directions.extend((0..columns).map(phase).map(|(s, c)| [r * c, r * s, z, 0.0].map(|v| v as f32)));
        }
        let step = |l: usize, m: usize| {
            let (l, m) = (l as f64, m as f64);
            let below = l - 1.0;
            let a = ((4.0 * l * l - 1.0) / (l * l - m * m)).sqrt();
            let b = ((below * below - m * m).max(0.0) / (4.0 * below * below - 1.0)).sqrt();
            [a as f32, b as f32]
        };
        let steps = (0..=degree)
            .flat_map(|l| (0..=l).map(move |m| if l > m { step(l, m) } else { [0.0; 2] }))
            .collect();
        let phases = (0..columns).map(phase).map(|(s, c)| [c as f32, s as f32]).collect();
        Self { degree, rings, columns, directions, phases, legendre, steps }
    }

    /// (L + 1)², coefficients of a latent.
    pub fn coefficients(&self) -> usize {
        (self.degree + 1) * (self.degree + 1)
    }

    /// vec4f of waves of a latent.
    pub fn waves(&self) -> usize {
        2 * self.rings * (self.degree + 1)
    }

    /// The uniform of [`spectrum_source`].
    pub fn to_bytes(&self) -> [u8; 16] {
        let words = [self.rings, self.columns, self.degree, 0].map(|n| n as u32);
        let mut bytes = [0; 16];
        bytes.as_chunks_mut::<4>().0.iter_mut().zip(words).for_each(|(b, w)| *b = w.to_le_bytes());
        bytes
    }
}
