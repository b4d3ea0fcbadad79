//! What is said of a light: JSON for programs, a few lines for people.

use std::fmt::Write as _;

use serde_json::{Value, json};
use veni_light::light::{CompactLight, Light, luminance};

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
    let [up, down, front, left, back, right] = WAYS.map(|(_, way)| at(way));
    let _ = writeln!(
        out,
        "  E        up {up:.4}, down {down:.4}; front {front:.4}, left {left:.4}, back {back:.4}, right {right:.4}{}",
        if lux.is_some() { " lux" } else { "" }
    );
    let [r, g, b] = light.mean();
    let _ = write!(out, "  mean     {r:.4} {g:.4} {b:.4}{}", white(light.irradiance([0.0, 0.0, 1.0])));
    let shown = convention.unwrap_or(Convention::Native);
    let _ = write!(out, "\n  sh       {} (whole; --json has the residual's too)", shown.name());
    for [r, g, b] in shown.of(&light.sh()) {
        let _ = write!(out, "\n           {r:>12.6} {g:>12.6} {b:>12.6}");
    }
    out
}

fn line(out: &mut String, name: &str, light: &CompactLight, share: f32) {
    let ([x, y, z], [r, g, b]) = (light.direction, light.irradiance);
    let _ = writeln!(
        out,
        "  {name:<8} el {:.2}° az {:.2}° ({x:.4} {y:.4} {z:.4})  radius {:.3}° {}  E⊥ {r:.4} {g:.4} {b:.4}  {:.0} % of what faces it  {}{}",
        light.elevation().to_degrees(),
        light.azimuth().to_degrees(),
        light.radius.to_degrees(),
        light.radius_source,
        100.0 * share,
        light.kind(),
        if light.clipped { ", cut off: E⊥ is a lower bound" } else { "" },
    );
}

/// Chromaticity and correlated colour temperature (McCamy 1992) of light in Rec. 709.
fn white([r, g, b]: [f32; 3]) -> String {
    let [r, g, b] = [r, g, b].map(f64::from);
    let x = 0.4124 * r + 0.3576 * g + 0.1805 * b;
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let z = 0.0193 * r + 0.1192 * g + 0.9505 * b;
    let sum = x + y + z;
    if sum <= 0.0 {
        return String::new();
    }
    let (x, y) = (x / sum, y / sum);
    let n = (x - 0.332) / (0.1858 - y);
    let kelvin = 437.0 * n.powi(3) + 3601.0 * n * n + 6861.0 * n + 5517.0;
    if (1500.0..=25000.0).contains(&kelvin) {
        format!("; light on a level surface: x {x:.4} y {y:.4}, {kelvin:.0} K")
    } else {
        format!("; light on a level surface: x {x:.4} y {y:.4}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_white_of_the_primaries_is_daylight() {
        // D65: x 0.3127, y 0.3290, 6504 K
        let text = white([1.0; 3]);
        assert!(text.contains("x 0.3127 y 0.3290, 65"), "{text}");
        assert_eq!(white([0.0; 3]), "");
    }
}
