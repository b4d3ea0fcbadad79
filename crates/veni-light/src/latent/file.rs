//! The latent file: JSON `{format, model, n, vectors, sun, lights, lobes, exposure, source}`.
//!
//! `vectors` is N triples [x, y, z]; `exposure` the natural log of the factor to radiance; `sun` and each of `lights` (which are not
//! the sun) `{direction, irradiance, radius}`, radians, before the exposure; each of `lobes` `{direction, amplitude, sharpness}`.
//! All but the format, n, vectors and exposure may be null or absent. Without lights and lobes the format is 1, which older programs
//! read too; with them it is 2. The same text goes into the attribute of a baked panorama.

use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Latent, Lobe};
use crate::compact::{CompactLight, Lights, RadiusSource};
use crate::limits::read_text;
use crate::output::{Overwrite, write_atomic};
use crate::{Error, Result};

pub use crate::limits::MAX_LATENT_BYTES;

/// Of a code of vectors alone.
const PLAIN: u32 = 1;
/// Of a code with lights or lobes.
const FORMAT: u32 = 2;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    format: u32,
    #[serde(default)]
    model: Option<String>,
    n: usize,
    vectors: Vec<[f32; 3]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sun: Option<LightText>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    lights: Vec<LightText>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    lobes: Vec<LobeText>,
    exposure: f32,
    #[serde(default)]
    source: Option<String>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LightText {
    direction: [f32; 3],
    irradiance: [f32; 3],
    radius: f32,
    #[serde(default)]
    radius_source: SourceText,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    clipped: bool,
}

#[derive(Clone, Copy, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum SourceText {
    Measured,
    Assumed,
    #[default]
    Requested,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LobeText {
    direction: [f32; 3],
    amplitude: [f32; 3],
    sharpness: f32,
}

impl From<&CompactLight> for LightText {
    fn from(light: &CompactLight) -> Self {
        let CompactLight { direction, irradiance, radius, radius_source, clipped } = *light;
        let radius_source = match radius_source {
            RadiusSource::Measured => SourceText::Measured,
            RadiusSource::Assumed => SourceText::Assumed,
            RadiusSource::Requested => SourceText::Requested,
        };
        Self { direction, irradiance, radius, radius_source, clipped }
    }
}

impl From<LightText> for CompactLight {
    fn from(text: LightText) -> Self {
        let LightText { direction, irradiance, radius, radius_source, clipped } = text;
        let radius_source = match radius_source {
            SourceText::Measured => RadiusSource::Measured,
            SourceText::Assumed => RadiusSource::Assumed,
            SourceText::Requested => RadiusSource::Requested,
        };
        Self { direction, irradiance, radius, radius_source, clipped }
    }
}

impl From<&Lobe> for LobeText {
    fn from(&Lobe { direction, amplitude, sharpness }: &Lobe) -> Self {
        Self { direction, amplitude, sharpness }
    }
}

impl From<LobeText> for Lobe {
    fn from(LobeText { direction, amplitude, sharpness }: LobeText) -> Self {
        Self { direction, amplitude, sharpness }
    }
}

#[derive(Deserialize)]
struct Format {
    format: u32,
}

impl Latent {
    /// The JSON text, on one line. Every number comes back to the bit.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a number is not finite.
    pub fn to_json(&self) -> Result<String> {
        self.check_finite()?;
        let plain = self.lights.is_empty() && self.lobes.is_empty();
        let text = Text {
            format: if plain { PLAIN } else { FORMAT },
            model: self.model.clone(),
            n: self.vectors.len(),
            vectors: self.vectors.clone(),
            sun: self.lights.sun().map(LightText::from),
            lights: self.lights.others().iter().map(LightText::from).collect(),
            lobes: self.lobes.iter().map(LobeText::from).collect(),
            exposure: self.log_exposure,
            source: self.source.clone(),
        };
        serde_json::to_string(&text).map_err(|e| Error::invalid(format!("the latent cannot be written: {e}")))
    }

    /// Reads the JSON text.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not such JSON, if `n` is not the number of vectors, or a number is not
    /// finite; [`Error::Unsupported`] for an unknown format.
    pub fn from_json(json: &str) -> Result<Self> {
        let broken = |e: serde_json::Error| Error::invalid(format!("not a latent ({e})"));
        let Format { format } = serde_json::from_str(json).map_err(broken)?;
        if ![PLAIN, FORMAT].contains(&format) {
            return Err(Error::unsupported(format!(
                "latent format {format} is unknown (this program reads formats {PLAIN} and {FORMAT})"
            )));
        }
        let text: Text = serde_json::from_str(json).map_err(broken)?;
        if text.n != text.vectors.len() {
            let (n, count) = (text.n, text.vectors.len());
            return Err(Error::invalid(format!(
                "a latent of n = {n} must have {n} vectors, this has {count}"
            )));
        }
        let Text { model, vectors, sun, lights, lobes, exposure, source, .. } = text;
        let lights = Lights::new(sun.map(CompactLight::from), lights.into_iter().map(CompactLight::from));
        let lobes = lobes.into_iter().map(Lobe::from).collect();
        let latent = Self { vectors, lights, lobes, log_exposure: exposure, model, source };
        latent.check_finite()?;
        Ok(latent)
    }

