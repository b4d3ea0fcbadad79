//! Files of what is known of a light: JSON, from `light` or written by hand. docs/FORMATS.md, Target of a fit.

use std::path::Path;

use serde_json::{Map, Value};
use veni_light::limits::read_text;

use crate::fit::Received;
use crate::limits::MAX_TARGET_BYTES;
use crate::{Error, Result};

/// What the six ways of a light's irradiance face.
const WAYS: [(&str, [f32; 3]); 6] = [
    ("up", [0.0, 0.0, 1.0]),
    ("down", [0.0, 0.0, -1.0]),
    ("front", [1.0, 0.0, 0.0]),
    ("left", [0.0, 1.0, 0.0]),
    ("back", [-1.0, 0.0, 0.0]),
    ("right", [0.0, -1.0, 0.0]),
];
/// Characters of a wrong value that a message shows.
const SHOWN: usize = 60;

/// Harmonics c_lm of radiance, R, G and B, in the order of [`Sh`](veni_light::light::Sh): a list of triples, or an object that
/// has it as `sh`, whatever else is in it.
///
/// # Errors
/// [`Error::Io`] or [`Error::TooLarge`] if it cannot be read; [`Error::Invalid`] with the place and the value of what is
/// something else.
pub fn read_harmonics(path: &Path) -> Result<Vec<[f64; 3]>> {
    let text = read_text(path, "a target", MAX_TARGET_BYTES)?;
    harmonics(&text).map_err(|e| e.in_file(path))
}

/// What surfaces receive: a list of objects with `normal`, [x, y, z], and `irradiance`, [R, G, B], or `illuminance`, a number;
/// or an object that has as `irradiance` such a list, or triples by the names up, down, front, left, back and right.
///
/// # Errors
/// As [`read_harmonics`].
pub fn read_surfaces(path: &Path) -> Result<Vec<([f32; 3], Received)>> {
    let text = read_text(path, "a target", MAX_TARGET_BYTES)?;
    surfaces(&text).map_err(|e| e.in_file(path))
}

fn harmonics(text: &str) -> Result<Vec<[f64; 3]>> {
    let wanted = "a list of [r, g, b], or an object with such a list as \"sh\"";
    let value = parse(text, wanted)?;
    let list = match &value {
        Value::Array(list) => list,
        Value::Object(keys) => match keys.get("sh") {
            Some(Value::Array(list)) => list,
            Some(other) => return Err(Error::invalid(format!("\"sh\" is {}; give {wanted}", shown(other)))),
            None => return Err(Error::invalid(format!("has no \"sh\"; give {wanted}"))),
        },
        other => return Err(Error::invalid(format!("is {}; give {wanted}", shown(other)))),
    };
    list.iter().enumerate().map(|(at, value)| triple(value, || format!("harmonic {at}"))).collect()
}

fn surfaces(text: &str) -> Result<Vec<([f32; 3], Received)>> {
    let wanted = "a list of objects with \"normal\" and \"irradiance\" or \"illuminance\"";
    let value = parse(text, wanted)?;
    match &value {
        Value::Array(list) => list.iter().enumerate().map(|(at, value)| surface(at, value)).collect(),
        Value::Object(keys) => match keys.get("irradiance") {
            Some(Value::Array(list)) => list.iter().enumerate().map(|(at, v)| surface(at, v)).collect(),
            Some(Value::Object(ways)) => ways.iter().map(|(name, value)| way(name, value)).collect(),
            Some(other) => Err(Error::invalid(format!("\"irradiance\" is {}; give {wanted}", shown(other)))),
            None => Err(Error::invalid(format!("has no \"irradiance\"; give {wanted}"))),
        },
        other => Err(Error::invalid(format!("is {}; give {wanted}", shown(other)))),
    }
}

fn parse(text: &str, wanted: &str) -> Result<Value> {
    serde_json::from_str(text).map_err(|e| Error::invalid(format!("is not JSON ({e}); give {wanted}")))
}

fn way(name: &str, value: &Value) -> Result<([f32; 3], Received)> {
    let Some((_, normal)) = WAYS.iter().find(|(way, _)| *way == name) else {
        return Err(Error::invalid(format!(
            "\"irradiance\" has {}, which is not a direction to face; they are up, down, front, left, back and right, and a \
             list of objects with \"normal\" has any",
            shown(&name.into())
        )));
    };
    let rgb = triple(value, || format!("the irradiance of \"{name}\""))?;
    Ok((*normal, Received::Irradiance(rgb)))
}

fn surface(at: usize, value: &Value) -> Result<([f32; 3], Received)> {
    let Value::Object(keys) = value else {
        return Err(Error::invalid(format!(
            "surface {at} is {}; give an object with \"normal\" and \"irradiance\" or \"illuminance\"",
            shown(value)
        )));
    };
    if let Some(key) = keys.keys().find(|k| !["normal", "irradiance", "illuminance"].contains(&k.as_str())) {
        return Err(Error::invalid(format!(
            "surface {at} has {}, which says nothing here; the keys are \"normal\", \"irradiance\" and \"illuminance\"",
            shown(&key.as_str().into())
        )));
    }
    let normal =
        triple(keys.get("normal").unwrap_or(&Value::Null), || format!("the normal of surface {at}"))?;
    Ok((normal.map(|v| v as f32), received(at, keys)?))
}

