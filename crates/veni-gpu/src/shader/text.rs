//! Assembly of WGSL: one file per stage, constants in front, repeated lines written out.

use super::{Sizes, WeightPrecision};

pub(super) const LAYOUT: &str = include_str!("../../shaders/layout.wgsl");
pub(super) const TURNS: &str = include_str!("../../shaders/turns.wgsl");
pub(super) const ENCODE: &str =
    concat!(include_str!("../../shaders/turns.wgsl"), "\n", include_str!("../../shaders/encode.wgsl"));
pub(super) const FIELD: &str =
    concat!(include_str!("../../shaders/compact.wgsl"), "\n", include_str!("../../shaders/field.wgsl"));

/// WGSL with `fn veni_radiance(direction: vec3f) -> vec3f` of the first uploaded latent, `fn veni_log_radiance` of it without its
/// lights, and `fn veni_lights` of these alone (and `veni_log_radiance_of(index, direction)`, `veni_lights_of(index, direction)`), for
/// pasting into a shader. It has no bindings inside: declare those of [`field_bindings`]. Directions are unit vectors of the native
/// frame (z up).
///
/// `veni_radiance` is a sun's full radiance where the direction meets its disc: whoever integrates it over directions drawn without
/// regard to the sun gets noise. Sample the sun ([`light`](super::light)), or draw it as a light of its own and leave `veni_lights`
/// out: e to the power of `veni_log_radiance`.
pub fn field(sizes: Sizes) -> String {
    let Sizes { latents, hidden, layers } = sizes;
    let constants = format!(
        "// The VENI decoder as a function: fn veni_radiance(direction: vec3f) -> vec3f, for N = {latents}, h = {hidden}, \
         {layers} layers.\n\
         // Declare veni_matrices, veni_vectors and veni_latents as read-only storage buffers; see below.\n\n{}",
        constants(sizes, "const")
    );
    expand(&[constants.as_str(), LAYOUT, ENCODE, FIELD].join("\n"), sizes)
}

/// The three declarations that [`field`] needs, in a group and from a binding on. With [`WeightPrecision::Half`] the shader that
/// they go into begins with `enable f16;`.
pub fn field_bindings(group: u32, first: u32, weights: WeightPrecision) -> String {
    let weight = weights.wgsl();
    let declaration = |i: u32, name: &str, of: &str| {
        let binding = first + i;
        format!("@group({group}) @binding({binding}) var<storage, read> veni_{name}: array<{of}>;\n")
    };
    [("matrices", weight), ("vectors", "vec4f"), ("latents", "vec4f")]
        .iter()
        .zip(0..)
        .map(|((name, of), i)| declaration(i, name, of))
        .collect()
}

/// [`field`] and its bindings as a naga_oil module `veni::field`: `#import veni::field::veni_radiance`. naga_oil
/// passes modules on in a form that has no f16, so the weights are f32: those of a decoder made with
/// `KernelChoice::SingleWeights`, or [`pack_model`](super::pack_model)'s.
pub fn field_module(sizes: Sizes, group: u32, first: u32) -> String {
    let bindings = field_bindings(group, first, WeightPrecision::Single);
    format!("#define_import_path veni::field\n\n{bindings}\n{}", field(sizes))
}

/// The module of the rate probe; its entry point is `veni_probe`.
pub fn probe_source() -> String {
    expand(include_str!("../../shaders/probe.wgsl"), Sizes { latents: 1, hidden: 8, layers: 1 })
}

/// Sizes as module constants: `const`, or `override` for what kernels leave to the pipeline.
pub(super) fn constants(sizes: Sizes, keyword: &str) -> String {
    let Sizes { latents, hidden, layers } = sizes;
    let columns = sizes.columns();
    format!(
        "{keyword} VENI_LATENTS: u32 = {latents}u;\n\
         {keyword} VENI_HIDDEN: u32 = {hidden}u;\n\
         {keyword} VENI_LAYERS: u32 = {layers}u;\n\
         const VENI_COLUMNS: u32 = {columns}u;\n\
         const VENI_BLOCK: u32 = {block}u;\n",
        block = block(sizes),
    )
}

/// Columns whose sums an invocation of kernel "each" keeps in registers.
fn block(sizes: Sizes) -> usize {
    if sizes.columns().is_multiple_of(4) { 4 } else { 2 }
}

/// Writes the lines `VENI_FOR_*(…)` out, with `@` and `@ + k` as plain numbers: a constant index keeps arrays in
/// registers on every driver, unrolled loop or not.
pub(super) fn expand(text: &str, sizes: Sizes) -> String {
    let ranges = [
        ("VENI_FOR_BLOCK(", 0..block(sizes)),
        ("VENI_FOR_FOUR(", 0..4),
        ("VENI_FOR_EIGHT(", 0..8),
        ("VENI_FOR_HIGH(", 8..16),
        ("VENI_FOR_SIXTEEN(", 0..16),
    ];
    let mut out = String::with_capacity(2 * text.len());
    for line in text.lines() {
        let body = line.trim_start();
        let found = ranges.iter().find_map(|(name, range)| Some((body.strip_prefix(name)?, range)));
        match found.and_then(|(rest, range)| Some((rest.strip_suffix(')')?, range))) {
            Some((rest, range)) => {
                let indent = &line[..line.len() - body.len()];
                for i in range.clone() {
                    out.push_str(indent);
                    out.push_str(&instance(rest, i));
                    out.push('\n');
                }
            }
            None => {
                out.push_str(line);
                out.push('\n');
            }
        }
    }
    out
}

/// `body` with `@ + k` and `@` replaced by numbers.
fn instance(body: &str, i: usize) -> String {
    let mut out = body.to_owned();
    for k in [12, 8, 4] {
        out = out.replace(&format!("@ + {k}"), &(i + k).to_string());
    }
    out.replace('@', &i.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_lines_are_written_out() {
        let sizes = Sizes { latents: 1, hidden: 8, layers: 1 };
        let text = expand("a\n  VENI_FOR_FOUR(x[@] += y[@ + 8];)\nb", sizes);
        assert_eq!(text, "a\n  x[0] += y[8];\n  x[1] += y[9];\n  x[2] += y[10];\n  x[3] += y[11];\nb\n");
        assert_eq!(expand("VENI_FOR_BLOCK(s@ = w[c + @u];)", sizes), "s0 = w[c + 0u];\ns1 = w[c + 1u];\n");
    }
}
