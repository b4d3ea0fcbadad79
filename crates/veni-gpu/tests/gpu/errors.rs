//! What does not fit is refused by name, and the host's device goes on.

use veni_gpu::read_back::{self, BakeLayout, bake_rows};
use veni_gpu::shader::Grid;
use veni_gpu::wgpu::{BufferUsages, TextureFormat, TextureUsages};
use veni_gpu::{Bake, Error, GpuDecoder};
use veni_light::latent::{Latent, Lobe};
use veni_light::light::{CompactLight, Lights};
use veni_light::sphere::{Equirect, Frame};

use crate::util::{self, agrees, difference, filler, latent};

#[test]
fn what_does_not_fit_is_named() {
    let Some(gpu) = util::plain() else { return };
    let (device, queue) = (&gpu.opened.device, &gpu.opened.queue);
    // an error that reaches the host's handler instead of coming back fails the test
    device.on_uncaptured_error(std::sync::Arc::new(|e| panic!("the host's handler saw {e}")));
    let model = filler(4, 24, 2);
    let decoder = GpuDecoder::new(device, &model).unwrap();
    let latents = decoder.condition(queue, &latent(4, 1)).unwrap();
    let mut encoder = device.create_command_encoder(&Default::default());
    let mut refused = |decoder: &GpuDecoder, bake: &Bake<'_>, words: &[&str]| {
        let message = decoder.bake(&mut encoder, &latents, bake).unwrap_err().to_string();
        for word in words {
            assert!(message.contains(word), "`{message}` does not say `{word}`");
        }
    };
    let eight_bit = gpu.texture(TextureFormat::Rgba8Unorm, [8, 4, 1]);
    refused(&decoder, &Bake::equirect(&eight_bit), &["Rgba8Unorm", "Rgba16Float"]);
    let unusable = gpu.texture_with(TextureFormat::Rgba32Float, [8, 4, 1], TextureUsages::TEXTURE_BINDING);
    refused(&decoder, &Bake::equirect(&unusable), &["STORAGE_BINDING"]);
    let flat = gpu.texture(TextureFormat::Rgba32Float, [8, 8, 1]);
    refused(&decoder, &Bake::cube(&flat), &["1 layers", "6"]);
    let oblong = gpu.texture(TextureFormat::Rgba32Float, [8, 4, 6]);
    refused(&decoder, &Bake::cube(&oblong), &["8 × 4", "square"]);
    let small = gpu.pixels(8);
    let grid = Grid::Equirect { width: 8, height: 4 };
    refused(&decoder, &Bake::rows(&small, grid, 0..2), &["128 bytes", "256"]);
    refused(&decoder, &Bake::rows(&small, grid, 4..5), &["rows"]);
    let unstored = gpu.buffer(1024, BufferUsages::COPY_DST);
    refused(&decoder, &Bake::directions(&unstored, &small, 2), &["direction buffer", "STORAGE"]);
    refused(&decoder, &Bake::rows(&small, grid, 0..1).rotate(f64::NAN), &["NaN"]);
    refused(&decoder, &Bake::directions(&small, &small, 8), &["same buffer"]);
    let other = GpuDecoder::new(device, &filler(4, 16, 1)).unwrap();
    refused(&other, &Bake::rows(&small, grid, 0..1), &["model"]);

    let message = |latent: &Latent| match decoder.condition(queue, latent) {
        Err(Error::Light(e)) => e.to_string(),
        other => panic!("{other:?}"),
    };
    assert!(message(&latent(5, 1)).contains("5 vectors"));
    let mut poisoned = latent(4, 1);
    poisoned.vectors[2][1] = f32::NAN;
    assert!(message(&poisoned).contains("vector 2"));
    // what there is no room for is not left out without a word
    let sun = CompactLight::new([0.0, 0.0, 1.0], [1.0; 3], CompactLight::SUN_RADIUS);
    let lit = |count| Latent { lights: Lights::new(None, vec![sun; count]), ..latent(4, 1) };
    assert!(message(&lit(9)).contains("9 lights: the shaders have room for 8"));
    let lobe = Lobe { direction: [0.0, 0.0, 1.0], amplitude: [1.0; 3], sharpness: 4.0 };
    let detailed = |count| Latent { lobes: vec![lobe; count], ..latent(4, 1) };
    assert!(message(&detailed(65)).contains("65 lobes: the shaders have room for 64"));
    decoder.condition_batch(queue, &[lit(8), detailed(16)]).unwrap();
    assert!(decoder.condition_batch(queue, &[]).unwrap_err().to_string().contains("0 latents"));
    let two = [latent(4, 1), latent(4, 2)];
    assert!(decoder.update(queue, &latents, 0, &two).unwrap_err().to_string().contains("do not fit"));

    for grid in [
        Grid::Equirect { width: 0, height: 4 },
        Grid::Equirect { width: 8, height: 0 },
        Grid::Cube { size: u32::MAX },
        Grid::List { count: 8 },
    ] {
        let layout = BakeLayout { grid, frame: Frame::default() };
        let refused = bake_rows::<Error>(&decoder, queue, &latents, layout, |_, _| Ok(())).unwrap_err();
        assert!(matches!(refused, Error::Invalid(_)), "{grid:?}: {refused:?}");
    }
    for size in [0, 20] {
        let odd = gpu.buffer(size, BufferUsages::COPY_SRC);
        let refused = read_back::buffer(device, queue, &odd).unwrap_err();
        assert!(refused.to_string().contains(&format!("{size} bytes")), "{refused}");
    }
    let unread = gpu.buffer(32, BufferUsages::STORAGE);
    assert!(matches!(read_back::buffer(device, queue, &unread).unwrap_err(), Error::Gpu { .. }));

    // and everything still works
    queue.submit([encoder.finish()]);
    let found = gpu.log_radiance(&decoder, &latent(4, 1), grid);
    let mut expected = vec![[0.0; 3]; 32];
    let field = model.decoder().unwrap().condition(&latent(4, 1)).unwrap();
    field.log_radiance_batch(&Equirect::new(8, 4).directions(), &mut expected);
    assert!(agrees(difference(&found, &expected)));
}

