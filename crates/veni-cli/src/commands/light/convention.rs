//! How engines write nine harmonics.

use clap::ValueEnum;
use veni_light::light::Sh;

/// How harmonics are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Convention {
    /// Radiance, native frame
    Native,
    /// Filament's sh.txt: E/π as a polynomial, its frame
    Filament,
    /// three.js' SphericalHarmonics3: radiance, no sign, its frame
    Three,
    /// The polynomial of Babylon's .env files (x y z xx yy zz yz zx xy), its left-handed frame
    Babylon,
    /// glTF's `EXT_lights_image_based`: irradiance, its frame
    Gltf,
    /// Irradiance, native frame
    Irradiance,
}

impl Convention {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Native => "native",
            Self::Filament => "filament",
            Self::Three => "three",
            Self::Babylon => "babylon",
            Self::Gltf => "gltf",
            Self::Irradiance => "irradiance",
        }
    }

    /// Nine coefficients, as it wants them.
    pub(super) fn of(self, sh: &Sh<2>) -> [[f32; 3]; 9] {
        let native = |sh: &Sh<2>| std::array::from_fn(|k| sh.coefficients()[k].map(|v| v as f32));
        match self {
            Self::Native => native(sh),
            Self::Filament => sh.filament(),
            Self::Three => sh.three(),
            Self::Babylon => sh.babylon(),
            Self::Gltf => sh.gltf(),
            Self::Irradiance => native(&sh.irradiance()),
        }
    }
}
