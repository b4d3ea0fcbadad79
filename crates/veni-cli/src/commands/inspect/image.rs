//! An OpenEXR or Radiance image.

use std::path::Path;

use anyhow::{Result, anyhow};
use serde_json::json;
use veni_image::{self, Panorama, Provenance};
use veni_light::latent::Latent;

use super::facts::Facts;
use super::latent;
use super::statistics::Statistics;
use crate::args::Layer;
use crate::output::{CAMERA, CUBE_FACES, FRAME, LATENT, with_remedy};

pub(super) fn describe(path: &Path, layer: &Layer) -> Result<Facts> {
    let attributes = veni_image::attributes(path).map_err(with_remedy)?;
    let exr = exr_facts(path)?;
    let mut facts = Facts::new(if exr.is_some() { "OpenEXR image" } else { "Radiance HDR image" });
    let cube = exr.as_ref().is_some_and(|e| e.cube) || attributes.contains_key(CUBE_FACES);
    if let Some(exr) = exr {
        facts.add("size", format!("{} x {}", exr.size[0], exr.size[1]), json!(exr.size));
        facts.add("storage", exr.storage.clone(), exr.storage);
        facts.add("channels", exr.channels.join(" "), exr.channels);
    }
    let frame = attributes.get(FRAME).map_or("blender", String::as_str);
    facts.add("frame", frame, frame);
    if let Some(faces) = attributes.get(CUBE_FACES) {
        facts.add("cube faces", faces.as_str(), faces.as_str());
    }
    if let Some(text) = attributes.get(LATENT) {
        let code =
            Latent::from_json(text).map_err(|e| anyhow!("{}: attribute {LATENT}: {e}", path.display()))?;
        let value: serde_json::Value = serde_json::from_str(text)?;
        facts.add("latent", latent::summary(&code), value);
    }
    for (name, value) in
        attributes.iter().filter(|(name, _)| ![LATENT, FRAME, CUBE_FACES].contains(&name.as_str()))
    {
        facts.attribute(name, value);
    }
    // a rendered image is not a panorama
    if !cube && !attributes.contains_key(CAMERA) {
        radiance(Panorama::read_with(path, &layer.options()).map_err(with_remedy)?, path, &mut facts)?;
    }
    Ok(facts)
}

/// What the pixels say.
pub(super) fn radiance(mut image: Panorama, path: &Path, facts: &mut Facts) -> Result<()> {
    let grid = image.grid();
    if !facts.has("size") {
        facts.add("size", format!("{} x {}", grid.width, grid.height), json!([grid.width, grid.height]));
    }
    match image.provenance() {
        // of older programs; `bake` decodes to see
        Provenance::Unrecorded if image.attributes().contains_key(LATENT) => {
            facts.add(
                "pixels",
                "not known to be those of the latent: no digest was written with it",
                "unknown",
            );
        }
        Provenance::Unrecorded => {}
        Provenance::Same => facts.add("pixels", "those that the attributes were written with", "same"),
        Provenance::Changed => facts.add(
            "pixels",
            "changed after the attributes were written: a latent or a factor among these is not theirs",
            "changed",
        ),
    }
    reservations(image.notes(), image.unknown(), facts);
    image.fill();
    let bad = image.sanitise().map_err(|e| e.in_file(path))?;
    if bad.total() > 0 {
        facts.add(
            "bad values",
            format!("{} NaN, {} infinite, {} negative", bad.nan, bad.infinite, bad.negative),
            json!({ "nan": bad.nan, "infinite": bad.infinite, "negative": bad.negative }),
        );
    }
    let s = Statistics::of(&image);
    facts.add(
        "radiance",
        format!("min {:.4e}, median {:.4e}, mean {:.4e}, max {:.4e}", s.min, s.median, s.mean, s.max),
        json!({ "min": s.min, "median": s.median, "mean": s.mean, "max": s.max }),
    );
    facts.add("dynamic range", format!("{:.1} stops", s.stops()), s.stops());
    let [x, y, z] = s.sun.direction;
    facts.add(
        "sun",
        format!(
            "elevation {:.1}°, azimuth {:.1}° ({x:.3}, {y:.3}, {z:.3}); {:.0} % of all light from 0.01 sr there",
            s.sun.elevation(),
            s.sun.azimuth(),
            100.0 * s.sun.share
        ),
        json!({
            "elevation_degrees": s.sun.elevation(),
            "azimuth_degrees": s.sun.azimuth(),
            "direction": s.sun.direction,
            "share": s.sun.share,
        }),
    );
    Ok(())
}

/// What is unknown, and what the file says besides.
pub(super) fn reservations(notes: &[String], unknown: f64, facts: &mut Facts) {
    if unknown > 0.0 {
        facts.add("unknown", format!("{:.1} % of the pixels", 100.0 * unknown), unknown);
    }
    facts.notes(notes);
}

struct Exr {
    size: [usize; 2],
    storage: String,
    channels: Vec<String>,
    cube: bool,
}

/// What only the EXR header says; `None` for another format.
fn exr_facts(path: &Path) -> Result<Option<Exr>> {
    use exr::meta::attribute::EnvironmentMap;
    use exr::meta::{BlockDescription, MetaData};
    let mut start = [0u8; 4];
    let read = std::fs::File::open(path).and_then(|mut f| std::io::Read::read_exact(&mut f, &mut start));
    if read.is_err() || start != [0x76, 0x2f, 0x31, 0x01] {
        return Ok(None);
    }
    let meta = MetaData::read_from_file(path, false).map_err(|e| anyhow!("{}: {e}", path.display()))?;
    let Some(header) = meta.headers.first() else {
        return Err(anyhow!("{}: an EXR file without any image; write it again", path.display()));
    };
    let window = header.shared_attributes.display_window;
    let blocks = match header.blocks {
        BlockDescription::ScanLines => "scan lines".to_owned(),
        BlockDescription::Tiles(t) => format!("{} x {} tiles", t.tile_size.0, t.tile_size.1),
    };
    let channels: Vec<String> = header
        .channels
        .list
        .iter()
        .map(|c| format!("{}:{:?}", c.name, c.sample_type).to_lowercase())
        .collect();
    let parts =
        if meta.headers.len() > 1 { format!(", {} parts", meta.headers.len()) } else { String::new() };
    Ok(Some(Exr {
        size: [window.size.0, window.size.1],
        storage: format!("{:?}, {blocks}{parts}", header.compression),
        channels,
        cube: header.own_attributes.environment_map == Some(EnvironmentMap::Cube),
    }))
}
