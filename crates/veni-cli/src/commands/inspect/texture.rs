//! Cube maps of engines: the headers of KTX2 and Babylon.js files.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::Result;
use serde_json::json;
use veni_image::texture::{EnvHeader, Ktx2Header};
use veni_light::Error;

use super::facts::Facts;

/// Formats that environments come in, by Vulkan's numbers.
const FORMATS: [(u32, &str); 6] = [
    (97, "R16G16B16A16_SFLOAT"),
    (109, "R32G32B32A32_SFLOAT"),
    (122, "B10G11R11_UFLOAT"),
    (123, "E5B9G9R9_UFLOAT"),
    (131, "BC6H_UFLOAT"),
    (132, "BC6H_SFLOAT"),
];

pub(super) fn ktx2(path: &Path) -> Result<Facts> {
    let header = Ktx2Header::read(&start(path, Ktx2Header::LEN)?).map_err(|e| e.in_file(path))?;
    let mut facts = Facts::new("KTX2 texture");
    let known = FORMATS.iter().find(|(number, _)| *number == header.vk_format).map(|(_, name)| *name);
    let number = header.vk_format;
    facts.add(
        "format",
        known.map_or(format!("VkFormat {number}"), |name| format!("{name} ({number})")),
        number,
    );
    facts.add("size", format!("{} x {}", header.width, header.height), json!([header.width, header.height]));
    let cube = if header.faces == 6 { " (a cube map)" } else { "" };
    facts.add("faces", format!("{}{cube}", header.faces), header.faces);
    facts.add("levels", header.levels.to_string(), header.levels);
    if header.layers > 0 {
        facts.add("layers", header.layers.to_string(), header.layers);
    }
    let packing = match header.supercompression {
        0 => "none".to_owned(),
        1 => "Basis".to_owned(),
        2 => "Zstandard".to_owned(),
        3 => "zlib".to_owned(),
        other => format!("scheme {other}"),
    };
    facts.add("supercompression", packing.clone(), packing);
    Ok(facts)
}

pub(super) fn env(path: &Path) -> Result<Facts> {
    let header = EnvHeader::read(&start(path, EnvHeader::LEN)?).map_err(|e| e.in_file(path))?;
    let mut facts = Facts::new("Babylon.js environment");
    facts.add("version", header.version.to_string(), header.version);
    facts.add("size", format!("{0} x {0}", header.width), header.width);
    let levels = header.specular.mipmaps.len() / 6;
    facts.add("levels", levels.to_string(), levels);
    if let Some(scale) = header.specular.lod_generation_scale {
        facts.add("levels per octave", scale.to_string(), scale);
    }
    Ok(facts)
}

/// The first bytes of a file.
fn start(path: &Path, bytes: usize) -> Result<Vec<u8>> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let mut start = Vec::new();
    file.take(bytes as u64).read_to_end(&mut start).map_err(|e| Error::io(path, "read", e))?;
    Ok(start)
}
