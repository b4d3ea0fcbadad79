//! What the ground is made of. Angles are degrees, lengths metres, colours linear Rec. 709.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// The ground, flat at z = 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ground {
    /// What most of it is.
    pub surface: GroundMaterial,
    /// What the rest is.
    pub second: GroundMaterial,
    /// Where the second surface is.
    pub pattern: Pattern,
    /// Bearing of strips or of the normal of a shore, degrees.
    pub bearing: f32,
    /// Half width of a strip or row, or distance of a shore (negative: the viewer stands in it).
    pub width: f32,
    /// Distance of the middle of a strip, or phase of rows.
    pub offset: f32,
    /// Multiplies the albedo of both.
    pub tone: f32,
    /// Multiplies the contrast of its texture.
    pub contrast: f32,
    /// How much darker it is against low light than with it, 0 to 1.
    pub roughness: f32,
    /// How much darker it is straight below than far away, 0 to 1.
    pub hollow: f32,
    /// Share of a mirror, blurred: wet or trodden smooth, 0 to 1.
    pub sheen: f32,
    /// Speed of the wind over water, m/s.
    pub wind: f32,
    /// Seed of its texture.
    pub seed: u32,
}

/// Where the second surface of the ground is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pattern {
    /// Nowhere.
    None,
    /// In patches.
    Patches,
    /// Along a strip: a road, a path.
    Strip,
    /// In many strips: furrows, tyre tracks, mown lawn.
    Rows,
    /// Beyond a line.
    Shore,
}

/// What ground and slopes are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(missing_docs, reason = "the names say it")]
pub enum GroundMaterial {
    Grass,
    DryGrass,
    Soil,
    Sand,
    Rock,
    Snow,
    Asphalt,
    Paving,
    Leaves,
    Water,
}

impl GroundMaterial {
    /// Albedo under daylight: typical values of field measurements (ECOSTRESS and USGS spectral libraries).
    pub(super) fn albedo(self) -> Vec3 {
        match self {
            Self::Grass => Vec3::new(0.066, 0.081, 0.028),
            Self::DryGrass => Vec3::new(0.205, 0.165, 0.098),
            Self::Soil => Vec3::new(0.16, 0.115, 0.078),
            Self::Sand => Vec3::new(0.39, 0.32, 0.225),
            Self::Rock => Vec3::new(0.225, 0.205, 0.175),
            Self::Snow => Vec3::new(0.80, 0.82, 0.85),
            Self::Asphalt => Vec3::new(0.099, 0.095, 0.088),
            Self::Paving => Vec3::new(0.258, 0.24, 0.21),
            Self::Leaves => Vec3::new(0.12, 0.085, 0.055),
            Self::Water => Vec3::new(0.018, 0.03, 0.035),
        }
    }

    /// Size of its largest patches, and how much they differ (deviation of ln albedo).
    pub(super) fn texture(self) -> (f32, f32) {
        match self {
            Self::Grass => (3.0, 0.55),
            Self::DryGrass => (2.5, 0.55),
            Self::Soil => (2.0, 0.5),
            Self::Sand => (4.0, 0.22),
            Self::Rock => (1.5, 0.6),
            Self::Snow => (6.0, 0.09),
            Self::Asphalt => (5.0, 0.26),
            Self::Paving => (1.2, 0.36),
            Self::Leaves => (1.0, 0.75),
            Self::Water => (8.0, 0.0),
        }
    }
}

impl Ground {
    /// Albedo of the whole.
    pub(super) fn albedo(&self) -> [f32; 3] {
        let share = match self.pattern {
            Pattern::None => 0.0,
            Pattern::Patches | Pattern::Rows => 0.4,
            Pattern::Strip => 0.2,
            Pattern::Shore => 0.5,
        };
        (self.tone * self.surface.albedo().lerp(self.second.albedo(), share)).to_array()
    }
}
