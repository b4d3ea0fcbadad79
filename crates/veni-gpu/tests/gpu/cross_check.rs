//! The GPU against the CPU's field.

use veni_gpu::decoder::KernelChoice;
use veni_gpu::shader::{Grid, Kernel, WeightPrecision};
use veni_gpu::{Bake, GpuDecoder};
use veni_light::model::Model;
use veni_light::sphere::{CubeFace, Equirect, Frame};

use crate::util::{self, agrees, difference, directions, filler, latent, say};

const SIZE: (u32, u32) = (32, 16);

fn compare(model: &Model, n: usize, name: &str, choice: KernelChoice, gpu: &util::Gpu) {
    let decoder = GpuDecoder::with_kernel(&gpu.opened.device, model, choice).unwrap();
    let latent = latent(n, 1);
    let grid = Grid::Equirect { width: SIZE.0, height: SIZE.1 };
    let found = gpu.log_radiance(&decoder, &latent, grid);
    let grid = Equirect::new(SIZE.0 as usize, SIZE.1 as usize);
    let mut expected = vec![[0.0; 3]; grid.len()];
    let field = model.decoder().unwrap().condition(&latent).unwrap();
    field.log_radiance_batch(&grid.directions(), &mut expected);
    let off = difference(&found, &expected);
    say(&format!(
        "{name}, {:?}, {:?}: off by {:.1e} at most, {:.1e} on average",
        decoder.kernel(),
        decoder.weights(),
        off.0,
        off.1
    ));
    assert!(agrees(off), "{name}: {off:?}");
}

#[test]
fn papers_sizes_with_default_limits() {
    let Some(gpu) = util::plain() else { return };
    for n in [9, 49, 100] {
        compare(&filler(n, 128, 6), n, &format!("N = {n}"), KernelChoice::Auto, &gpu);
    }
}

#[test]
fn one_direction_per_invocation() {
    let Some(gpu) = util::plain() else { return };
    compare(&filler(9, 128, 6), 9, "N = 9", KernelChoice::PlainEach, &gpu);
}

#[test]
fn odd_sizes() {
    let Some(gpu) = util::plain() else { return };
    // padding of features, of inputs, of columns; a tile that fills the memory differently
    for (n, hidden, layers) in [(1, 1, 1), (3, 20, 2), (6, 64, 1), (2, 200, 2)] {
        compare(
            &filler(n, hidden, layers),
            n,
            &format!("N = {n}, h = {hidden}, {layers} layers"),
            KernelChoice::Auto,
            &gpu,
        );
    }
}

#[test]
fn too_wide_to_be_tiled() {
    let Some(gpu) = util::plain() else { return };
    let model = filler(1, 1100, 1);
    let device = &gpu.opened.device;
    assert_eq!(GpuDecoder::new(device, &model).unwrap().kernel(), Kernel::Each);
    let refused = GpuDecoder::with_kernel(device, &model, KernelChoice::PlainTiled).unwrap_err();
    assert!(refused.to_string().contains("1100"), "{refused}");
}

#[test]
fn pretrained_model_with_all_the_device_has() {
    let Some(gpu) = util::rich() else { return };
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../veni-light/assets/veni-27.safetensors");
    let model = Model::load(path).unwrap();
    // stored in f16: packed so where the device can
    for choice in [KernelChoice::Auto, KernelChoice::SingleWeights] {
        compare(&model, 9, "pretrained", choice, &gpu);
    }
    let device = &gpu.opened.device;
    let weights = |choice| GpuDecoder::with_kernel(device, &model, choice).unwrap().weights();
    let f16 = device.features().contains(veni_gpu::wgpu::Features::SHADER_F16);
    assert_eq!(
        weights(KernelChoice::Auto),
        if f16 { WeightPrecision::Half } else { WeightPrecision::Single }
    );
    assert_eq!(weights(KernelChoice::SingleWeights), WeightPrecision::Single);
}

