//! What a device can do: its rate of multiply-adds, and whether it computes the decoder's numbers at all.

use std::time::{Duration, Instant};

use veni_light::latent::{Latent, Prior};
use veni_light::model::{Model, ModelConfig};
use veni_light::sphere::Equirect;
use wgpu::{BufferDescriptor, BufferUsages, ComputePipelineDescriptor, Device, PollType, Queue};

use crate::decoder::{Bake, GpuDecoder};
use crate::error::{Error, Result};
use crate::read_back;
use crate::scope::guarded;
use crate::shader::probe_source;

/// Invocations of the rate probe: enough to fill any card.
const INVOCATIONS: u32 = 64 * 8192;
/// Floating-point operations per invocation and round: 64 vec4 multiply-adds.
const OPERATIONS: f64 = 64.0 * 4.0 * 2.0;
/// A measurement lasts at least so long.
const LONG_ENOUGH: Duration = Duration::from_millis(60);

/// The device's rate of f32 multiply-adds outside memory, in floating-point operations per second (a fused
/// multiply-add counts two). Takes about a quarter of a second; submits and waits.
///
/// # Errors
/// [`Error::Gpu`] if the device fails.
pub fn multiply_add_rate(device: &Device, queue: &Queue) -> Result<f64> {
    let pipeline = guarded(device, "rate probe", || {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("veni probe"),
            source: wgpu::ShaderSource::Wgsl(probe_source().into()),
        });
        device.create_compute_pipeline(&ComputePipelineDescriptor {
            label: Some("veni probe"),
            layout: None,
            module: &module,
            entry_point: Some("veni_probe"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    })?;
    let buffer = |size: u64, usage: BufferUsages| {
        let descriptor =
            BufferDescriptor { label: Some("veni probe"), size, usage, mapped_at_creation: false };
        guarded(device, "rate probe", || device.create_buffer(&descriptor))
    };
    let results = buffer(16 * u64::from(INVOCATIONS), BufferUsages::STORAGE)?;
    let rounds = buffer(16, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?;
    let group = guarded(device, "rate probe", || {
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("veni probe"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: results.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: rounds.as_entire_binding() },
            ],
        })
    })?;
    let timed = |count: u32, workgroups: u32| -> Result<Duration> {
        let started = guarded(device, "rate probe", || {
            queue.write_buffer(&rounds, 0, bytemuck::cast_slice(&[count, 0, 0, 0]));
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(workgroups, 1, 1);
            drop(pass);
            let started = Instant::now();
            queue.submit([encoder.finish()]);
            started
        })?;
        device.poll(PollType::wait_indefinitely()).map_err(|e| Error::gpu("rate probe", e))?;
        Ok(started.elapsed())
    };
    // software adapters take long for few rounds: begin with a small part of the invocations
    let (mut rounds, mut workgroups) = (16, 128);
    timed(1, workgroups)?;
    loop {
        let time = timed(rounds, workgroups)?;
        if time >= LONG_ENOUGH || rounds > 1 << 20 {
            let best = time.min(timed(rounds, workgroups)?).min(timed(rounds, workgroups)?);
            let operations = OPERATIONS * f64::from(rounds) * f64::from(64 * workgroups);
            return Ok(operations / best.as_secs_f64());
        }
        if workgroups < INVOCATIONS / 64 {
            workgroups *= 4;
        } else {
            rounds *= 4;
        }
        workgroups = workgroups.min(INVOCATIONS / 64);
    }
}

/// Bakes a small panorama of a model made by formula and compares it with the CPU: the largest difference of log
/// radiance. Below 1e-3 the device computes the right numbers. Submits and waits.
///
/// # Errors
/// [`Error::Gpu`] if the device fails.
pub fn largest_error(device: &Device, queue: &Queue) -> Result<f32> {
    let model = Model::filler(&ModelConfig::decode_only(9), 1)?;
    let latent = Latent::from_seed(&Prior::standard(9), 1);
    let grid = Equirect::new(32, 16);
    let mut expected = vec![[0.0; 3]; grid.len()];
    model.decoder()?.condition(&latent)?.log_radiance_batch(&grid.directions(), &mut expected);
    let decoder = GpuDecoder::new(device, &model)?;
    let latents = decoder.condition(queue, &latent)?;
    let pixels = guarded(device, "probe", || {
        device.create_buffer(&BufferDescriptor {
            label: Some("veni probe"),
            size: 16 * grid.len() as u64,
            usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        })
    })?;
    let mut encoder = guarded(device, "probe", || {
        device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    })?;
    let whole = crate::shader::Grid::Equirect { width: grid.width as u32, height: grid.height as u32 };
    let bake = Bake::rows(&pixels, whole, 0..grid.height as u32).logarithm();
    decoder.bake(&mut encoder, &latents, &bake)?;
    guarded(device, "probe", || queue.submit([encoder.finish()]))?;
    let found = read_back::buffer(device, queue, &pixels)?;
    let differences = found.as_flattened().iter().zip(expected.as_flattened()).map(|(a, b)| (a - b).abs());
    // a NaN must not pass for a small number: it counts as infinitely wrong
    Ok(differences.fold(0.0, |worst, d| if d.is_nan() { f32::INFINITY } else { d.max(worst) }))
}