    /// Reads a latent file; a byte order mark, and UTF-16 behind one, is read too.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read; otherwise as [`Latent::from_json`], also for a file larger than
    /// [`MAX_LATENT_BYTES`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let text = read_text(path, "a latent", MAX_LATENT_BYTES)?;
        Self::from_json(&text).map_err(|e| e.in_file(path))
    }

    /// Writes a latent file, all or nothing.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the file exists and may not be replaced, or a number is not finite;
    /// [`Error::Io`] if it cannot be written.
    pub fn save(&self, path: impl AsRef<Path>, overwrite: Overwrite) -> Result<()> {
        let path = path.as_ref();
        let text = self.to_json().map_err(|e| e.in_file(path))?;
        write_atomic(path, overwrite, |file| {
            writeln!(file, "{text}").map_err(|e| Error::io(path, "write", e))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::latent::Prior;

    #[test]
    fn every_bit_survives_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.json");
        for seed in 0..50 {
            let mut latent = Latent::from_seed(&Prior::standard(20), seed);
            latent.vectors[0] = [f32::MIN_POSITIVE, -0.0, f32::MAX];
            latent.vectors[1] = [1e-45, 1.0 / 3.0, -16_777_217.0];
            (latent.log_exposure, latent.model) = (-7.3, Some("0123456789abcdef".into()));
            assert!(latent.to_json().unwrap().contains("\"format\":1"));
            if seed % 2 == 1 {
                let lamp = CompactLight::new([0.0, -0.6, 0.8], [1.0 / 3.0, 0.1, 1e-7], 0.01);
                let sun = CompactLight { radius_source: RadiusSource::Assumed, clipped: true, ..lamp };
                latent.lights = Lights::new((seed % 4 == 1).then_some(sun), [lamp]);
                latent.lobes =
                    vec![Lobe { direction: [1.0, 0.0, 0.0], amplitude: [0.3, -0.1, 2.0], sharpness: 33.3 }];
                assert!(latent.to_json().unwrap().contains("\"format\":2"));
            }
            latent.save(&path, Overwrite::Replace).unwrap();
            let back = Latent::load(&path).unwrap();
            let bits = |l: &Latent| l.vectors.as_flattened().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&back), bits(&latent));
            assert_eq!(back, latent);
        }
        let latent = Latent::load(&path).unwrap();
        assert!(latent.save(&path, Overwrite::Refuse).is_err());
    }

    #[test]
    fn bad_text_is_refused_with_its_reason() {
        let good = r#"{"format":1,"n":1,"vectors":[[1,2,3]],"exposure":0.5}"#;
        assert_eq!(Latent::from_json(good).unwrap().vectors, [[1.0, 2.0, 3.0]]);
        let reason = |from: &str, to: &str| {
            let text = good.replacen(from, to, 1);
            assert_ne!(text, good, "nothing replaced");
            Latent::from_json(&text).unwrap_err()
        };
        assert!(
            matches!(reason("\"format\":1", "\"format\":3"), Error::Unsupported { message, .. } if message.contains("format 3"))
        );
        for (from, to, says) in [
            ("\"n\":1", "\"n\":2", "n = 2"),
            ("[1,2,3]", "[1,2]", "not a latent"),
            ("[1,2,3]", "[1,null,3]", "not a latent"),
            ("[1,2,3]", "[1,1e39,3]", "out of range"),
            ("0.5", "NaN", "not a latent"),
            ("}", "", "not a latent"),
            ("\"n\"", "\"m\"", "not a latent"),
            ("{", "[", "not a latent"),
        ] {
            let error = reason(from, to);
            assert!(
                matches!(&error, Error::Invalid { message, .. } if message.contains(says)),
                "{from} → {to}: {error}"
            );
        }
    }

    #[test]
    fn files_that_are_no_latent_name_themselves() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("noise.json");
        assert!(matches!(Latent::load(&path), Err(Error::Io { .. })));
        std::fs::write(&path, [0xff, 0xfe, 0, 1]).unwrap();
        assert!(Latent::load(&path).unwrap_err().to_string().contains("noise.json"));
        std::fs::write(&path, vec![b' '; MAX_LATENT_BYTES as usize + 1]).unwrap();
        assert!(Latent::load(&path).unwrap_err().to_string().contains("larger than 16 MiB"));
        let nan = Latent::new(vec![[f32::NAN, 0.0, 0.0]]);
        assert!(nan.save(&path, Overwrite::Replace).is_err());
    }
}
