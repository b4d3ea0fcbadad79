//! What a scene is made of. Angles are degrees, azimuths run counter-clockwise from +x, lengths are metres unless a
//! field says otherwise, colours linear Rec. 709.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::cloud_layer::CloudLayer;
use super::surface::{Ground, GroundMaterial};

/// All parameters of a scene; [`super::render`] is a function of these alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Seed of the set that the scene belongs to.
    pub seed: u64,
    /// Its place in the set.
    pub index: u64,
    /// Weather or time of day that it was drawn for.
    pub sky: SkyKind,
    /// Elevation of the sun, degrees; negative at dusk and at night.
    pub sun_elevation: f32,
    /// Azimuth of the sun, degrees from +x towards +y.
    pub sun_azimuth: f32,
    /// Linke-like turbidity of Preetham et al.: 2 very clear, 3 clear, 6 hazy, 10 murky.
    pub turbidity: f32,
    /// Column of ozone, Dobson units; it makes dusk blue.
    pub ozone: f32,
    /// The moon, on some nights.
    pub moon: Option<Moon>,
    /// Cloud layers.
    pub clouds: Vec<CloudLayer>,
    /// Radiance of the lights of towns at the horizon, kcd/m².
    pub glow: [f32; 3],
    /// Where the viewer stands.
    #[serde(rename = "place")]
    pub setting: Setting,
    /// How full of things the setting is, 0 to 1.
    pub fullness: f32,
    /// Height of the eye above the ground.
    pub eye: f32,
    /// The ground.
    pub ground: Ground,
    /// What closes the horizon, in any order.
    pub ridges: Vec<Ridge>,
    /// Whether lamps and windows are lit.
    pub lit: bool,
    /// Gains of the camera's white balance.
    pub white: [f32; 3],
}

/// Weather or time of day.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SkyKind {
    /// No cloud, or hardly any.
    Clear,
    /// Cumulus, stratus or both, with gaps.
    Cloudy,
    /// Closed stratus.
    Overcast,
    /// The sun within some degrees of the horizon.
    Sunset,
    /// The sun well below the horizon.
    Night,
}

impl SkyKind {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Clear, Self::Cloudy, Self::Overcast, Self::Sunset, Self::Night];

    /// The name in files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Clear => "clear",
            Self::Cloudy => "cloudy",
            Self::Overcast => "overcast",
            Self::Sunset => "sunset",
            Self::Night => "night",
        }
    }
}

/// What stands around the viewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Setting {
    /// Nothing but sky; below the horizon its blurred mirror image, as in the many published panoramas from which the
    /// ground was removed.
    PureSky,
    /// Open land up to the horizon.
    Plain,
    /// Hills or mountains around.
    Hills,
    /// Sea on one side.
    Coast,
    /// A lake between woods or hills.
    Lake,
    /// Lawn with single trees.
    Park,
    /// Among trunks, under a canopy.
    Forest,
    /// Houses with gardens.
    Village,
    /// Between two rows of houses.
    Street,
    /// A square with houses around.
    Square,
    /// Close walls all around.
    Courtyard,
    /// Boulders and rock walls.
    Rocks,
    /// Under a roof, bridge or arch that is open to the sides.
    Shelter,
}

impl Setting {
    /// All of them.
    pub const ALL: [Self; 13] = [
        Self::PureSky,
        Self::Plain,
        Self::Hills,
        Self::Coast,
        Self::Lake,
        Self::Park,
        Self::Forest,
        Self::Village,
        Self::Street,
        Self::Square,
        Self::Courtyard,
        Self::Rocks,
        Self::Shelter,
    ];

    /// The name in files and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::PureSky => "pure-sky",
            Self::Plain => "plain",
            Self::Hills => "hills",
            Self::Coast => "coast",
            Self::Lake => "lake",
            Self::Park => "park",
            Self::Forest => "forest",
            Self::Village => "village",
            Self::Street => "street",
            Self::Square => "square",
            Self::Courtyard => "courtyard",
            Self::Rocks => "rocks",
            Self::Shelter => "shelter",
        }
    }
}

/// The moon.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Moon {
    /// Degrees above the horizon.
    pub elevation: f32,
    /// Degrees from +x towards +y.
    pub azimuth: f32,
    /// Angle between sun and earth as seen from the moon, degrees: 0 is full.
    pub phase: f32,
}

/// A line of hills, mountains, trees or roofs that closes the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ridge {
    /// What it is.
    pub kind: RidgeKind,
    /// How far away.
    pub distance: f32,
    /// Its mean height above the ground.
    pub height: f32,
    /// How much the height varies, as a share of it.
    pub relief: f32,
    /// What it is covered with.
    pub surface: GroundMaterial,
    /// How much of the horizon a wood or a town leaves open, from 0 nothing to 1 all; not the share: 0.3 leaves a tenth,
    /// 0.7 four fifths.
    pub gaps: f32,
    /// Snow lies above this height.
    pub snow_line: f32,
    /// Seed of its shape.
    pub seed: u32,
}

/// What a ridge is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RidgeKind {
    /// Smooth.
    Hills,
    /// Jagged.
    Mountains,
    /// The edge of a wood.
    Trees,
    /// The skyline of a town.
    Town,
}

impl Scene {
    /// Unit direction towards the sun.
    pub fn sun(&self) -> [f32; 3] {
        self.sun_direction().to_array()
    }

    pub(super) fn sun_direction(&self) -> Vec3 {
        direction(self.sun_azimuth, self.sun_elevation)
    }
}

impl Moon {
    pub(super) fn direction(&self) -> Vec3 {
        direction(self.azimuth, self.elevation)
    }

    /// Light relative to the full moon (Krisciunas & Schaefer 1991).
    pub(super) fn phase_factor(&self) -> f32 {
        let a = self.phase.abs();
        10f32.powf(-0.4 * (0.026 * a + 4e-9 * a.powi(4)))
    }
}

/// A unit direction from azimuth and elevation in degrees.
pub(super) fn direction(azimuth: f32, elevation: f32) -> Vec3 {
    let ((sin_a, cos_a), (sin_e, cos_e)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
    Vec3::new(cos_e * cos_a, cos_e * sin_a, sin_e)
}
