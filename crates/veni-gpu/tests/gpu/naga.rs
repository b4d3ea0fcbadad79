//! Every variant parses, validates and translates, without any device: also those that no adapter here can run.

use naga::back::spv;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use veni_gpu::shader::{
    self, Binding, Directions, ENTRY_POINT, Kernel, Sizes, StorageFormat, Store, Variant, WeightPrecision,
};

const PAPER: Sizes = Sizes { latents: 9, hidden: 128, layers: 6 };

fn validate(name: &str, source: &str, constants: &[(&str, f64)]) -> naga::Module {
    let module = naga::front::wgsl::parse_str(source)
        .unwrap_or_else(|e| panic!("{name}: {}\n{source}", e.emit_to_string(source)));
    let check = |module: &naga::Module| {
        Validator::new(ValidationFlags::all(), Capabilities::all())
            .validate(module)
            .unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(source)))
    };
    let info = check(&module);
    let constants = constants.iter().map(|(key, value)| ((*key).to_owned(), *value)).collect();
    let (module, info) = naga::back::pipeline_constants::process_overrides(&module, &info, None, &constants)
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let words = spv::write_vec(&module, &info, &spv::Options::default(), None)
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    assert!(!words.is_empty());
    module.into_owned()
}

fn variants() -> Vec<Variant> {
    let sizes = [
        PAPER,
        Sizes { latents: 49, ..PAPER },
        Sizes { latents: 100, ..PAPER },
        Sizes { latents: 1, hidden: 20, layers: 1 },
    ];
    let tiled = |memory, subgroups| Kernel::Tiled { memory, subgroups };
    let kernels =
        [Kernel::Each, tiled(16_384, false), tiled(16_384, true), tiled(32_768, false), tiled(65_536, true)];
    let ends = [
        (Directions::Grid, Store::Texture(StorageFormat::Rgba32Float)),
        (Directions::Grid, Store::Texture(StorageFormat::Rgba16Float)),
        (Directions::Grid, Store::Buffer),
        (Directions::Buffer, Store::Buffer),
    ];
    let mut all = Vec::new();
    for sizes in sizes {
        for kernel in kernels {
            for weights in [WeightPrecision::Single, WeightPrecision::Half] {
                for (directions, store) in ends {
                    let variant = Variant { sizes, kernel, weights, directions, store };
                    if variant.is_possible() {
                        all.push(variant);
                    }
                }
            }
        }
    }
    all
}

#[test]
fn every_variant_is_valid_and_has_the_bindings_it_says() {
    let all = variants();
    assert!(all.len() > 130, "only {} variants", all.len());
    for variant in all {
        let name = format!("{variant:?}");
        let module = validate(&name, &variant.source(), &variant.constants());
        let entry = module.entry_points.iter().find(|e| e.name == ENTRY_POINT).expect("the entry point");
        let threads = variant.kernel.threads(variant.sizes).unwrap();
        assert_eq!(entry.workgroup_size, [threads, 1, 1], "{name}");
        let declared = module.global_variables.iter().filter_map(|(_, v)| Some((v.binding?.binding, v)));
        let mut declared: Vec<_> = declared.collect();
        declared.sort_by_key(|(binding, _)| *binding);
        assert_eq!(declared.len(), variant.bindings().len(), "{name}");
        for ((number, variable), said) in declared.into_iter().zip(variant.bindings()) {
            let writes = |access: naga::StorageAccess| access.contains(naga::StorageAccess::STORE);
            let fits = match (variable.space, said) {
                (naga::AddressSpace::Storage { access }, Binding::Read) => !writes(access),
                (naga::AddressSpace::Storage { access }, Binding::Write) => writes(access),
                (naga::AddressSpace::Uniform, Binding::Uniform)
                | (naga::AddressSpace::Handle, Binding::Texture(_)) => true,
                _ => false,
            };
            assert!(fits, "{name}: binding {number} is not {said:?}");
        }
    }
}

#[test]
fn workgroup_memory_stays_within_what_was_granted() {
    for variant in variants() {
        let Kernel::Tiled { memory, .. } = variant.kernel else { continue };
        let module = validate("", &variant.source(), &variant.constants());
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).unwrap();
        let used: u32 = (module.global_variables.iter())
            .filter(|(_, v)| v.space == naga::AddressSpace::WorkGroup)
            .map(|(_, v)| layouter[v.ty].size)
            .sum();
        assert!(used <= memory, "{variant:?} uses {used} bytes");
        // and makes something of it
        assert!(4 * used > memory || variant.sizes.hidden < 64, "{variant:?} uses {used} bytes");
    }
}

#[test]
fn a_broken_shader_does_not_pass() {
    let variant = variants()[0];
    let broken = variant.source().replace("fn veni_sin_cos(t: f32)", "fn veni_sin_cos(t: u32)");
    assert!(std::panic::catch_unwind(|| validate("broken", &broken, &variant.constants())).is_err());
}

#[test]
fn the_function_pastes_into_a_shader_of_its_own() {
    let sizes = PAPER;
    let tracer = "
        @group(1) @binding(0) var<storage, read_write> out: array<vec4f>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {
            let up = vec3f(0.0, 0.0, 1.0);
            out[id.x] = vec4f(veni_radiance(vec3f(0.0, 0.6, 0.8)) + veni_log_radiance(up) + veni_lights(up), 1.0);
        }";
    for weights in [WeightPrecision::Single, WeightPrecision::Half] {
        let enable = if weights == WeightPrecision::Half { "enable f16;\n" } else { "" };
        let bindings = shader::field_bindings(0, 3, weights);
        let text = format!("{enable}{bindings}{}{tracer}", shader::field(sizes));
        let module = validate("pasted", &text, &[]);
        assert_eq!(module.global_variables.len(), 4);
    }
    // the function itself binds nothing
    assert!(!shader::field(sizes).contains("@group"));
}

