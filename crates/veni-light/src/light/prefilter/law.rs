//! Which level of a mip chain holds which roughness.

/// How an engine looks up perceptual roughness p in a chain of levels l = 0 … M.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// l = M p: Bevy, glTF's sample viewer.
    Linear,
    /// l = M p (2 − p): Filament, three.js since r187.
    Quadratic,
    /// α = 2^(l / 0.8) / size: Babylon.js, whose chain goes down to one texel.
    Babylon,
}

/// The size, number and law of a chain of levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Levels {
    size: usize,
    count: usize,
    law: Law,
}

impl Levels {
    /// Levels of `size` texels, half of it, and so on, `count` of them in all.
    ///
    /// # Panics
    /// If there is no level, or one would be smaller than a texel.
    pub fn new(size: usize, count: usize, law: Law) -> Self {
        assert!(count > 0 && count <= Self::most(size), "{count} levels of {size} texels");
        Self { size, count, law }
    }

    /// The levels down to `last` texels.
    ///
    /// # Panics
    /// If `size` is smaller than `last`, or one is 0.
    pub fn down_to(size: usize, last: usize, law: Law) -> Self {
        assert!(last > 0 && size >= last, "levels from {size} down to {last} texels");
        Self::new(size, (size / last).ilog2() as usize + 1, law)
    }

    /// The most levels that a size has.
    fn most(size: usize) -> usize {
        size.checked_ilog2().map_or(0, |n| n as usize + 1)
    }

    /// Number of levels, M + 1.
    pub fn count(self) -> usize {
        self.count
    }

    /// Texels along the side of level `level`.
    pub fn size(self, level: usize) -> usize {
        self.size >> level
    }

    /// Perceptual roughness p of a level; 0 for the first.
    pub fn roughness(self, level: usize) -> f64 {
        if level == 0 {
            return 0.0;
        }
        let at = level as f64 / (self.count - 1) as f64;
        match self.law {
            Law::Linear => at,
            Law::Quadratic => 1.0 - (1.0 - at).sqrt(),
            Law::Babylon => ((level as f64 / 0.8).exp2() / self.size as f64).min(1.0).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_of_the_engines() {
        let filament = Levels::down_to(256, 16, Law::Quadratic);
        assert_eq!((filament.count(), filament.size(4)), (5, 16));
        for (level, p) in [(0, 0.0), (1, 0.134), (2, 0.293), (3, 0.5), (4, 1.0)] {
            assert!((filament.roughness(level) - p).abs() < 1e-3);
        }
        let bevy = Levels::down_to(256, 1, Law::Linear);
        assert_eq!((bevy.count(), bevy.roughness(4), bevy.roughness(8)), (9, 0.5, 1.0));
        let babylon = Levels::down_to(256, 1, Law::Babylon);
        // lod = 0.8 log2(size α)
        for level in 1..6 {
            let alpha = babylon.roughness(level).powi(2);
            assert!((0.8 * (256.0 * alpha).log2() - level as f64).abs() < 1e-9);
        }
        assert_eq!(babylon.roughness(8), 1.0);
    }
}