fn received(at: usize, keys: &Map<String, Value>) -> Result<Received> {
    match (keys.get("irradiance"), keys.get("illuminance")) {
        (Some(value), None) => {
            Ok(Received::Irradiance(triple(value, || format!("the irradiance of surface {at}"))?))
        }
        (None, Some(value)) => match value.as_f64() {
            Some(number) => Ok(Received::Illuminance(number)),
            None => Err(Error::invalid(format!(
                "the illuminance of surface {at} is {}; give a number",
                shown(value)
            ))),
        },
        _ => Err(Error::invalid(format!(
            "surface {at} needs one of \"irradiance\", [r, g, b], and \"illuminance\", a number"
        ))),
    }
}

/// Three numbers; `what` names them.
fn triple(value: &Value, what: impl Fn() -> String) -> Result<[f64; 3]> {
    let numbers: Option<Vec<f64>> =
        value.as_array().map(|list| list.iter().map_while(Value::as_f64).collect());
    match (numbers.as_deref(), value.as_array().map(Vec::len)) {
        (Some(&[x, y, z]), Some(3)) => Ok([x, y, z]),
        _ => Err(Error::invalid(format!("{} is {}; give three numbers in brackets", what(), shown(value)))),
    }
}

/// A value as a message shows it.
fn shown(value: &Value) -> String {
    if value.is_null() {
        return "missing".to_owned();
    }
    let text = value.to_string();
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_light_writes_and_bare_lists_are_read() {
        let bare = "[[1,2,3],[0,-0.5,1e-3],[0,0,0],[4,5,6]]";
        let found = harmonics(bare).unwrap();
        assert_eq!((found.len(), found[1]), (4, [0.0, -0.5, 1e-3]));
        assert_eq!(harmonics(&format!("{{\"sun\":null,\"sh\":{bare}}}")).unwrap(), found);

        let list = r#"[{"normal":[0,0,2],"irradiance":[1,2,3]},{"normal":[1,0,0],"illuminance":5}]"#;
        let found = surfaces(list).unwrap();
        assert_eq!(found[0], ([0.0, 0.0, 2.0], Received::Irradiance([1.0, 2.0, 3.0])));
        assert_eq!(found[1], ([1.0, 0.0, 0.0], Received::Illuminance(5.0)));
        assert_eq!(surfaces(&format!("{{\"irradiance\":{list}}}")).unwrap(), found);
        let six = surfaces(r#"{"irradiance":{"up":[1,1,1],"left":[2,2,2]},"sh":[]}"#).unwrap();
        assert!(six.contains(&([0.0, 1.0, 0.0], Received::Irradiance([2.0; 3]))) && six.len() == 2);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_value_and_a_remedy() {
        let said = |result: Result<()>, words: &[&str]| {
            let message = result.unwrap_err().to_string();
            assert!(words.iter().all(|word| message.contains(word)), "{message}");
        };
        let sh = |text: &str, words: &[&str]| said(harmonics(text).map(|_| ()), words);
        sh("", &["not JSON", "give a list"]);
        sh("{\"sh\":[[1,2,3]", &["not JSON", "line 1"]);
        sh("7", &["is 7", "give a list"]);
        sh("{}", &["no \"sh\""]);
        sh("{\"sh\":{\"a\":1}}", &["{\"a\":1}"]);
        sh("[[1,2,3],[1,2]]", &["harmonic 1 is [1,2]", "three numbers"]);
        sh("[[1,2,\"3\"]]", &["harmonic 0", "\"3\""]);
        sh("[[1,2,3,4]]", &["harmonic 0"]);
        let on = |text: &str, words: &[&str]| said(surfaces(text).map(|_| ()), words);
        on("[1]", &["surface 0 is 1"]);
        on("{\"irradiance\":{\"north\":[1,1,1]}}", &["\"north\"", "up, down"]);
        on("{\"sh\":[]}", &["no \"irradiance\""]);
        on(r#"[{"irradiance":[1,1,1]}]"#, &["normal of surface 0 is missing"]);
        on(r#"[{"normal":[0,0,1]}]"#, &["surface 0 needs one of"]);
        on(r#"[{"normal":[0,0,1],"irradiance":[1,1,1],"illuminance":1}]"#, &["one of"]);
        on(r#"[{"normal":[0,0,1],"illuminance":[1]}]"#, &["illuminance of surface 0 is [1]"]);
        on(r#"[{"normal":[0,0,1],"lux":1}]"#, &["\"lux\"", "the keys are"]);
        // a long value is cut
        assert!(shown(&Value::from("é".repeat(500))).chars().count() < 70);
    }
}
