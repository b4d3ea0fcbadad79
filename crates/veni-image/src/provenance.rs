//! Whether the pixels of a file are those that its attributes were written with.
//!
//! What a file remembers (a latent, a factor, a camera) is about its pixels. Other software changes pixels and keeps
//! attributes; a digest of the pixels beside them tells.

use std::collections::BTreeMap;

use twox_hash::xxhash3_128::Hasher;
use veni_light::sphere::Equirect;

/// Name of the attribute with the digest of the pixels: `xxh3:` and 32 hexadecimal digits, XXH3 (128 bits, seed 0) over
/// width and height (u32), then R, G, B of every pixel (f32), row-major, all little-endian. The values are those that a
/// reader decodes, after rounding to half precision or RGBE, before any factor, exposure or colour conversion.
pub const PIXEL_DIGEST: &str = "veni:pixels";

/// Whether the pixels are still those that the file's attributes were written with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Provenance {
    /// No digest was recorded.
    #[default]
    Unrecorded,
    /// The digest is that of the pixels.
    Same,
    /// The digest is not that of the pixels: other software changed them.
    Changed,
}

impl Provenance {
    /// What the attributes say of `pixels`, the values as they are stored.
    pub(crate) fn of(attributes: &BTreeMap<String, String>, grid: Equirect, pixels: &[[f32; 3]]) -> Self {
        let Some(recorded) = attributes.get(PIXEL_DIGEST) else { return Self::Unrecorded };
        let mut digest = PixelDigest::new(grid);
        digest.update(pixels);
        if *recorded == digest.finish() { Self::Same } else { Self::Changed }
    }
}

/// The digest of pixels that come row by row.
pub(crate) struct PixelDigest(Hasher);

impl PixelDigest {
    /// As long as every digest, where the right one is not known yet.
    pub(crate) const BLANK: &str = "xxh3:00000000000000000000000000000000";

    pub(crate) fn new(grid: Equirect) -> Self {
        let mut hasher = Hasher::new();
        for side in [grid.width, grid.height] {
            hasher.write(&(side as u32).to_le_bytes());
        }
        Self(hasher)
    }

    /// The next pixels, row-major.
    pub(crate) fn update(&mut self, pixels: &[[f32; 3]]) {
        let values = pixels.as_flattened();
        if cfg!(target_endian = "little") {
            self.0.write(bytemuck::cast_slice(values));
        } else {
            values.iter().for_each(|v| self.0.write(&v.to_le_bytes()));
        }
    }

    pub(crate) fn finish(&self) -> String {
        format!("xxh3:{:032x}", self.0.finish_128())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expected digits are Python's: `xxhash.xxh3_128_hexdigest(struct.pack("<2I6f", 2, 1, 1, 2, 3, 4, 5, 6))`.
    #[test]
    fn the_digest_is_what_the_format_says() {
        let pixels = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
        let mut digest = PixelDigest::new(Equirect::new(2, 1));
        pixels.iter().for_each(|pixel| digest.update(&[*pixel]));
        assert_eq!(digest.finish(), "xxh3:2496ed36f7b74f60572219a125eb8e7f");
        assert_eq!(digest.finish().len(), PixelDigest::BLANK.len());
    }

    #[test]
    fn one_bit_or_another_shape_is_noticed() {
        let pixels = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
        let mut digest = PixelDigest::new(Equirect::new(2, 1));
        digest.update(&pixels);
        let said = BTreeMap::from([(PIXEL_DIGEST.to_owned(), digest.finish())]);
        let of = |grid, pixels: &[[f32; 3]]| Provenance::of(&said, grid, pixels);
        assert_eq!(of(Equirect::new(2, 1), &pixels), Provenance::Same);
        assert_eq!(of(Equirect::new(1, 2), &pixels), Provenance::Changed);
        assert_eq!(of(Equirect::new(2, 1), &[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0000005]]), Provenance::Changed);
        assert_eq!(Provenance::of(&BTreeMap::new(), Equirect::new(2, 1), &pixels), Provenance::Unrecorded);
    }
}