#[test]
fn bindings_beyond_the_devices_are_refused() {
    let Some(gpu) = util::plain() else { return };
    let device = &gpu.opened.device;
    let decoder = GpuDecoder::new(device, &filler(1, 8, 1)).unwrap();
    let latents = decoder.condition(&gpu.opened.queue, &latent(1, 1)).unwrap();
    // 129 MiB: a device with default limits makes such a buffer, but binds 128 MiB
    let large = gpu.buffer(129 << 20, BufferUsages::STORAGE);
    let mut encoder = device.create_command_encoder(&Default::default());
    let grid = Grid::Equirect { width: 64, height: 32 };
    let bake = Bake::rows(&large, grid, 0..32);
    let message = decoder.bake(&mut encoder, &latents, &bake).unwrap_err().to_string();
    assert!(
        message.contains("max_storage_buffer_binding_size") && message.contains("135266304"),
        "{message}"
    );
}

#[test]
fn a_lost_device_is_an_error() {
    let Some(gpu) = util::plain() else { return };
    let (device, queue) = (&gpu.opened.device, &gpu.opened.queue);
    let model = filler(1, 8, 1);
    let decoder = GpuDecoder::new(device, &model).unwrap();
    let latents = decoder.condition(queue, &latent(1, 1)).unwrap();
    let pixels = gpu.pixels(32);
    let mut encoder = device.create_command_encoder(&Default::default());
    device.destroy();
    let grid = Grid::Equirect { width: 8, height: 4 };
    let error = decoder.bake(&mut encoder, &latents, &Bake::rows(&pixels, grid, 0..4)).unwrap_err();
    assert!(matches!(error, Error::Gpu { .. }), "{error:?}");
    assert!(matches!(GpuDecoder::new(device, &model).unwrap_err(), Error::Gpu { .. }));
}
