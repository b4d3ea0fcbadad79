//! Assembly of the WGSL that samples a light.

use super::text::TURNS;

/// WGSL with `veni_sample_light(u: vec2f) -> VeniLightSample` (direction, density, radiance), `veni_light_pdf(direction) -> f32`,
/// `veni_light_radiance(direction) -> vec3f`, `veni_sun(u) -> VeniLightSample` and `veni_irradiance(normal) -> vec3f`, for pasting
/// into a shader, beside [`field`](super::field) or without it. It has no bindings inside: declare those of
/// [`light_bindings`]; their content is [`pack_light`](super::pack_light)'s.
///
/// Directions and normals are unit vectors of the native frame (z up), random numbers are of [0, 1), densities over solid angle
/// (1/sr), radiance is linear Rec. 709 in the unit of the map, irradiance that times steradian.
pub fn light() -> String {
    // under a name of its own, so that it may stand beside the field's
    let turns = TURNS.replace("veni_sin_cos", "veni_light_sin_cos");
    let parts = [
        "// Importance sampling of a light: veni_sample_light, veni_light_pdf, veni_light_radiance, veni_sun, veni_irradiance.\n\
         // Declare veni_light, veni_light_cells and veni_light_texels; see below.\n",
        include_str!("../../shaders/light_layout.wgsl"),
        &turns,
        include_str!("../../shaders/light_angle.wgsl"),
        include_str!("../../shaders/light_sample.wgsl"),
        include_str!("../../shaders/light_sun.wgsl"),
        include_str!("../../shaders/light_irradiance.wgsl"),
    ];
    parts.join("\n")
}

/// The three declarations that [`light`] needs, in a group and from a binding on: a uniform buffer and two read-only storage
/// buffers.
pub fn light_bindings(group: u32, first: u32) -> String {
    let [uniform, cells, texels] = [first, first + 1, first + 2];
    format!(
        "@group({group}) @binding({uniform}) var<uniform> veni_light: VeniLight;\n\
         @group({group}) @binding({cells}) var<storage, read> veni_light_cells: array<vec2u>;\n\
         @group({group}) @binding({texels}) var<storage, read> veni_light_texels: array<vec4f>;\n"
    )
}

/// [`light`] and its bindings as a naga_oil module `veni::light`: `#import veni::light::{veni_sample_light, veni_light_pdf}`.
pub fn light_module(group: u32, first: u32) -> String {
    format!("#define_import_path veni::light\n\n{}\n{}", light_bindings(group, first), light())
}
