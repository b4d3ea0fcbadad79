//! A ready folder for each engine: the sky in the files that it loads, the sun as a light of its own, and the lines that load them.
//!
//! One file per engine says its conventions: the frame, the cube's axes, the law of its levels, the unit of its sun. All share one
//! unit: radiance in the files is that of the panorama, and the sun's irradiance is in the same unit times steradian, so that sky
//! and sun agree whatever exposure a scene takes. Where an engine has physical units, one constant (cd/m² per unit) is on both.

mod any;
mod babylon;
mod bevy;
mod blender;
mod filament;
mod folder;
mod gltf;
mod godot;
mod light;
mod mitsuba;
mod pbrt;
mod three;
mod usd;

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use veni_light::light::{CompactLight, Law, Levels, Prefilter, Sh};
use veni_light::output::Overwrite;
use veni_light::progress::Observer;

use crate::{Panorama, Result};
use folder::Folder;

/// An engine that a folder can be made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Engine {
    /// Bevy 0.20.
    Bevy,
    /// Filament.
    Filament,
    /// three.js r187.
    Three,
    /// Godot 4.
    Godot,
    /// Babylon.js 9.
    Babylon,
    /// glTF with EXT_lights_image_based and KHR_lights_punctual.
    Gltf,
    /// pbrt-v4.
    Pbrt,
    /// Mitsuba 3.
    Mitsuba,
    /// Blender, Cycles and EEVEE.
    Blender,
    /// USD.
    Usd,
    /// Plain images and JSON for a renderer of one's own.
    Any,
}

impl Engine {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Bevy,
        Self::Filament,
        Self::Three,
        Self::Godot,
        Self::Babylon,
        Self::Gltf,
        Self::Pbrt,
        Self::Mitsuba,
        Self::Blender,
        Self::Usd,
        Self::Any,
    ];

    /// Its name in lower case, for folders.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bevy => "bevy",
            Self::Filament => "filament",
            Self::Three => "three",
            Self::Godot => "godot",
            Self::Babylon => "babylon",
            Self::Gltf => "gltf",
            Self::Pbrt => "pbrt",
            Self::Mitsuba => "mitsuba",
            Self::Blender => "blender",
            Self::Usd => "usd",
            Self::Any => "any",
        }
    }

    /// Its version, and what its folder holds, in a few words.
    pub fn takes(self) -> &'static str {
        match self {
            Self::Bevy => "Bevy 0.20: KTX2 cubes",
            Self::Filament => "Filament: KTX1 cubes with harmonics",
            Self::Three => "three.js r187: a KTX2 cube as PMREM",
            Self::Godot => "Godot 4: panorama and scene",
            Self::Babylon => "Babylon.js 9: .env",
            Self::Gltf => "glTF with EXT_lights_image_based, for Babylon.js",
            Self::Pbrt => "pbrt-v4: equal-area square",
            Self::Mitsuba => "Mitsuba 3: panorama and XML",
            Self::Blender => "Blender: panorama and script",
            Self::Usd => "USD: dome light and distant light",
            Self::Any => "EXR cubes, split-sum table and JSON for a renderer of your own",
        }
    }

    /// The prefiltered levels that it looks up, for faces of `size` texels; none where it filters by itself.
    pub fn levels(self, size: usize) -> Option<Levels> {
        match self {
            Self::Bevy | Self::Any => Some(Levels::down_to(size, 8.min(size), Law::Linear)),
            Self::Filament => Some(Levels::down_to(size, 16.min(size), Law::Quadratic)),
            Self::Three => Some(Levels::down_to(size, 8.min(size), Law::Quadratic)),
            Self::Babylon => Some(Levels::down_to(size, 1, Law::Babylon)),
            Self::Gltf => Some(Levels::down_to(size, 16.min(size), Law::Linear)),
            Self::Godot | Self::Pbrt | Self::Mitsuba | Self::Blender | Self::Usd => None,
        }
    }

    /// Images that are made for it, as progress counts them.
    pub fn images(self, size: usize) -> usize {
        let levels = self.levels(size).map_or(1, Levels::count);
        levels
            + usize::from(matches!(self, Self::Bevy | Self::Any))
            + usize::from(matches!(self, Self::Bevy | Self::Filament | Self::Three | Self::Any))
    }
}

/// What all folders are made of.
#[derive(Clone, Debug)]
pub struct Sky<'a> {
    /// Light without the sun where the sun is a light of its own, else all of it; as maps, analysed for the levels of every engine.
    pub prefilter: &'a Prefilter<'a>,
    /// The same light as a panorama.
    pub panorama: &'a Panorama,
    /// The same as nine harmonics.
    pub sh: &'a Sh<2>,
    /// What a camera sees behind the scene: with the sun.
    pub background: &'a Panorama,
    /// The sun, if it is a light of its own.
    pub sun: Option<CompactLight>,
    /// Texels along a face of the first prefiltered level.
    pub size: usize,
    /// Luminance of one unit of radiance, cd/m².
    pub exposure: f64,
    /// What samples the light in a shader, for [`Engine::Any`].
    pub sampling: Option<Sampling>,
}

/// Functions of a shader that sample a light, and what they read.
#[derive(Clone, Debug)]
pub struct Sampling {
    /// Their text.
    pub wgsl: String,
    /// Each buffer by its name in the text, little endian.
    pub buffers: Vec<(&'static str, Vec<u8>)>,
}

/// Writes the folder for an engine, with everything in it or not at all, and gives the files. Every image is reported
/// to `observer`.
///
/// # Errors
/// [`Error::Exists`](crate::Error::Exists) if the folder holds anything and may not be replaced; an
/// [`Error`](crate::Error) of kind `Invalid` for radiance that the engine's files cannot hold; what the system says.
pub fn write(
    engine: Engine,
    sky: &Sky<'_>,
    folder: &Path,
    overwrite: Overwrite,
    observer: &dyn Observer,
) -> Result<Vec<PathBuf>> {
    let mut folder = Folder::begin(folder, overwrite)?;
    let make = match engine {
        Engine::Bevy => bevy::write,
        Engine::Filament => filament::write,
        Engine::Three => three::write,
        Engine::Godot => godot::write,
        Engine::Babylon => babylon::write,
        Engine::Gltf => gltf::write,
        Engine::Pbrt => pbrt::write,
        Engine::Mitsuba => mitsuba::write,
        Engine::Blender => blender::write,
        Engine::Usd => usd::write,
        Engine::Any => any::write,
    };
    make(sky, &mut folder, observer)?;
    folder.finish()
}

pub use folder::refuse_existing;
