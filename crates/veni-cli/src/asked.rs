//! What a person asks of random skies: the sun, how overcast, how warm.

use anyhow::Result;
use clap::Args;
use serde_json::{Value, json};
use veni_light::latent::{Latent, SunRequest};
use veni_light::light::{LightOptions, SunChoice};
use veni_light::skies::{SkyMeasures, SkyRequest};
use veni_light::sphere::Equirect;

use crate::almanac::{self, Place, Time};
use crate::device::Device;
use crate::numbers::{finite, positive};
use crate::report::Report;

/// Columns of the panorama that what came is measured in.
const MEASURED: usize = 512;

/// Wishes for the skies of seeds.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "What the sky of a seed is asked for")]
pub(crate) struct Asked {
    /// Where the sun is, in degrees: azimuth, counter-clockwise seen from above from the middle of the panorama, and elevation; or
    /// whether there is one
    #[arg(long, value_name = "AZ,EL|any|none", value_parser = sun, allow_hyphen_values = true, conflicts_with = "date")]
    sun: Option<Sun>,

    /// Share of the light on level ground that does not come from the sun itself, 0.02 (clear) to 1 (no sun)
    #[arg(long, value_name = "SHARE", value_parser = positive)]
    overcast: Option<f64>,

    /// Colour temperature of the light on level ground, 2000 to 20000
    #[arg(long, value_name = "KELVIN", value_parser = positive)]
    temperature: Option<f64>,

    /// The sun where it is at this time, like 2026-06-21T18:30+02:00: the middle of the panorama is east, its left quarter north
    #[arg(long, value_name = "TIME", requires = "place")]
    date: Option<Time>,

    /// Latitude and longitude in degrees, north and east positive
    #[arg(long, value_name = "LAT,LON", requires = "date", allow_hyphen_values = true)]
    place: Option<Place>,
}

/// What is asked of the sun.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sun {
    Any,
    None,
    /// Degrees.
    At([f64; 2]),
}

fn sun(text: &str) -> Result<Sun, String> {
    match text {
        "any" => return Ok(Sun::Any),
        "none" => return Ok(Sun::None),
        _ => {}
    }
    let (azimuth, elevation) =
        text.split_once(',').ok_or("give azimuth and elevation in degrees, like 120,35; or any, or none")?;
    let angles = [finite(azimuth)?, finite(elevation)?];
    if angles[1] > 0.0 && angles[1] <= 90.0 {
        Ok(Sun::At(angles))
    } else {
        Err(format!("the elevation is above 0 and up to 90 degrees, not {elevation}"))
    }
}

impl Asked {
    /// Of how overcast it is alone.
    pub(crate) fn overcast(overcast: Option<f64>) -> Self {
        Self { overcast, ..Self::default() }
    }

    /// Whether anything is.
    pub(crate) fn is_any(&self) -> bool {
        self.sun.is_some() || self.overcast.is_some() || self.temperature.is_some() || self.date.is_some()
    }

    /// The request; of a time when the sun is down, a sky without it, which is said.
    pub(crate) fn request(&self, report: Report) -> Result<SkyRequest> {
        let sun = match (self.date, self.place) {
            (Some(time), Some(place)) => {
                let [azimuth, elevation] = almanac::sun(time, place)?;
                if elevation > 0.0 {
                    report.note(format_args!("the sun is at {azimuth:.1}°, {elevation:.1}°"));
                    Some(Sun::At([azimuth, elevation]))
                } else {
                    report.note(format_args!(
                        "the sun is {:.1}° below the horizon: a sky without it, though not a dark one",
                        -elevation
                    ));
                    Some(Sun::None)
                }
            }
            _ => self.sun,
        };
        Ok(self.with_sun(sun))
    }

    /// The request with the sun at azimuth and elevation, degrees.
    pub(crate) fn request_at(&self, angles: [f64; 2]) -> SkyRequest {
        self.with_sun(Some(Sun::At(angles)))
    }

    fn with_sun(&self, sun: Option<Sun>) -> SkyRequest {
        let sun = match sun {
            None => SunRequest::default(),
            Some(Sun::Any) => SunRequest { present: Some(true), ..SunRequest::default() },
            Some(Sun::None) => SunRequest { present: Some(false), ..SunRequest::default() },
            Some(Sun::At([azimuth, elevation])) => SunRequest {
                present: Some(true),
                azimuth: Some(azimuth.to_radians()),
                elevation: Some(elevation.to_radians()),
            },
        };
        SkyRequest { sun, overcast: self.overcast, temperature: self.temperature }
    }
}

/// A request, for a latent's source and for people; empty if nothing is asked.
pub(crate) fn request_in_words(request: &SkyRequest) -> String {
    let mut parts = Vec::new();
    match (request.sun.azimuth, request.sun.elevation, request.sun.present) {
        (Some(azimuth), Some(elevation), _) => parts.push(sun_in_words([azimuth, elevation])),
        (_, _, Some(present)) => parts.push(if present { "a sun" } else { "no sun" }.to_owned()),
        _ => {}
    }
    parts.extend(request.overcast.map(|share| format!("overcast {share}")));
    parts.extend(request.temperature.map(|kelvin| format!("{kelvin} K")));
    parts.join(", ")
}

/// A request, for programs.
pub(crate) fn request_json(request: &SkyRequest) -> Value {
    let degrees = |angle: Option<f64>| angle.map(f64::to_degrees);
    json!({
        "sun": request.sun.presence(),
        "azimuth": degrees(request.sun.azimuth),
        "elevation": degrees(request.sun.elevation),
        "overcast": request.overcast,
        "temperature": request.temperature,
    })
}

/// What came of a request, measured in the pixels of the sky as anyone would measure them: the code is not asked.
/// Where a sun was asked for, it is the strongest light of the sky, of a night's too.
pub(crate) fn measured(latent: &Latent, device: &Device, request: &SkyRequest) -> Result<SkyMeasures> {
    let grid = Equirect::new(MEASURED, MEASURED / 2);
    let pixels = device.condition(latent)?.bake(grid)?;
    let asked = request.sun.presence() == Some(true) || request.overcast.is_some();
    let sun = if asked { SunChoice::Sky } else { SunChoice::Auto };
    let light = LightOptions { sun, ..LightOptions::default() }.of_pixels(grid, pixels)?;
    Ok(SkyMeasures::of(&light))
}

/// Measures, for people.
pub(crate) fn in_words(measures: &SkyMeasures) -> String {
    let sun = measures.sun.map_or_else(|| "no sun".to_owned(), sun_in_words);
    let warmth =
        measures.temperature.map_or_else(|| "no colour temperature".to_owned(), |t| format!("{t:.0} K"));
    format!("{sun}, overcast {:.3}, {warmth}", measures.overcast)
}

/// Measures, for programs.
pub(crate) fn measures_json(measures: &SkyMeasures) -> Value {
    let [azimuth, elevation] = [0, 1].map(|k| measures.sun.map(|sun| sun[k].to_degrees()));
    json!({
        "sun": measures.sun.is_some(),
        "azimuth": azimuth,
        "elevation": elevation,
        "overcast": measures.overcast,
        "temperature": measures.temperature,
    })
}

fn sun_in_words(angles: [f64; 2]) -> String {
    let [azimuth, elevation] = angles.map(f64::to_degrees);
    format!("sun at {azimuth:.1}°, {elevation:.1}°")
}
