//! Targets: textures, rows, batches, ranges of values.

use veni_gpu::read_back::{BakeLayout, bake_rows};
use veni_gpu::shader::Grid;
use veni_gpu::wgpu::TextureFormat;
use veni_gpu::{Bake, Error, GpuDecoder};
use veni_light::latent::Latent;
use veni_light::sphere::Equirect;

use crate::util::{self, agrees, difference, filler, latent};

fn cpu(model: &veni_light::model::Model, latent: &Latent, grid: Equirect) -> Vec<[f32; 3]> {
    let mut all = vec![[0.0; 3]; grid.len()];
    model.decoder().unwrap().condition(latent).unwrap().log_radiance_batch(&grid.directions(), &mut all);
    all
}

#[test]
fn a_batch_fills_a_layer_per_latent_in_one_pass() {
    let Some(gpu) = util::plain() else { return };
    let model = filler(4, 24, 2);
    let decoder = GpuDecoder::new(&gpu.opened.device, &model).unwrap();
    let frames: Vec<_> = (0..3).map(|i| latent(4, 1).rotated(f64::from(i))).collect();
    let latents = decoder.condition_batch(&gpu.opened.queue, &frames).unwrap();
    let texture = gpu.texture(TextureFormat::Rgba32Float, [20, 10, 3]);
    gpu.bake(&decoder, &latents, &Bake::equirect(&texture).logarithm());
    let grid = Equirect::new(20, 10);
    let layers = gpu.read_texture(&texture);
    for (layer, frame) in layers.chunks_exact(grid.len()).zip(&frames) {
        let off = difference(layer, &cpu(&model, frame, grid));
        assert!(agrees(off), "{off:?}");
    }
    // cubes: six layers each
    let cubes = gpu.texture(TextureFormat::Rgba32Float, [4, 4, 18]);
    gpu.bake(&decoder, &latents, &Bake::cube(&cubes).logarithm());
    let cubes = gpu.read_texture(&cubes);
    for (cube, frame) in cubes.chunks_exact(96).zip(&frames) {
        let off = difference(cube, &gpu.log_radiance(&decoder, frame, Grid::Cube { size: 4 }));
        assert!(off.0 <= 1e-6, "{off:?}");
    }
    // replaced in place: the second frame becomes the first
    decoder.update(&gpu.opened.queue, &latents, 1, &frames[..1]).unwrap();
    gpu.bake(&decoder, &latents, &Bake::equirect(&texture).logarithm());
    let layers = gpu.read_texture(&texture);
    assert_eq!(layers[..grid.len()], layers[grid.len()..2 * grid.len()]);
    assert_ne!(layers[..grid.len()], layers[2 * grid.len()..]);
}

#[test]
fn half_texels_are_clamped_never_infinite() {
    let Some(gpu) = util::plain() else { return };
    let model = filler(4, 24, 2);
    let decoder = GpuDecoder::new(&gpu.opened.device, &model).unwrap();
    let mut bright = latent(4, 1);
    bright.log_exposure = 11.0;
    let latents = decoder.condition(&gpu.opened.queue, &bright).unwrap();
    let texture = gpu.texture(TextureFormat::Rgba16Float, [16, 8, 1]);
    gpu.bake(&decoder, &latents, &Bake::equirect(&texture));
    let found = gpu.read_texture(&texture);
    let grid = Equirect::new(16, 8);
    let expected = model.decoder().unwrap().condition(&bright).unwrap().bake(grid);
    let (mut clamped, mut kept) = (0, 0);
    for (found, expected) in found.as_flattened().iter().zip(expected.as_flattened()) {
        if *expected > 65_536.0 {
            assert_eq!(*found, 65_504.0);
            clamped += 1;
        } else if *expected < 65_000.0 {
            // half precision: 11 bits
            assert!((found - expected).abs() <= 1e-3 * expected, "{found} for {expected}");
            kept += 1;
        }
    }
    assert!(clamped > 20 && kept > 20, "{clamped} clamped, {kept} kept: the case tests nothing");
    // logarithms too, of either sign
    for (stops, end) in [(1e6, 65_504.0), (-1e6, -65_504.0)] {
        gpu.bake(&decoder, &latents, &Bake::equirect(&texture).logarithm().brighten(stops));
        assert!(gpu.read_texture(&texture).as_flattened().iter().all(|v| *v == end), "{stops} stops");
    }
    // far beyond the range of f32 as well
    bright.log_exposure = 500.0;
    let latents = decoder.condition(&gpu.opened.queue, &bright).unwrap();
    let texture = gpu.texture(TextureFormat::Rgba32Float, [16, 8, 1]);
    gpu.bake(&decoder, &latents, &Bake::equirect(&texture));
    assert!(gpu.read_texture(&texture).as_flattened().iter().all(|v| v.is_finite() && *v > 1e38));
}

