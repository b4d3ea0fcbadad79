//! The uniform of a level: `VeniLevel` in `level.wgsl`.

use veni_light::sphere::Frame;

use super::Grid;
use super::request::axes;

/// One level of a prefiltered cube map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Texels along an edge.
    pub size: u32,
    /// Whose axes name the faces.
    pub frame: Frame,
    /// Rotates the scene about z by this angle, radians, counter-clockwise seen from above.
    pub rotation: f64,
    /// Largest degree of the coefficients.
    pub degree: u32,
    /// Largest degree that the level's lobe keeps.
    pub kept: u32,
    /// Where its gains begin in the buffer of all gains.
    pub gains: u32,
    /// A texel is the mean of this number of places, squared.
    pub samples: u32,
    /// Largest number that is stored.
    pub largest: f32,
}

impl Level {
    /// Bytes of the uniform.
    pub const BYTES: usize = 64;

    /// Places along a texel's edge: texels wider than the lobe of perceptual roughness `p`, and the smallest faces, are means;
    /// others are what the lobe gathers at their centre, as in [`Prefilter::level`](veni_light::light::Prefilter::level). Never so
    /// many that an invocation sums more than [`Level::TERMS`] terms for `kept` degrees.
    pub fn samples(size: u32, p: f64, kept: u32) -> u32 {
        let (size, orders) = (f64::from(size), f64::from(kept + 1));
        let least = if size < 8.0 { 32.0 / size } else { 1.0 };
        let most = (f64::from(Self::TERMS) / (0.5 * orders * (orders + 3.0))).sqrt().floor().max(1.0);
        (2.0 / (size * p * p)).ceil().max(least).min(most.min(16.0)) as u32
    }

    /// Terms of an invocation: Mesa's drivers in software leave a loop after 65,536 rounds.
    pub const TERMS: u32 = 60_000;

    /// The uniform, little endian as WGSL lays it out.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let [x, y, z] =
            axes(Grid::Cube { size: self.size }, self.frame, self.rotation).map(|v| v.map(f32::to_bits));
        let row = |[a, b, c]: [u32; 3], d: u32| [a, b, c, d];
        let words = [
            row(x, self.size),
            row(y, self.degree),
            row(z, self.kept),
            [self.gains, self.samples, self.largest.to_bits(), 0],
        ];
        let mut bytes = [0; Self::BYTES];
        let words = words.as_flattened().iter();
        bytes.as_chunks_mut::<4>().0.iter_mut().zip(words).for_each(|(b, w)| *b = w.to_le_bytes());
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_are_means_where_they_must_and_work_is_bounded() {
        // a lobe wider than a texel, one narrower, the smallest faces
        assert_eq!(
            [Level::samples(64, 1.0, 16), Level::samples(64, 0.25, 40), Level::samples(1, 1.0, 8)],
            [1, 1, 16]
        );
        assert_eq!(Level::samples(16, 0.134, 64), 5);
        for kept in 0..=128 {
            for size in [1, 2, 16, 256] {
                let n = Level::samples(size, 0.1, kept);
                assert!(
                    n >= 1
                        && n * n * (kept + 1) * (kept + 4) / 2
                            <= Level::TERMS.max((kept + 1) * (kept + 4) / 2)
                );
            }
        }
    }
}