const SAMPLES: &str = "
        @group(1) @binding(0) var<storage, read_write> out: array<vec4f>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {
            let s = veni_sample_light(vec2f(0.3, 0.6));
            let t = veni_sun(vec2f(0.3, 0.6));
            let e = veni_irradiance(s.direction) + veni_light_radiance(t.direction);
            out[id.x] = vec4f(s.radiance + t.radiance + e, s.pdf + t.pdf + veni_light_pdf(t.direction));
        }";

#[test]
fn the_lights_functions_paste_alone_and_beside_the_field() {
    let light = format!("{}{}", shader::light_bindings(0, 3), shader::light());
    assert!(!shader::light().contains("@group"));
    let module = validate("light", &format!("{light}{SAMPLES}"), &[]);
    assert_eq!(module.global_variables.len(), 4);
    // the uniform is as long as the host makes it
    let mut layouter = naga::proc::Layouter::default();
    layouter.update(module.to_ctx()).unwrap();
    let (_, uniform) =
        module.global_variables.iter().find(|(_, v)| v.name.as_deref() == Some("veni_light")).unwrap();
    assert_eq!(layouter[uniform.ty].size as usize, shader::LightUniform::BYTES);
    let field = format!("{}{}", shader::field_bindings(0, 0, WeightPrecision::Single), shader::field(PAPER));
    let both = SAMPLES.replace("s.radiance +", "s.radiance + veni_radiance(s.direction) +");
    assert_eq!(validate("both", &format!("{field}{light}{both}"), &[]).global_variables.len(), 7);
}

/// What the files in assets begin with.
const GENERATED: &str = "// Generated from crates/veni-gpu/shaders by the example 6_wgsl: do not edit.\n";

#[test]
fn the_lights_file_is_the_text() {
    let file = include_str!("../../../../assets/veni_light.wgsl");
    assert!(
        file.strip_prefix(GENERATED) == Some(&shader::light()),
        "out of date: cargo run --release -p veni-gpu --example 6_wgsl -- --light > assets/veni_light.wgsl"
    );
}

#[test]
fn the_lights_functions_import_as_a_naga_oil_module() {
    let source = "
        #import veni::light::{veni_sample_light, veni_light_pdf}
        @fragment
        fn sky(@location(0) u: vec2f) -> @location(0) vec4f {
            let s = veni_sample_light(u);
            return vec4f(s.radiance / s.pdf, veni_light_pdf(s.direction));
        }";
    assert_eq!(composed(&shader::light_module(1, 4), source), [(1, 4), (1, 5), (1, 6)]);
}

/// The copy of the function that lies in the repository for those who paste it.
#[test]
fn the_function_file_is_that_of_the_shipped_model() {
    let file = include_str!("../../../../assets/veni_field.wgsl");
    assert!(
        file.strip_prefix(GENERATED) == Some(&shader::field(PAPER)),
        "out of date: cargo run --release -p veni-gpu --example 6_wgsl > assets/veni_field.wgsl"
    );
}

/// The bindings of `source` after it has imported `module`.
fn composed(module: &str, source: &str) -> Vec<(u32, u32)> {
    use naga_oil::compose::{ComposableModuleDescriptor, Composer, NagaModuleDescriptor};
    let mut composer = Composer::default();
    let added = composer
        .add_composable_module(ComposableModuleDescriptor { source: module, ..Default::default() })
        .map(drop);
    added.unwrap_or_else(|e| panic!("{}", e.emit_to_string(&composer)));
    let composed = composer
        .make_naga_module(NagaModuleDescriptor { source, file_path: "sky.wgsl", ..Default::default() })
        .unwrap_or_else(|e| panic!("{}", e.emit_to_string(&composer)));
    Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&composed).unwrap();
    let mut bindings: Vec<_> = composed
        .global_variables
        .iter()
        .filter_map(|(_, v)| v.binding.map(|b| (b.group, b.binding)))
        .collect();
    bindings.sort_unstable();
    bindings
}

#[test]
fn the_function_imports_as_a_naga_oil_module() {
    let source = "
        #import veni::field::veni_radiance
        @fragment
        fn sky(@location(0) direction: vec3f) -> @location(0) vec4f {
            return vec4f(veni_radiance(normalize(direction)), 1.0);
        }";
    assert_eq!(composed(&shader::field_module(PAPER, 2, 5), source), [(2, 5), (2, 6), (2, 7)]);
}

#[test]
fn harmonics_and_levels_are_valid() {
    let module = validate("spectrum", shader::spectrum_source(), &[]);
    let names: Vec<_> = module.entry_points.iter().map(|e| e.name.as_str()).collect();
    assert_eq!(names, shader::SPECTRUM_ENTRY_POINTS);
    for format in [StorageFormat::Rgba32Float, StorageFormat::Rgba16Float] {
        let module = validate("level", &shader::level_source(format), &[]);
        assert_eq!(module.entry_points[0].name, shader::LEVEL_ENTRY_POINT);
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).unwrap();
        let uniform =
            module.global_variables.iter().find(|(_, v)| v.space == naga::AddressSpace::Uniform).unwrap().1;
        assert_eq!(layouter[uniform.ty].size as usize, shader::Level::BYTES);
    }
}

#[test]
fn the_probe_is_valid() {
    validate("probe", &shader::probe_source(), &[]);
}
