//! The distribution of scenes.
//!
//! Weather, time of day and setting are drawn first, everything else given these. The shares were set by hand so that
//! statistics of log radiance agree with those of photographed outdoor panoramas (docs/results/synthetic.md,
//! "Photographed and generated scenes").

mod clouds;
mod land;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::random::{Draw, Part};
use super::scene::{Moon, Scene, Setting, SkyKind};
use super::view::sun_in_view;
use clouds::clouds;
use land::{ground, ridges};

use crate::{Error, Result};

/// Overrides: what is given rather than drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Overrides {
    /// Weather or time of day.
    pub sky: Option<SkyKind>,
    /// What stands around the viewer.
    #[serde(rename = "place")]
    pub setting: Option<Setting>,
    /// Elevation of the sun, degrees.
    pub sun_elevation: Option<f32>,
    /// Azimuth of the sun, degrees from +x towards +y.
    pub sun_azimuth: Option<f32>,
    /// Turbidity, 1 to 12.
    pub turbidity: Option<f32>,
    /// Share of the sky that is cloud, 0 to 1.
    pub cloud_cover: Option<f32>,
    /// Multiplies the albedo of the ground so that its luminance is this, 0 to 0.95.
    pub ground_albedo: Option<f32>,
}

impl Overrides {
    /// Checks every number.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first one that is out of its range.
    pub fn check(&self) -> Result<()> {
        let ranges = [
            ("sun elevation", self.sun_elevation, -90.0, 90.0, "degrees"),
            ("sun azimuth", self.sun_azimuth, -360.0, 360.0, "degrees"),
            ("turbidity", self.turbidity, 1.0, 12.0, "(2 is very clear, 10 murky)"),
            ("cloud cover", self.cloud_cover, 0.0, 1.0, "(a share of the sky)"),
            ("ground albedo", self.ground_albedo, 0.0, 0.95, "(a share of the light)"),
        ];
        for (name, value, low, high, unit) in ranges {
            if value.is_some_and(|v| !(low..=high).contains(&v)) {
                let value = value.unwrap_or_default();
                return Err(Error::invalid(format!("{name} {value}: give {low} to {high} {unit}")));
            }
        }
        Ok(())
    }
}

impl Scene {
    /// Scene `index` of the set with this seed. Scenes of a set do not depend on each other, and what is not overridden
    /// does not depend on what is, except where it must (the colour of dusk on the height of the sun).
    pub fn draw(seed: u64, index: u64, overrides: &Overrides) -> Self {
        let mut draw = Draw::new(seed, index, Part::Scene);
        let draw = &mut draw;
        let sky = draw.weighted(&[
            (0.29, SkyKind::Clear),
            (0.23, SkyKind::Cloudy),
            (0.13, SkyKind::Overcast),
            (0.25, SkyKind::Sunset),
            (0.10, SkyKind::Night),
        ]);
        let sky = overrides.sky.unwrap_or(sky);
        let setting = draw.weighted(&[
            (0.21, Setting::PureSky),
            (0.12, Setting::Plain),
            (0.08, Setting::Hills),
            (0.04, Setting::Coast),
            (0.04, Setting::Lake),
            (0.10, Setting::Park),
            (0.07, Setting::Forest),
            (0.06, Setting::Village),
            (0.08, Setting::Street),
            (0.12, Setting::Square),
            (0.02, Setting::Courtyard),
            (0.03, Setting::Rocks),
            (0.03, Setting::Shelter),
        ]);
        let setting = overrides.setting.unwrap_or(setting);
        let elevation = elevation(draw, sky);
        let sun_elevation = overrides.sun_elevation.unwrap_or(elevation);
        let azimuth = draw.azimuth().to_degrees();
        let haze = draw.normal(0.0, 0.4).exp();
        let turbidity = (if sky == SkyKind::Overcast { 4.0 } else { 2.45 } * haze).clamp(1.7, 9.0);
        let clouds = clouds(draw, sky, overrides.cloud_cover);
        let moon = moon(draw, sun_elevation);
        let settled = matches!(
            setting,
            Setting::Street | Setting::Square | Setting::Courtyard | Setting::Village | Setting::Park
        );
        let glow = draw.log_range(5e-7, 2e-4) * if settled { 3.0 } else { 0.5 };
        let warm = draw.range(0.0, 1.0);
        let mut ground = ground(draw, setting);
        if let Some(albedo) = overrides.ground_albedo {
            ground.tone = 1.0;
            ground.tone = albedo / veni_image::luminance(ground.albedo()).max(1e-4);
        }
        let ridges = ridges(draw, setting, &ground);
        // what the camera leaves of a coloured cast: it takes the light of noon as white, more or less
        let cast = draw.normal(-0.28, 0.17);
        let tint = draw.normal(0.0, 0.03);
        let white = [(0.4 * cast).exp(), tint.exp(), (-0.8 * cast).exp()];
        let mut scene = Self {
            seed,
            index,
            sky,
            sun_elevation,
            sun_azimuth: overrides.sun_azimuth.unwrap_or(azimuth),
            turbidity: overrides.turbidity.unwrap_or(turbidity),
            ozone: draw.range(240.0, 420.0),
            moon,
            clouds,
            glow: (glow * Vec3::new(1.3, 0.85, 0.4).lerp(Vec3::new(1.0, 0.95, 0.85), warm)).to_array(),
            setting,
            fullness: draw.unit().powf(0.7),
            eye: eye(draw, setting),
            ground,
            ridges,
            lit: sun_elevation < 0.5 && (settled || draw.chance(0.3)),
            white,
        };
        if overrides.sun_azimuth.is_none() && sun_elevation > -0.3 {
            scene.seek_sun();
        }
        scene
    }

