//! Numbers as they are typed, each with its range.

/// Largest |exposure|. Light that is 2^64 brighter than a sky is not light, and close to what an f32 can hold.
const MAX_STOPS: f64 = 64.0;
/// Largest width of a panorama of lights.
const MAX_LIGHTS: usize = 4096;

/// Any number.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        Ok(_) => Err("the number must be finite".to_owned()),
        Err(_) => Err("not a number".to_owned()),
    }
}

/// More than 0.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match finite(text)? {
        v if v > 0.0 => Ok(v),
        v => Err(format!("{v} is not more than 0")),
    }
}

/// A number of a range, ends included.
fn within(text: &str, low: f64, high: f64) -> Result<f64, String> {
    match finite(text)? {
        v if (low..=high).contains(&v) => Ok(v),
        v => Err(format!("{v} is not between {low} and {high}")),
    }
}

/// 0 to 1.
pub(crate) fn fraction(text: &str) -> Result<f32, String> {
    Ok(within(text, 0.0, 1.0)? as f32)
}

/// The exponent of a highlight.
pub(crate) fn shininess(text: &str) -> Result<f32, String> {
    Ok(within(text, 0.0, 1e6)? as f32)
}

/// Factors of two.
pub(crate) fn stops(text: &str) -> Result<f64, String> {
    match finite(text)? {
        v if v.abs() <= MAX_STOPS => Ok(v),
        _ => Err(format!("more than {MAX_STOPS} stops either way is beyond the range of floats")),
    }
}

/// Degrees above the horizon.
pub(crate) fn elevation(text: &str) -> Result<f64, String> {
    within(text, -90.0, 90.0)
}

/// One number for all channels, or three.
pub(crate) fn albedo(text: &str) -> Result<[f32; 3], String> {
    let values = text.split(',').map(fraction).collect::<Result<Vec<_>, _>>()?;
    match values[..] {
        [grey] => Ok([grey; 3]),
        [r, g, b] => Ok([r, g, b]),
        _ => Err(format!("{} numbers: give one, or three separated by commas", values.len())),
    }
}

/// A count from 1 to `MOST`.
pub(crate) fn count_up_to<const MOST: usize>(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(count) if (1..=MOST).contains(&count) => Ok(count),
        _ => Err(format!("give a number from 1 to {MOST}")),
    }
}

/// Width of a panorama of lights.
pub(crate) fn lights(text: &str) -> Result<usize, String> {
    match text.trim().parse::<usize>() {
        Ok(n) if (2..=MAX_LIGHTS).contains(&n) && n % 2 == 0 => Ok(n),
        _ => Err(format!("give an even width from 2 to {MAX_LIGHTS}; the height is half of it")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_and_refused() {
        assert_eq!(albedo("0.5"), Ok([0.5; 3]));
        assert_eq!(albedo("1, 0.5,0"), Ok([1.0, 0.5, 0.0]));
        assert!(albedo("1,2,3").unwrap_err().contains("between 0 and 1"));
        assert!(albedo("1,1").unwrap_err().contains("three"));
        assert!(albedo("").is_err() && fraction("NaN").is_err() && shininess("-1").is_err());
        assert_eq!(lights("64"), Ok(64));
        assert!(lights("7").is_err() && lights("0").is_err() && lights("99999").is_err());
        assert!(elevation("91").is_err() && finite("inf").is_err());
        assert!(positive("0").unwrap_err().contains("more than 0") && positive("0.5") == Ok(0.5));
        assert!(stops("-65").unwrap_err().contains("64 stops"));
    }
}