#[test]
fn rows_come_in_bands_and_in_order() {
    let Some(gpu) = util::plain() else { return };
    let model = filler(1, 8, 1);
    let decoder = GpuDecoder::new(&gpu.opened.device, &model).unwrap();
    let latent = latent(1, 1);
    let latents = decoder.condition(&gpu.opened.queue, &latent).unwrap();
    // 8192 × 520 takes three bands of 32 MiB: the buffer of the first is used again for the third
    let (width, height) = (8192u32, 520u32);
    let layout = BakeLayout { grid: Grid::Equirect { width, height }, frame: Default::default() };
    let field = model.decoder().unwrap().condition(&latent).unwrap();
    let grid = Equirect::new(width as usize, height as usize);
    let mut next = 0;
    bake_rows::<Error>(&decoder, &gpu.opened.queue, &latents, layout, |row, pixels| {
        assert_eq!(row, next);
        next += 1;
        if row % 100 == 7 || (254..258).contains(&row) || row >= 510 {
            for column in [0, 1777, 8191] {
                let expected = field.radiance(grid.direction(column, row));
                let off = difference(&[pixels[column].map(f32::ln)], &[expected.map(f32::ln)]);
                assert!(agrees(off), "row {row}, column {column}: {off:?}");
            }
        }
        Ok(())
    })
    .unwrap();
    assert_eq!(next, 520);
}

#[test]
fn rows_of_a_batch_are_those_of_its_first_latent() {
    let Some(gpu) = util::plain() else { return };
    let model = filler(4, 24, 2);
    let decoder = GpuDecoder::new(&gpu.opened.device, &model).unwrap();
    let latents = decoder.condition_batch(&gpu.opened.queue, &[latent(4, 1), latent(4, 2)]).unwrap();
    let layout = BakeLayout { grid: Grid::Equirect { width: 20, height: 10 }, frame: Default::default() };
    let mut found = Vec::new();
    bake_rows::<Error>(&decoder, &gpu.opened.queue, &latents, layout, |_, row| {
        found.extend(row.iter().map(|rgb| rgb.map(f32::ln)));
        Ok(())
    })
    .unwrap();
    let off = difference(&found, &cpu(&model, &latent(4, 1), Equirect::new(20, 10)));
    assert!(agrees(off), "{off:?}");
}

#[test]
fn grids_beyond_a_dispatch_are_split() {
    // with default limits uniforms lie 256 bytes apart, with the device's own less
    for gpu in [util::plain(), util::rich()].into_iter().flatten() {
        split(&gpu);
    }
}

fn split(gpu: &util::Gpu) {
    let model = filler(1, 8, 1);
    let decoder = GpuDecoder::new(&gpu.opened.device, &model).unwrap();
    let latents = decoder.condition(&gpu.opened.queue, &latent(1, 1)).unwrap();
    // the last rows of 16k × 8k: indices of directions beyond 2^27
    let pixels = gpu.pixels(16_384 * 70);
    let grid = Grid::Equirect { width: 16_384, height: 8_192 };
    gpu.bake(&decoder, &latents, &Bake::rows(&pixels, grid, 8_122..8_192).logarithm());
    let found = gpu.read(&pixels);
    let field = model.decoder().unwrap().condition(&latent(1, 1)).unwrap();
    let whole = Equirect::new(16_384, 8_192);
    for (column, row) in [(0, 8_122), (16_383, 8_190), (5, 8_191), (9_000, 8_185)] {
        let expected = field.log_radiance(whole.direction(column, row));
        let off = difference(&[found[(row - 8_122) * 16_384 + column]], &[expected]);
        assert!(agrees(off), "{column}, {row}: {off:?}");
    }
}