    /// Turns the sun to where the viewer sees it, if there is such a place. Photographers who measure light wait for the
    /// sun and step out of the shade: more suns are in view than chance would have.
    fn seek_sun(&mut self) {
        let mut draw = Draw::new(self.seed, self.index, Part::Sun);
        if draw.chance(SUN_SOUGHT) {
            let azimuths: [f32; 12] = std::array::from_fn(|_| draw.azimuth().to_degrees());
            let first = std::iter::once(self.sun_azimuth);
            if let Some(azimuth) = sun_in_view(self, first.chain(azimuths)) {
                self.sun_azimuth = azimuth;
            }
        }
    }
}

/// Share of scenes by day whose viewer stands in the sun if he can.
const SUN_SOUGHT: f32 = 0.6;

fn elevation(draw: &mut Draw, sky: SkyKind) -> f32 {
    // one draw in every case, so that what follows stays the same when the sky is fixed
    let u = draw.unit();
    let between = |low: f32, high: f32| low + (high - low) * u;
    match sky {
        SkyKind::Clear | SkyKind::Cloudy => {
            between(9f32.to_radians().sin(), 78f32.to_radians().sin()).asin().to_degrees()
        }
        SkyKind::Overcast => between(4.0, 65.0),
        // more of it just above the horizon
        SkyKind::Sunset => -4.5 + 14.0 * u.powf(0.9),
        SkyKind::Night => between(-40.0, -10.0),
    }
}

fn moon(draw: &mut Draw, sun_elevation: f32) -> Option<Moon> {
    let up = draw.chance(0.6);
    let moon = Moon {
        elevation: draw.range(6.0, 65.0),
        azimuth: draw.azimuth().to_degrees(),
        phase: draw.range(-100.0, 100.0),
    };
    (up && sun_elevation < -8.0).then_some(moon)
}

fn eye(draw: &mut Draw, setting: Setting) -> f32 {
    let (low, high, raised) = (draw.range(1.2, 2.0), draw.log_range(3.0, 25.0), draw.unit());
    let often = match setting {
        Setting::Hills | Setting::Coast => 0.25,
        Setting::Plain => 0.15,
        _ => 0.0,
    };
    if raised < often { high } else { low }
}
