//! The power of two that brings radiance into the range of the files.

use veni_image::Panorama;
use veni_image::engine::Engine;

/// What every format of cubes holds, less what a prefiltered texel may have above the brightest pixel.
const LARGEST: f32 = 60_000.0;
/// Means below this leave a third of a half float's precision unused.
const DARK: f64 = 1.0 / 1024.0;

/// One factor for all files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit(f32);

impl Unit {
    /// For a sky with the sun, `whole`, and the map that is prefiltered.
    pub(super) fn of(whole: &Panorama, map: &Panorama, engines: impl Iterator<Item = Engine>) -> Self {
        let brightest = |p: &Panorama| p.pixels().as_flattened().iter().fold(0f32, |a, b| a.max(*b));
        let mut limited = 0f32;
        for engine in engines {
            // EXR files go over to single precision by themselves
            match engine {
                Engine::Bevy | Engine::Filament => limited = limited.max(brightest(whole)),
                Engine::Three | Engine::Babylon | Engine::Gltf => limited = limited.max(brightest(map)),
                _ => {}
            }
        }
        if limited > LARGEST {
            return Self((-(limited / LARGEST).log2().ceil()).exp2());
        }
        let mean = f64::from(map.mean_log_luminance()).exp();
        if limited > 0.0 && mean < DARK {
            // as bright as fits, and no brighter than a mean of 1
            let headroom = (LARGEST / limited).log2().floor();
            let wish = (-mean.max(1e-30).log2()).floor() as f32;
            return Self(headroom.min(wish).exp2());
        }
        Self(1.0)
    }

    pub(super) fn factor(self) -> f32 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::sphere::Equirect;

    #[test]
    fn bright_and_dark_skies_are_brought_into_range() {
        let sky = |mean: f32, sun: f32| {
            let mut pixels = vec![[mean; 3]; 32];
            pixels[5] = [sun; 3];
            Panorama::new(Equirect::new(8, 4), pixels)
        };
        let factor = |p: &Panorama, engine| Unit::of(p, p, [engine].into_iter()).factor();
        assert_eq!(factor(&sky(1.0, 5e4), Engine::Bevy), 1.0);
        assert_eq!(factor(&sky(1.0, 1e6), Engine::Bevy), 1.0 / 32.0);
        // single precision holds it
        assert_eq!(factor(&sky(1.0, 1e6), Engine::Blender), 1.0);
        let dark = factor(&sky(1e-5, 1.0), Engine::Three);
        assert!(dark > 1e3 && dark <= 6e4, "{dark}");
        assert_eq!(factor(&sky(0.0, 0.0), Engine::Three), 1.0);
    }
}
