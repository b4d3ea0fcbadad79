//! Nothing grows, and the API's validation has nothing to say.

use std::sync::Mutex;

use veni_gpu::adapters::Opened;
use veni_gpu::decoder::KernelChoice;
use veni_gpu::shader::Grid;
use veni_gpu::wgpu::{self, TextureFormat};
use veni_gpu::{Bake, GpuDecoder};

use crate::util::{self, Gpu, directions, filler, latent, say};

/// An instance of the test's own, whose books can be read.
fn instance(flags: wgpu::InstanceFlags) -> (wgpu::Instance, Gpu) {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    descriptor.flags = flags;
    let instance = wgpu::Instance::new(descriptor);
    let adapter = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all())).remove(0);
    let (device, queue) = pollster::block_on(adapter.request_device(&Default::default())).unwrap();
    (instance, Gpu { opened: Opened { device, queue, info: adapter.get_info() } })
}

/// What is alive, as wgpu counts it. Resident memory would measure the driver: lavapipe of Mesa 22.3 loses 60 kB with
/// every dispatch of an empty kernel.
#[test]
fn a_thousand_bakes_leave_nothing_behind() {
    let Some(_) = util::adapter() else { return };
    let (instance, gpu) = instance(wgpu::InstanceFlags::empty());
    let (device, queue) = (&gpu.opened.device, &gpu.opened.queue);
    let model = filler(2, 16, 1);
    let decoder = GpuDecoder::with_kernel(device, &model, KernelChoice::PlainEach).unwrap();
    let latents = decoder.condition(queue, &latent(2, 1)).unwrap();
    let texture = gpu.texture(TextureFormat::Rgba16Float, [16, 8, 1]);
    let pixels = gpu.pixels(128);
    let grid = Grid::Equirect { width: 16, height: 8 };
    let alive = |bakes: u64| {
        for i in 0..bakes {
            decoder.update(queue, &latents, 0, &[latent(2, i)]).unwrap();
            let target = if i % 2 == 0 { Bake::equirect(&texture) } else { Bake::rows(&pixels, grid, 0..8) };
            gpu.bake(&decoder, &latents, &target);
            device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
        }
        format!("{:?}", instance.generate_report().expect("a native instance keeps books").hub)
    };
    let early = alive(20);
    assert_eq!(early, alive(1000));
    // the books do show what is kept
    let kept = gpu.pixels(1);
    assert_ne!(early, alive(1));
    drop(kept);
}

/// What the API's validation layer says, and whether it was there at all.
struct Complaints(Mutex<Vec<String>>);

static COMPLAINTS: Complaints = Complaints(Mutex::new(Vec::new()));

impl log::Log for Complaints {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn && metadata.target().starts_with("wgpu_hal")
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata())
            && let Ok(mut all) = self.0.lock()
        {
            all.push(record.args().to_string());
        }
    }

    fn flush(&self) {}
}

#[test]
fn the_validation_layer_is_silent() {
    let Some(_) = util::adapter() else { return };
    log::set_logger(&COMPLAINTS).unwrap();
    log::set_max_level(log::LevelFilter::Warn);
    // without debug information: its mark for WGSL is unknown to layers of 2023
    let (_instance, gpu) = instance(wgpu::InstanceFlags::VALIDATION);
    let decoder = GpuDecoder::new(&gpu.opened.device, &filler(2, 16, 1)).unwrap();
    let latents = decoder.condition_batch(&gpu.opened.queue, &[latent(2, 1), latent(2, 2)]).unwrap();
    let texture = gpu.texture(TextureFormat::Rgba16Float, [16, 8, 2]);
    let cube = gpu.texture(TextureFormat::Rgba32Float, [8, 8, 12]);
    let list = gpu.upload(&directions(50));
    let radiance = gpu.pixels(100);
    for bake in [Bake::equirect(&texture), Bake::cube(&cube), Bake::directions(&list, &radiance, 50)] {
        gpu.bake(&decoder, &latents, &bake);
    }
    gpu.read_texture(&texture);
    gpu.read(&radiance);
    drop((decoder, latents, gpu));
    let all = COMPLAINTS.0.lock().unwrap();
    if all.iter().any(|m| m.contains("unable to find layer")) {
        say("no validation layer: only wgpu's own validation was silent (package vulkan-validationlayers)");
    } else {
        say("the validation layer was on");
    }
    let complaints: Vec<_> = all.iter().filter(|m| m.contains("VALIDATION [")).collect();
    assert!(complaints.is_empty(), "{complaints:#?}");
}
