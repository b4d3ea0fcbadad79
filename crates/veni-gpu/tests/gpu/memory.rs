//! Running out of memory, for real: a process of its own with little address space, in which a driver that computes on
//! the CPU is refused memory as a graphics card's driver is when the card is full.

use std::process::Command;

use veni_gpu::shader::Grid;
use veni_gpu::wgpu::{Buffer, BufferDescriptor, BufferUsages, Device, ErrorFilter};
use veni_gpu::{Bake, Error, GpuDecoder, read_back};

use crate::util::{self, filler, latent};

/// Set in the process that has little memory.
const INSIDE: &str = "VENI_TEST_LITTLE_MEMORY";
/// Address space of that process, KiB.
const ADDRESS_SPACE: u64 = 6 << 20;
const BLOCK: u64 = 64 << 20;

#[test]
fn out_of_memory_is_an_error_and_the_device_goes_on() {
    if std::env::var_os(INSIDE).is_some() {
        return fill_up();
    }
    let Some(found) = util::adapter() else { return };
    if !found.is_software() {
        util::say("a limit on address space does not limit a graphics card: out of memory not tested");
        return;
    }
    let name = "memory::out_of_memory_is_an_error_and_the_device_goes_on";
    let output = Command::new("sh")
        .args(["-c", &format!("ulimit -v {ADDRESS_SPACE} && exec \"$0\" --exact {name} --nocapture")])
        .arg(std::env::current_exe().unwrap())
        .env(INSIDE, "1")
        .output()
        .unwrap();
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success() && out.contains("1 passed"), "{}\n{out}\n{err}", output.status);
    assert!(err.contains("refused after"), "memory did not run out:\n{err}");
}

/// One more buffer of the host's, or nothing when memory is out.
fn block(device: &Device) -> Option<Buffer> {
    let scope = device.push_error_scope(ErrorFilter::OutOfMemory);
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
    let descriptor =
        BufferDescriptor { label: Some("filling"), size: BLOCK, usage, mapped_at_creation: false };
    let buffer = device.create_buffer(&descriptor);
    pollster::block_on(scope.pop()).is_none().then_some(buffer)
}

fn fill_up() {
    let gpu = util::plain().unwrap();
    let (device, queue) = (&gpu.opened.device, &gpu.opened.queue);
    device.on_uncaptured_error(std::sync::Arc::new(|e| panic!("the host's handler saw {e}")));
    let decoder = GpuDecoder::new(device, &filler(4, 24, 2)).unwrap();
    let grid = Grid::Equirect { width: 16, height: 8 };
    let before = gpu.log_radiance(&decoder, &latent(4, 1), grid);

    let mut blocks: Vec<_> = std::iter::from_fn(|| block(device)).take(4096).collect();
    assert!(blocks.len() < 4096, "256 GiB and no end");
    util::say(&format!("refused after {} blocks", blocks.len()));
    // as large as what has just been refused
    let error = read_back::buffer(device, queue, &blocks[0]).unwrap_err();
    let Error::Gpu { what, cause } = &error else { panic!("{error:?}") };
    assert!(what == "veni read back" && cause.to_string().to_lowercase().contains("memory"), "{error}");
    assert!(std::error::Error::source(&error).is_some_and(|e| e.is::<veni_gpu::wgpu::Error>()), "{error:?}");

    blocks.truncate(blocks.len() / 2);
    device.poll(veni_gpu::wgpu::PollType::wait_indefinitely()).unwrap();
    let latents = decoder.condition(queue, &latent(4, 1)).unwrap();
    let pixels = gpu.pixels(128);
    gpu.bake(&decoder, &latents, &Bake::rows(&pixels, grid, 0..8).logarithm());
    assert_eq!(gpu.read(&pixels), before);
    assert_eq!(read_back::buffer(device, queue, &blocks[0]).unwrap().len() as u64, BLOCK / 16);
}
