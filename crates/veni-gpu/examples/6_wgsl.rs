//! Writes the decoder's WGSL for a model to standard output, for users of other APIs: pipe it into a file, and from
//! there through naga or Tint to SPIR-V, MSL or HLSL. Needs no graphics device.
//!
//! ```sh
//! cargo run --release -p veni-gpu --example 6_wgsl > field.wgsl              # a function to paste
//! cargo run --release -p veni-gpu --example 6_wgsl -- --module > field.wgsl  # a naga_oil module to import
//! cargo run --release -p veni-gpu --example 6_wgsl -- --kernel > bake.wgsl   # a whole compute kernel
//! cargo run --release -p veni-gpu --example 6_wgsl -- --light > light.wgsl   # importance sampling of a light
//! ```
//!
//! `--model FILE` takes another model. What a host must bind is said on standard error. The buffers' content comes from
//! `veni_gpu::shader::{pack_model, pack_latent, pack_light}`, which need no graphics API either.

use std::io::Write;
use std::path::{Path, PathBuf};

use veni_gpu::shader::{self, Directions, ENTRY_POINT, Kernel, Sizes, Store, Variant, WeightPrecision};
use veni_light::model::Model;

/// Workgroup memory that every WebGPU device has, bytes.
const WORKGROUP_MEMORY: u32 = 16 << 10;
/// The first line: a copy in a repository says that it is one.
const GENERATED: &str = "// Generated from crates/veni-gpu/shaders by the example 6_wgsl: do not edit.\n";
const USAGE: &str = "6_wgsl [--function | --module | --kernel | --light] [--model FILE]";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../veni-light/assets/veni-27.safetensors");
    let mut what = String::from("--function");
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--function" | "--module" | "--kernel" | "--light" => what = arg,
            "--model" => path = PathBuf::from(args.next().ok_or("--model needs a file")?),
            _ => return Err(format!("unknown argument {arg}; {USAGE}").into()),
        }
    }
    // the text depends on the sizes of the network alone, never on its weights
    let sizes = Sizes::from(Model::load(&path)?.config());
    let text = match what.as_str() {
        "--module" => {
            eprintln!("#import veni::field::veni_radiance; group 0, bindings 0 to 2 as declared at the top");
            shader::field_module(sizes, 0, 0)
        }
        "--kernel" => kernel(sizes)?,
        "--light" => {
            eprintln!(
                "veni_sample_light, veni_light_pdf, veni_sun, veni_irradiance; declare in a group and at bindings of your choice:"
            );
            eprint!("{}", shader::light_bindings(0, 0));
            shader::light()
        }
        _ => {
            eprintln!(
                "fn veni_radiance, veni_lights (direction: vec3f) -> vec3f; declare in a group and at bindings of your choice:"
            );
            eprint!("{}", shader::field_bindings(0, 0, WeightPrecision::Single));
            shader::field(sizes)
        }
    };
    std::io::stdout().write_all([GENERATED, &text].concat().as_bytes())?;
    Ok(())
}

/// Pixels of a panorama or of cube faces into a buffer of vec4f, by WebGPU's default limits.
fn kernel(sizes: Sizes) -> Result<String, String> {
    let variant = Variant {
        sizes,
        kernel: Kernel::Tiled { memory: WORKGROUP_MEMORY, subgroups: false },
        weights: WeightPrecision::Single,
        directions: Directions::Grid,
        store: Store::Buffer,
    };
    // a decoder too wide to be tiled
    let variant = if variant.is_possible() { variant } else { Variant { kernel: Kernel::Each, ..variant } };
    let threads = variant.kernel.threads(sizes).ok_or_else(|| format!("no kernel for {sizes:?}"))?;
    let tile = variant.tile();
    eprintln!("entry point {ENTRY_POINT}: {threads} invocations evaluate {tile} directions");
    for (binding, what) in variant.bindings().iter().enumerate() {
        eprintln!("group 0, binding {binding}: {what:?}");
    }
    for (name, value) in variant.constants() {
        eprintln!("override {name} = {value}");
    }
    Ok(variant.source())
}