/// Sums within subgroups, on adapters whose subgroups hold the groups of a narrow decoder.
#[test]
fn subgroups() {
    let Some(gpu) = util::rich() else { return };
    for hidden in [16, 64, 128] {
        compare(&filler(4, hidden, 2), 4, &format!("h = {hidden}"), KernelChoice::Auto, &gpu);
    }
    // h = 64: eight groups, 64 invocations
    let (device, info) = (&gpu.opened.device, &gpu.opened.info);
    let summed = device.features().contains(veni_gpu::wgpu::Features::SUBGROUP)
        && (8..=64).contains(&info.subgroup_min_size)
        && info.subgroup_max_size <= 64;
    if !summed {
        say("no subgroups of 8 to 64 invocations: sums within them not tested");
    }
    let kernel = GpuDecoder::new(device, &filler(4, 64, 2)).unwrap().kernel();
    assert!(!summed || matches!(kernel, Kernel::Tiled { subgroups: true, .. }), "{kernel:?}");
}

#[test]
fn cube_faces_and_lists_in_every_frame() {
    let Some(gpu) = util::plain() else { return };
    let model = filler(9, 128, 6);
    let decoder = GpuDecoder::new(&gpu.opened.device, &model).unwrap();
    let latent = latent(9, 2);
    let angle = 0.7;
    let field = model.decoder().unwrap().condition(&latent).unwrap().rotated(angle).brightened(0.5);
    let latents = decoder.condition(&gpu.opened.queue, &latent).unwrap();
    let size = 4;
    for frame in Frame::ALL {
        let native: Vec<_> = CubeFace::ALL.iter().flat_map(|face| face.directions(frame, size)).collect();
        let mut expected = vec![[0.0; 3]; native.len()];
        field.log_radiance_batch(&native, &mut expected);
        let pixels = gpu.pixels(native.len());
        let grid = Grid::Cube { size: size as u32 };
        let bake = Bake::rows(&pixels, grid, 0..6 * size as u32)
            .frame(frame)
            .rotate(angle)
            .brighten(0.5)
            .logarithm();
        gpu.bake(&decoder, &latents, &bake);
        let off = difference(&gpu.read(&pixels), &expected);
        assert!(agrees(off), "cube in {frame:?}: {off:?}");

        // the same directions as a list in the frame's own coordinates
        let list = directions(100);
        let native: Vec<_> = list.iter().map(|d| frame.to_native(*d)).collect();
        let mut expected = vec![[0.0; 3]; list.len()];
        field.log_radiance_batch(&native, &mut expected);
        let (from, to) = (gpu.upload(&list), gpu.pixels(list.len()));
        let bake = Bake::directions(&from, &to, 100).frame(frame).rotate(angle).brighten(0.5).logarithm();
        gpu.bake(&decoder, &latents, &bake);
        let off = difference(&gpu.read(&to), &expected);
        assert!(agrees(off), "list in {frame:?}: {off:?}");
    }
}

/// A cube face seen through the panorama: both lookups of one direction agree to what a pixel of the panorama spans.
#[test]
fn cube_faces_show_what_the_panorama_shows() {
    let Some(gpu) = util::plain() else { return };
    let model = filler(3, 32, 2);
    let decoder = GpuDecoder::new(&gpu.opened.device, &model).unwrap();
    let latent = latent(3, 4);
    let panorama = gpu.log_radiance(&decoder, &latent, Grid::Equirect { width: 512, height: 256 });
    let cube = gpu.log_radiance(&decoder, &latent, Grid::Cube { size: 8 });
    let grid = Equirect::new(512, 256);
    let native: Vec<_> = CubeFace::ALL.iter().flat_map(|face| face.directions(Frame::Blender, 8)).collect();
    let nearest = native.iter().map(|d| {
        let [column, row] = grid.pixel(*d);
        panorama[row as usize * 512 + column as usize]
    });
    let (worst, mean) = difference(&cube, &nearest.collect::<Vec<_>>());
    assert!(worst < 0.5 && mean < 0.05, "off by {worst} at most, {mean} on average");
    // and not of the wrong faces: exchanged ones are far off
    let mut exchanged = cube.clone();
    exchanged.rotate_left(64);
    let nearest: Vec<_> = native
        .iter()
        .map(|d| {
            let [column, row] = grid.pixel(*d);
            panorama[row as usize * 512 + column as usize]
        })
        .collect();
    assert!(difference(&exchanged, &nearest).1 > 4.0 * mean);
}
