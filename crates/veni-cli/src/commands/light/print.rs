//! What is said of a light: JSON for programs, a few lines for people.

use std::fmt::Write as _;

use serde_json::{Value, json};
use veni_light::light::{CompactLight, Light, luminance};
use veni_light::skies::{chromaticity, temperature};

use super::convention::Convention;

/// Ways that a surface may face.
const WAYS: [(&str, [f32; 3]); 6] = [
    ("up", [0.0, 0.0, 1.0]),
    ("down", [0.0, 0.0, -1.0]),
    ("front", [1.0, 0.0, 0.0]),
    ("left", [0.0, 1.0, 0.0]),
    ("back", [-1.0, 0.0, 0.0]),
    ("right", [0.0, -1.0, 0.0]),
];

/// Everything, for one line.
pub(super) fn json(light: &Light, convention: Option<Convention>, lux: Option<f64>) -> Value {
    let ways: serde_json::Map<_, _> =
        WAYS.iter().map(|(name, way)| ((*name).to_owned(), json!(light.irradiance(*way)))).collect();
    let lights = compact(light);
    let mut value = json!({
        "sun": light.sun().and(lights.first()),
        "lights": lights,
        "sh": Convention::Native.of(&light.sh()),
        "sh_residual": Convention::Native.of(light.residual_sh()),
        "mean": light.mean(),
        "irradiance": ways,
    });
    if let Some(convention) = convention {
        value["converted"] = json!({
            "convention": convention.name(),
            "sh": convention.of(&light.sh()),
            "sh_residual": convention.of(light.residual_sh()),
        });
    }
    if let Some(unit) = lux {
        let ways: serde_json::Map<_, _> = WAYS
            .iter()
            .map(|(name, way)| {
                ((*name).to_owned(), json!(unit * f64::from(luminance(light.irradiance(*way)))))
            })
            .collect();
        value["lux"] = ways.into();
    }
    value
}

/// Every compact light, the sun first.
fn compact(light: &Light) -> Vec<Value> {
    light.lights().iter().zip(light.shares()).map(|(one, share)| described(one, *share)).collect()
}

fn described(light: &CompactLight, share: f32) -> Value {
    json!({
        "direction": light.direction,
        "azimuth": light.azimuth().to_degrees(),
        "elevation": light.elevation().to_degrees(),
        "irradiance": light.irradiance,
        "radius": light.radius.to_degrees(),
        "radius_source": light.radius_source.to_string(),
        "kind": light.kind().to_string(),
        "share": share,
        "clipped": light.clipped,
    })
}

/// The same for people.
pub(super) fn text(name: &str, light: &Light, convention: Option<Convention>, lux: Option<f64>) -> String {
    let mut out = format!("{name}\n");
    if light.sun().is_none() {
        out += "  sun      none\n";
    }
    for (at, (one, share)) in light.lights().iter().zip(light.shares()).enumerate() {
        line(&mut out, if at == 0 && light.sun().is_some() { "sun" } else { "light" }, one, *share);
    }
    let unit = lux.unwrap_or(1.0);
    let at = |way: [f32; 3]| unit * f64::from(luminance(light.irradiance(way)));
    let [up, down, front, left, back, right] = WAYS.map(|(_, way)| number(at(way)));
    let _ = writeln!(
        out,
        "  E        up {up}, down {down}; front {front}, left {left}, back {back}, right {right}{}",
        if lux.is_some() { " lux" } else { "" }
    );
    let [r, g, b] = light.mean().map(|v| number(f64::from(v)));
    let _ = write!(out, "  mean     {r} {g} {b}{}", white(light.irradiance([0.0, 0.0, 1.0])));
    let shown = convention.unwrap_or(Convention::Native);
    let _ = write!(out, "\n  sh       {} (whole; --json has the residual's too)", shown.name());
    let sh = shown.of(&light.sh());
    let largest = sh.as_flattened().iter().fold(0f32, |most, v| most.max(v.abs()));
    for [r, g, b] in sh {
        let _ = if ORDINARY.contains(&largest) {
            write!(out, "\n           {r:>12.6} {g:>12.6} {b:>12.6}")
        } else {
            write!(out, "\n           {r:>12.4e} {g:>12.4e} {b:>12.4e}")
        };
    }
    out
}

/// Numbers of this size are shown with a fixed number of decimals; others by powers of ten, or they would be zeros.
const ORDINARY: std::ops::Range<f32> = 0.01..1e6;

fn number(value: f64) -> String {
    if value == 0.0 || ORDINARY.contains(&(value.abs() as f32)) {
        format!("{value:.4}")
    } else {
        format!("{value:.4e}")
    }
}

fn line(out: &mut String, name: &str, light: &CompactLight, share: f32) {
    let [x, y, z] = light.direction;
    let [r, g, b] = light.irradiance.map(|v| number(f64::from(v)));
    let _ = writeln!(
        out,
        "  {name:<8} el {:.2}° az {:.2}° ({x:.4} {y:.4} {z:.4})  radius {:.3}° {}  E⊥ {r} {g} {b}  {:.0} % of what faces it  {}{}",
        light.elevation().to_degrees(),
        light.azimuth().to_degrees(),
        light.radius.to_degrees(),
        light.radius_source,
        100.0 * share,
        light.kind(),
        if light.clipped { ", cut off: E⊥ is a lower bound" } else { "" },
    );
}

/// Chromaticity and, if it is near that of a black body, correlated colour temperature of light in Rec. 709.
fn white(rgb: [f32; 3]) -> String {
    let rgb = rgb.map(f64::from);
    let Some([x, y]) = chromaticity(rgb) else { return String::new() };
    let kelvin = temperature(rgb).map(|kelvin| format!(", {kelvin:.0} K")).unwrap_or_default();
    format!("; light on a level surface: x {x:.4} y {y:.4}{kelvin}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_and_large_numbers_keep_their_digits() {
        assert_eq!([0.0, 0.5, 123.45678, -0.25].map(number), ["0.0000", "0.5000", "123.4568", "-0.2500"]);
        assert_eq!([1.25e-8, 3e9].map(number), ["1.2500e-8", "3.0000e9"]);
    }

    #[test]
    fn the_white_of_the_primaries_is_daylight() {
        // D65: x 0.3127, y 0.3290, 6504 K
        let text = white([1.0; 3]);
        assert!(text.contains("x 0.3127 y 0.3290, 65"), "{text}");
        assert_eq!(white([0.0; 3]), "");
        // a red that no black body has
        assert_eq!(white([1.0, 0.0, 0.0]), "; light on a level surface: x 0.6400 y 0.3300");
    }
}
