//! Which part of an EXR file, and which of its channels, are the picture.

use std::collections::BTreeMap;

use exr::math::Vec2;
use exr::meta::attribute::Text;
use exr::meta::header::Header;

use super::super::ReadOptions;
use crate::{Error, Result};

/// Layers of these names are pictures before all others: Blender, V-Ray and others, Houdini.
const BEAUTY: [&str; 6] = ["combined", "beauty", "rgba", "rgb", "color", "c"];
/// Layers of these names are vectors, even where their channels are called R, G and B.
const VECTORS: [&str; 11] =
    ["n", "p", "normal", "normals", "position", "vector", "uv", "pworld", "pref", "motion", "velocity"];

/// The part of the file and its channels that hold red, green and blue.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    pub(super) part: usize,
    pub(super) channels: [usize; 3],
    /// Of the same layer, where it has one.
    pub(super) alpha: Option<usize>,
    /// Whether there are three channels, and not one for all.
    pub(super) coloured: bool,
    /// Vectors or the like, not light.
    pub(super) data: bool,
}

struct Layer {
    part_name: String,
    prefix: String,
    choice: Choice,
    vector: bool,
}

impl Layer {
    /// As it is chosen.
    fn name(&self) -> String {
        let parts = [self.part_name.as_str(), self.prefix.as_str()].into_iter().filter(|s| !s.is_empty());
        parts.collect::<Vec<_>>().join(".")
    }

    fn last(&self) -> String {
        self.name().rsplit('.').next().unwrap_or_default().to_ascii_lowercase()
    }

    fn is_beauty(&self) -> bool {
        BEAUTY.contains(&self.last().as_str())
    }
}

/// Candidates are all prefixes that have R, G and B (or Y alone): the one asked for; else the coloured one without a prefix, else
/// the coloured one that is called like a picture, else the same of single channels where nothing is coloured (a Y beside
/// coloured layers is as likely a depth), else the only one.
pub(super) fn choose(headers: &[Header], options: &ReadOptions) -> Result<Choice> {
    let mut found = Vec::new();
    for (part, header) in headers.iter().enumerate() {
        layers(part, header, options.data, &mut found)?;
    }
    let names = || {
        let mut names: Vec<String> = found.iter().filter(|l| !l.vector).map(Layer::name).collect();
        names.dedup();
        names
    };
    if let Some(wanted) = &options.layer {
        let full = found.iter().find(|layer| layer.name() == *wanted);
        let mut half = found.iter().filter(|layer| layer.prefix == *wanted || layer.part_name == *wanted);
        let hit = full.or_else(|| half.next().filter(|_| half.next().is_none()));
        return hit.map(|layer| layer.choice.clone()).ok_or_else(|| Error::layers(Some(wanted), names()));
    }
    let pictures: Vec<&Layer> = found.iter().filter(|layer| !layer.vector).collect();
    let only = |wanted: &dyn Fn(&Layer) -> bool| {
        let mut all = pictures.iter().filter(|layer| wanted(layer));
        all.next().filter(|_| all.next().is_none())
    };
    let coloured = pictures.iter().any(|layer| layer.choice.coloured);
    let best = |layer: &Layer| layer.choice.coloured == coloured;
    let chosen = only(&|layer| best(layer) && layer.prefix.is_empty())
        .or_else(|| only(&|layer| best(layer) && layer.is_beauty()))
        .or_else(|| only(&|_| true));
    match chosen {
        Some(layer) => Ok(layer.choice.clone()),
        None if pictures.is_empty() => {
            let channels = headers.iter().flat_map(|h| h.channels.list.iter().map(|c| c.name.to_string()));
            let channels = channels.take(16).collect::<Vec<_>>().join(", ");
            let vectors = if found.is_empty() { "" } else { " (vectors are not pictures)" };
            Err(Error::unsupported(format!(
                "no R, G, B or Y channels of a picture among: {channels}{vectors}; store the picture with R, G and B"
            )))
        }
        None => Err(Error::layers(None::<&str>, names())),
    }
}

/// The layers of one part.
fn layers(part: usize, header: &Header, data: bool, found: &mut Vec<Layer>) -> Result<()> {
    let part_name = header.own_attributes.layer_name.as_ref().map(Text::to_string).unwrap_or_default();
    let mut prefixes: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for (index, channel) in header.channels.list.iter().enumerate() {
        let full = channel.name.to_string();
        let (prefix, last) = full.rsplit_once('.').unwrap_or(("", &full));
        prefixes.entry(prefix.to_owned()).or_default().insert(last.to_ascii_uppercase(), index);
    }
    for (prefix, names) in prefixes {
        let get = |wanted: &str| names.get(wanted).copied();
        let (channels, coloured) = match (get("R"), get("G"), get("B"), get("Y")) {
            (Some(r), Some(g), Some(b), _) => ([r, g, b], true),
            // beside X it is a coordinate
            (.., Some(_)) if get("X").is_some() => continue,
            (.., Some(y)) if get("RY").is_none() && get("BY").is_none() => ([y; 3], false),
            (.., Some(_)) => {
                return Err(Error::unsupported(
                    "luminance-chroma EXR images are not read; convert it to RGB",
                ));
            }
            _ => continue,
        };
        if header.channels.list.iter().any(|c| c.sampling != Vec2(1, 1)) {
            return Err(Error::unsupported("EXR images with subsampled channels are not read"));
        }
        let choice = Choice { part, channels, alpha: get("A"), coloured, data };
        let mut layer = Layer { part_name: part_name.clone(), prefix, choice, vector: false };
        layer.vector = VECTORS.contains(&layer.last().as_str());
        found.push(layer);
    }
    Ok(())
}
