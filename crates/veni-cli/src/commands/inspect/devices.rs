//! The graphics devices of this machine: what they are, allow and compute.

use anyhow::{Result, anyhow};
use serde_json::json;
use veni_gpu::adapters::Found;
use veni_gpu::probe;
use veni_gpu::wgpu::{DeviceType, Features};

use super::facts::Facts;
use crate::device::gpu::{self, NO_ADAPTER};
use crate::report::{self, Outcome, Report};

/// Largest difference of log radiance to the CPU at which a device's numbers are right: rounding gives a hundredth of
/// it, a mistake in a driver far more.
const TOLERANCE: f32 = 1e-3;

/// Prints all of them. The answer is no if there is none, or one of them cannot be used.
pub(super) fn run(report: Report) -> Result<Outcome> {
    let adapters = gpu::list();
    if adapters.is_empty() {
        report::error(&anyhow!("{NO_ADAPTER}; without one the CPU does everything"));
        return Ok(Outcome::Negative);
    }
    let mut outcome = Outcome::Fine;
    for found in &adapters {
        let name = gpu::name(found.info());
        report.note(format_args!("measuring {name}"));
        let mut facts = describe(found);
        match measure(found, &mut facts) {
            Ok(true) => {}
            Ok(false) => outcome = Outcome::Negative,
            Err(error) => {
                outcome = Outcome::Negative;
                facts.add("error", format!("cannot be used: {error}"), error.to_string());
            }
        }
        report.table(&facts.text(&name), &facts.json("device", &name))?;
    }
    Ok(outcome)
}

/// What is known without opening it.
fn describe(found: &Found) -> Facts {
    let (info, limits) = (found.info(), found.limits());
    let mut facts = Facts::new(kind(info.device_type));
    facts.add("backend", info.backend.to_str(), info.backend.to_str());
    let driver = format!("{} {}", info.driver, info.driver_info);
    facts.add("driver", driver.trim(), driver.trim());
    let size = |bytes: u64| format!("{bytes} bytes");
    let most = limits.max_storage_buffer_binding_size;
    facts.add("max_storage_buffer_binding_size", size(most), most);
    let most = limits.max_compute_workgroup_storage_size;
    facts.add("max_compute_workgroup_storage_size", size(most.into()), most);
    let most = limits.max_compute_invocations_per_workgroup;
    facts.add("max_compute_invocations_per_workgroup", most.to_string(), most);
    let most = limits.max_texture_dimension_2d;
    facts.add("max_texture_dimension_2d", most.to_string(), most);
    let useful = [(Features::SHADER_F16, "f16"), (Features::SUBGROUP, "subgroups")];
    let features: Vec<_> =
        useful.iter().filter(|(f, _)| found.useful_features().contains(*f)).map(|(_, name)| *name).collect();
    let text = if features.is_empty() { "none".to_owned() } else { features.join(", ") };
    facts.add("features used", text, json!(features));
    facts
}

/// Opens it, and adds what it computes and how fast. Gives whether its numbers are right.
fn measure(found: &Found, facts: &mut Facts) -> veni_gpu::Result<bool> {
    let opened = pollster::block_on(found.open())?;
    let rate = probe::multiply_add_rate(&opened.device, &opened.queue)? / 1e9;
    facts.add("multiply-adds", format!("{rate:.1} GFLOP/s in single precision"), json!({ "gflops": rate }));
    let error = probe::largest_error(&opened.device, &opened.queue)?;
    // a NaN is wrong
    let right = error <= TOLERANCE;
    let verdict = if right { "right" } else { "WRONG" };
    facts.add(
        "numbers",
        format!("{verdict}: log radiance differs from the CPU's by at most {error:.1e}"),
        json!({ "right": right, "largest_error": error }),
    );
    Ok(right)
}

fn kind(device: DeviceType) -> &'static str {
    match device {
        DeviceType::DiscreteGpu => "graphics card",
        DeviceType::IntegratedGpu => "integrated graphics",
        DeviceType::VirtualGpu => "virtual graphics",
        DeviceType::Cpu => "software",
        DeviceType::Other => "other",
    }
}
