//! Where the sun is at a time and place.

use std::str::FromStr;

use anyhow::{Result, anyhow, bail};
use chrono::{DateTime, Duration, FixedOffset, NaiveDate, NaiveTime};
use solar_positioning::{Location, RefractionCorrection, SolarPositions, delta_t};

/// A moment, with its offset from universal time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Time(DateTime<FixedOffset>);

/// Latitude and longitude, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    latitude: f64,
    longitude: f64,
}

/// A day of the calendar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Day(NaiveDate);

/// Steps in which the sun's rise and set are looked for: a minute.
const MINUTES: i64 = 24 * 60;
/// Hours of a turn of the earth by one degree.
const HOURS_PER_DEGREE: f64 = 1.0 / 15.0;

impl FromStr for Time {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // seconds may be left out
        let all = ["%Y-%m-%dT%H:%M%#z", "%Y-%m-%dT%H:%M:%S%.f%#z"];
        let parsed = all.iter().find_map(|form| DateTime::parse_from_str(text, form).ok());
        parsed.or_else(|| DateTime::parse_from_rfc3339(text).ok()).map(Self).ok_or_else(|| {
            format!("'{text}' is not a time with its offset: give one like 2026-06-21T18:30+02:00, or with Z at the end")
        })
    }
}

impl FromStr for Day {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.parse().map(Self).map_err(|_| format!("'{text}' is not a date: give one like 2026-06-21"))
    }
}

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<f64>().ok();
        let both = text.split_once(',').and_then(|(a, b)| Some([number(a)?, number(b)?]));
        match both {
            Some([latitude, longitude]) if latitude.abs() <= 90.0 && longitude.abs() <= 180.0 => {
                Ok(Self { latitude, longitude })
            }
            Some(_) => Err("the latitude is within 90 degrees, the longitude within 180".to_owned()),
            None => Err(format!(
                "'{text}' is not a place: give latitude and longitude in degrees, like 48.1,11.6"
            )),
        }
    }
}

/// Azimuth, counter-clockwise from east seen from above, and elevation of the sun in degrees: x points east, y north, as on maps.
/// Refraction by a standard atmosphere is included.
pub(crate) fn sun(Time(time): Time, Place { latitude, longitude }: Place) -> Result<[f64; 2]> {
    let wrong = |e: solar_positioning::Error| anyhow!("the sun's position on {time}: {e}");
    let delta = delta_t::estimate_from_date_like(&time).map_err(wrong)?;
    let refraction = Some(RefractionCorrection::standard());
    let location = Location { latitude, longitude };
    let position = SolarPositions::new().at(&time, location, 0.0, delta, refraction).map_err(wrong)?;
    let azimuth = (90.0 - position.azimuth() + 540.0).rem_euclid(360.0) - 180.0;
    Ok([azimuth, position.elevation_angle()])
}

/// `count` moments from sunrise to sunset of a day, evenly, each with the sun's azimuth and elevation; the day is that of the place's
/// own solar time. The first and the last are a little after and before: with the sun above the horizon.
pub(crate) fn daylight(Day(date): Day, place: Place, count: usize) -> Result<Vec<(Time, [f64; 2])>> {
    let offset = (place.longitude * HOURS_PER_DEGREE * 3600.0).round() as i32;
    let zone =
        FixedOffset::east_opt(offset).ok_or_else(|| anyhow!("no solar time at {}°", place.longitude))?;
    let midnight = date.and_time(NaiveTime::MIN).and_local_timezone(zone).single();
    let midnight = midnight.ok_or_else(|| anyhow!("{date} has no midnight"))?;
    let at = |minute: f64| Time(midnight + Duration::milliseconds((minute * 60_000.0) as i64));
    let mut up = Vec::new();
    for minute in 0..MINUTES {
        if sun(at(minute as f64), place)?[1] > 0.0 {
            up.push(minute as f64);
        }
    }
    let (Some(first), Some(last)) = (up.first(), up.last()) else {
        bail!("the sun does not rise on {date} at {}°, {}°", place.latitude, place.longitude);
    };
    let step = (last - first) / (count.max(2) - 1) as f64;
    (0..count).map(|k| at(first + step * k as f64)).map(|time| Ok((time, sun(time, place)?))).collect()
}

impl std::fmt::Display for Time {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.0.format("%Y-%m-%dT%H:%M:%S%:z"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(text: &str) -> Place {
        text.parse().unwrap()
    }

    /// The example of the algorithm's paper (Reda and Andreas 2004, table A5.1): topocentric zenith 50.11162°, azimuth 194.34024°, at
    /// 1830 m and 820 mbar; at sea level under a standard atmosphere the refraction differs by 0.005°.
    #[test]
    fn the_published_example() {
        let time = "2003-10-17T12:30:30-07:00".parse().unwrap();
        let [azimuth, elevation] = sun(time, place("39.742476,-105.1786")).unwrap();
        assert!((azimuth - (90.0 - 194.34024)).abs() < 0.001, "{azimuth}");
        assert!((elevation - (90.0 - 50.11162)).abs() < 0.01, "{elevation}");
    }

    #[test]
    fn compass_directions_are_those_of_a_map() {
        // noon at the equator's equinox is overhead; morning is east, evening west
        let at = |text: &str| sun(text.parse().unwrap(), place("50,0")).unwrap();
        let [morning, noon, evening] =
            ["2026-03-20T06:30Z", "2026-03-20T12:07Z", "2026-03-20T17:45Z"].map(at);
        assert!(morning[0].abs() < 10.0 && morning[1] > 0.0, "{morning:?}");
        assert!((noon[0] + 90.0).abs() < 1.0 && (noon[1] - 40.0).abs() < 1.0, "{noon:?}");
        assert!(evening[0].abs() > 170.0 && evening[1] > 0.0, "{evening:?}");
    }

    #[test]
    fn a_day_goes_from_sunrise_to_sunset() {
        let day = "2026-06-21".parse().unwrap();
        let frames = daylight(day, place("48.1,11.6"), 49).unwrap();
        assert_eq!(frames.len(), 49);
        assert!(frames.iter().all(|(_, [_, elevation])| *elevation > 0.0));
        let highest = frames.iter().map(|(_, sun)| sun[1]).fold(0.0, f64::max);
        assert!((highest - (90.0 - 48.1 + 23.43)).abs() < 0.2, "{highest}");
        assert!(frames[0].1[1] < 0.5 && frames[48].1[1] < 0.5, "{frames:?}");
        // south of the tropics the noon sun is in the north
        let south = daylight(day, place("-40,170"), 3).unwrap();
        assert!((south[1].1[0] - 90.0).abs() < 3.0, "{south:?}");
        assert!(daylight("2026-12-21".parse().unwrap(), place("80,0"), 3).is_err());
        // midnight sun: the whole day
        assert_eq!(daylight(day, place("80,0"), 5).unwrap().len(), 5);
    }

    #[test]
    fn what_is_no_time_or_place_is_refused() {
        for text in ["2026-06-21", "2026-06-21T18:30", "18:30+02:00", "2026-13-01T00:00Z", ""] {
            assert!(text.parse::<Time>().is_err(), "{text}");
        }
        for text in ["2026-06-21T18:30+02:00", "2026-06-21T18:30:15+02:00", "2026-06-21T16:30Z"] {
            assert!(text.parse::<Time>().is_ok(), "{text}");
        }
        for text in ["91,0", "0,181", "48.1", "a,b", "nan,0"] {
            assert!(text.parse::<Place>().is_err(), "{text}");
        }
        assert!("2026-02-30".parse::<Day>().is_err());
    }
}
