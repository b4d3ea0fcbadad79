//! The golden fields through the GPU decoder: forward only, under the same tolerance rule.

use crate::case::{Case, Data};
use crate::field::{self, Sizes};
use crate::report::{Verdict, case_files, summarise};
use burn::tensor::{Device, Tensor};
use std::collections::BTreeMap;
use veni::gpu::adapters::{self, Opened};
use veni::gpu::wgpu::{BufferDescriptor, BufferUsages, CommandEncoderDescriptor};
use veni::gpu::{Bake, GpuDecoder, read_back};
use veni::latent::Latent;
use veni::model::{Model, ModelConfig, ModelInfo};
use veni::vae::decoder::rotate;
use veni::vae::weights;

/// Why the decoder of a model file cannot be this field on the GPU, if it cannot; burn's can be more.
fn unsupported(case: &Case) -> Option<String> {
    let only = |key: &str, ours: &str| {
        let value = case.text(key).unwrap_or(ours);
        (value != ours).then(|| format!("{key} = {value}: the GPU decoder has {ours}"))
    };
    field::unsupported(case)
        .or_else(|| Sizes::of(case).config.check_folds().err().map(|e| e.to_string()))
        .or_else(|| only("output_activation", "None"))
        .or_else(|| only("axis_of_invariance", "z"))
}

/// The case's decoder as a model.
fn model(source: &Case) -> Model {
    let decoder = field::build(source, "", &Device::flex());
    let Sizes { n, config, .. } = Sizes::of(source);
    let config = ModelConfig { decoder: config, ..ModelConfig::decode_only(n) };
    let tensors: BTreeMap<_, _> = weights::read(&decoder, "decoder")
        .into_iter()
        .map(|(name, w)| (name, veni::model::Array { shape: w.shape, data: w.data }))
        .collect();
    Model::new(config, tensors, ModelInfo::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// Log radiance of every latent in every direction, [B · R, 3].
fn decode(gpu: &Opened, model: &Model, latents: &[Latent], directions: &[[f32; 3]]) -> Vec<f32> {
    let decoder = GpuDecoder::new(&gpu.device, model).unwrap_or_else(|e| panic!("{e}"));
    let latents = decoder.condition_batch(&gpu.queue, latents).unwrap_or_else(|e| panic!("{e}"));
    let buffer = |count: usize, usage: BufferUsages| {
        let size = 16 * count as u64;
        gpu.device.create_buffer(&BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    };
    let from = buffer(directions.len(), BufferUsages::STORAGE | BufferUsages::COPY_DST);
    let data: Vec<f32> = directions.iter().flat_map(|[x, y, z]| [*x, *y, *z, 0.0]).collect();
    gpu.queue.write_buffer(&from, 0, &data.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>());
    let to =
        buffer(latents.len() as usize * directions.len(), BufferUsages::STORAGE | BufferUsages::COPY_SRC);
    let mut encoder = gpu.device.create_command_encoder(&CommandEncoderDescriptor::default());
    let bake = Bake::directions(&from, &to, directions.len() as u32).logarithm();
    decoder.bake(&mut encoder, &latents, &bake).unwrap_or_else(|e| panic!("{e}"));
    gpu.queue.submit([encoder.finish()]);
    read_back::buffer(&gpu.device, &gpu.queue, &to).unwrap_or_else(|e| panic!("{e}")).into_flattened()
}

/// Computes one case, or says why not; `None` if it is not a field at all.
fn run(case: &Case, gpu: &Opened, shift: f32) -> Option<Verdict> {
    if !["VENIField", "RENIField"].contains(&case.module()) || !case.expects("out.rgb") {
        return None;
    }
    if let Some(reason) = unsupported(case) {
        return Some(Verdict::Skipped(reason));
    }
    let companion = match field::companion(case) {
        Ok(companion) => companion,
        Err(reason) => return Some(Verdict::Skipped(reason)),
    };
    let device = Device::flex();
    let model = model(companion.as_ref().unwrap_or(case));
    let latent: Tensor<3> = case.tensor("in.latent", &device);
    let latent = match case.get("in.rotation") {
        Some(rotation) => rotate(latent, rotation.tensor([3, 3], &device)),
        None => latent,
    };
    let [batch, n, _] = latent.dims();
    let vectors = Data::of(&latent).values;
    let latents = vectors.as_chunks::<3>().0.chunks_exact(n).map(|v| Latent::new(v.to_vec()));
    let directions = match case.get("in.directions") {
        Some(d) => d.values.clone(),
        None => Data::of(&field::map_directions(&case.data("out.rgb").shape, &device)).values,
    };
    let mut rgb = decode(gpu, &model, &latents.collect::<Vec<_>>(), directions.as_chunks::<3>().0);
    // one number per ray, or one per image
    let scale = ["in.scale_per_ray", "in.scale"].into_iter().find_map(|name| case.get(name));
    if let Some(scale) = scale {
        let each = rgb.len() / scale.values.len();
        rgb.chunks_exact_mut(each)
            .zip(&scale.values)
            .for_each(|(rgb, s)| rgb.iter_mut().for_each(|v| *v += s));
    }
    rgb.iter_mut().for_each(|v| *v += shift);
    case.compare("out.rgb", &Data::new([batch, directions.len() / 3, 3], rgb));
    let mut failures = case.failures();
    failures.retain(|f| !f.ends_with("never compared"));
    Some(if failures.is_empty() { Verdict::Passed(case.ratios()) } else { Verdict::Failed(failures) })
}

/// The first adapter, or nothing if `VENI_SKIP_GPU=1` says that there is none.
fn open() -> Option<Opened> {
    let Some(found) = pollster::block_on(adapters::list()).into_iter().next() else {
        assert!(
            std::env::var("VENI_SKIP_GPU").is_ok_and(|v| v == "1"),
            "no graphics adapter: install a Vulkan driver (package mesa-vulkan-drivers), or set VENI_SKIP_GPU=1"
        );
        eprintln!("no adapter and VENI_SKIP_GPU=1: golden fields on the GPU skipped");
        return None;
    };
    Some(pollster::block_on(found.open()).unwrap_or_else(|e| panic!("{e}")))
}

#[test]
fn golden_on_gpu() {
    let Some(gpu) = open() else { return };
    let mut results = Vec::new();
    for path in case_files(&crate::folder()) {
        let case = Case::load(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        results.extend(run(&case, &gpu, 0.0).map(|verdict| (case.name.clone(), verdict)));
    }
    let [passed, _] = summarise(&gpu.to_string(), &results);
    // VENI's and RENI++'s decoders; the other forms of c05 are skipped by name, since they do not fold
    let ours = std::env::var_os("VENI_GOLDEN_DIR").is_none();
    assert!(passed >= 9 || !ours, "only {passed} cases are fields for the GPU");
}

#[test]
fn an_offset_on_the_gpu_is_seen() {
    let Some(gpu) = open() else { return };
    let path = crate::folder().join("c05_renipp_small.safetensors");
    if !path.is_file() {
        return;
    }
    let case = Case::load(&path).unwrap_or_else(|e| panic!("{e}"));
    assert!(matches!(run(&case, &gpu, 1e-3), Some(Verdict::Failed(_))));
}
