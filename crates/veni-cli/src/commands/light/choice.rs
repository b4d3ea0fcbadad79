//! `--sun`: which light is the sun.

use std::str::FromStr;

use veni_light::light::SunChoice;

/// As typed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sun(pub(super) SunChoice);

impl Sun {
    /// Whether a sun must come of it.
    pub(super) fn is_asked(self) -> bool {
        matches!(self.0, SunChoice::Towards(_))
    }
}

impl FromStr for Sun {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let choice = match text {
            "auto" => SunChoice::Auto,
            "sky" => SunChoice::Sky,
            "any" => SunChoice::Any,
            "none" => SunChoice::Nothing,
            _ => SunChoice::Towards(direction(text)?),
        };
        Ok(Self(choice))
    }
}

fn direction(text: &str) -> Result<[f32; 3], String> {
    let angles: Vec<Option<f64>> = text.split(',').map(|t| t.trim().parse().ok()).collect();
    match angles.as_slice() {
        [Some(azimuth), Some(elevation)] if azimuth.is_finite() && elevation.abs() <= 90.0 => {
            let ((sa, ca), (se, ce)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
            Ok([ce * ca, ce * sa, se].map(|v| v as f32))
        }
        [Some(_), Some(elevation)] => Err(format!("an elevation is between -90 and 90, not {elevation}")),
        _ => Err("give auto, sky, any, none, or AZIMUTH,ELEVATION in degrees".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_angles() {
        assert_eq!("auto".parse(), Ok(Sun(SunChoice::Auto)));
        let Ok(Sun(SunChoice::Towards([x, y, z]))) = "90, -30".parse() else { panic!("a direction") };
        assert!(x.abs() < 1e-6 && (y - 0.75f32.sqrt()).abs() < 1e-6 && (z + 0.5).abs() < 1e-6);
        for bad in ["", "noon", "10", "10,20,30", "10,91", "nan,10", "10,nan"] {
            assert!(bad.parse::<Sun>().is_err(), "{bad}");
        }
    }
}
