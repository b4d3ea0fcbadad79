//! Cases that are computed in double precision.
//!
//! Adam divides by the root of the second moment, so an entry whose gradient is near zero moves by the full
//! learning rate in a direction that rounding decides; and a latent fit with large steps is chaotic. The files'
//! `f32_err` is one run's luck with that. In f64 the same code either computes the same thing or does not.
//!
//! The float type of a device is a setting of the whole process, so each such case has a process of its own:
//! this test program again, asked for [`one_case_in_double_precision`] with the case named by environment.

use crate::case::Case;
use crate::report::{Verdict, run_case};
use burn::tensor::{Device, FloatDType};
use std::path::Path;
use std::process::Command;

const CASE: &str = "VENI_GOLDEN_DOUBLE_CASE";
const DEVICE: &str = "VENI_GOLDEN_DOUBLE_DEVICE";
const MARK: &str = "verdict in double precision: ";

/// Whether this process computes in f64.
pub(crate) fn active() -> bool {
    std::env::var_os(CASE).is_some()
}

/// The verdict of a process that computes the case in f64 on the same device.
pub(crate) fn elsewhere(case: &Case, device: &Device) -> Verdict {
    let name = if *device == Device::flex().autodiff() { "flex" } else { "ndarray" };
    let program = std::env::current_exe().expect("the path of this program");
    let output = Command::new(program)
        .args([
            "double::one_case_in_double_precision",
            "--exact",
            "--ignored",
            "--nocapture",
            "--test-threads=1",
        ])
        .env(CASE, case.path())
        .env(DEVICE, name)
        .output()
        .expect("this program starts again");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let verdict = text.lines().find_map(|line| line.split_once(MARK)).map(|(_, verdict)| verdict);
    match verdict.and_then(|v| serde_json::from_str::<(Vec<(f64, String)>, Vec<String>)>(v).ok()) {
        Some((ratios, failures)) if failures.is_empty() => Verdict::Passed(ratios),
        Some((_, failures)) => Verdict::Failed(failures),
        None => Verdict::Failed(vec![format!("no verdict from the f64 process: {text}")]),
    }
}

#[test]
#[ignore = "started by the golden run, for one case"]
fn one_case_in_double_precision() {
    let path = std::env::var_os(CASE).expect("the case to compute");
    let mut device = match std::env::var(DEVICE).as_deref() {
        #[cfg(feature = "ndarray")]
        #[allow(deprecated, reason = "kept and tested while burn ships it")]
        Ok("ndarray") => Device::ndarray(),
        _ => Device::flex(),
    };
    device.configure(FloatDType::F64).expect("the device computes in f64");
    let case = Case::load(Path::new(&path)).expect("a readable case");
    let verdict = match run_case(&case, &device.autodiff()) {
        Verdict::Passed(ratios) => (ratios, Vec::new()),
        Verdict::Failed(failures) => (Vec::new(), failures),
        Verdict::Skipped(reason) => (Vec::new(), vec![format!("skipped in f64: {reason}")]),
    };
    let verdict = serde_json::to_string(&verdict).expect("numbers and text");
    // the harness reads it from the output of this process
    #[allow(clippy::print_stdout, reason = "the answer of this process")]
    {
        println!("\n{MARK}{verdict}");
    }
}
