//! How long a network takes to expand an LDR panorama, and how much memory.
//!
//! ```text
//! cargo run --release -p veni-research --features onnx --example expand_network -- [CHANNELS [LAYERS]]
//! ```
//! The network is made here, of random weights: LAYERS convolutions of 3 × 3 with CHANNELS channels between a first and a
//! last one (32 and 4 unless given), and a softplus. It sees the panorama at its own 1024 × 512 (and what is beyond its
//! edges).

#![expect(clippy::print_stdout, reason = "an example that prints numbers")]

#[allow(dead_code, reason = "the tests use the rest of it")]
#[path = "../../../crates/veni-data/src/expand/network/onnx_file.rs"]
mod onnx_file;

use std::time::Instant;
use veni_core::random::Stream;

use onnx_file::OnnxFile;
use veni_core::expand::Expand;
use veni_core::expand::ExpandOptions;
use veni_core::expand::network::{NetworkOptions, OnnxNetwork};
use veni_core::panorama::{LdrPanorama, TransferFunction};
use veni_core::sphere::Equirect;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let mut args = std::env::args().skip(1);
    let mut number = |default| args.next().map_or(Ok(default), |a| a.parse::<u64>());
    let (channels, layers) = (number(32)?, number(4)?);
    let folder = std::env::temp_dir().join(format!("expand_network_{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let path = folder.join("network.onnx");
    std::fs::write(&path, network(channels, layers)?)?;
    let loaded = OnnxNetwork::load(&path);
    std::fs::remove_dir_all(&folder)?;
    let loaded = loaded?;

    let ldr = sky(Equirect::new(1024, 512));
    let base = peak();
    println!("{layers} layers of {channels} channels; 1024 × 512; {base} MB before");
    for _ in 0..3 {
        let start = Instant::now();
        let done = ldr.expand_by(&loaded, &NetworkOptions::default())?;
        let seconds = start.elapsed().as_secs_f64();
        println!("network: {seconds:.2} s, peak {} MB, {:.1} % clipped", peak(), 100.0 * done.clipped);
    }
    let start = Instant::now();
    let done = ldr.expand(&ExpandOptions { transfer: TransferFunction::Srgb, ..Default::default() });
    println!("fitted functions: {:.2} s, {} regions", start.elapsed().as_secs_f64(), done.regions);
    Ok(())
}

/// A bright spot in a gradient.
fn sky(grid: Equirect) -> LdrPanorama {
    let values = grid.directions().into_iter().map(|[x, y, z]| {
        let v = 0.5 + 0.3 * z + 0.6 * (0.6 * x + 0.5 * y + 0.62 * z).max(0.0).powi(8);
        [v, v, v + 0.1]
    });
    LdrPanorama::new(grid, values.collect())
}

fn network(channels: u64, layers: u64) -> Result<Vec<u8>, Failure> {
    let mut rng = Stream::from_seed(1);
    let mut file = OnnxFile::image([0, 0]);
    let mut from = "x".to_owned();
    for layer in 0..layers + 2 {
        let inputs = if layer == 0 { 3 } else { channels };
        let outputs = if layer == layers + 1 { 3 } else { channels };
        let deviation = (2.0 / (9.0 * inputs as f32)).sqrt();
        let values: Vec<f32> = (0..outputs * inputs * 9).map(|_| deviation * rng.normal() as f32).collect();
        let (weight, sum, out) = (format!("w{layer}"), format!("s{layer}"), format!("a{layer}"));
        let last = layer == layers + 1;
        let ints: [(&str, &[u64]); 3] =
            [("kernel_shape", &[3, 3]), ("strides", &[1, 1]), ("pads", &[1, 1, 1, 1])];
        file = file.constant(&weight, &[outputs, inputs, 3, 3], &values);
        file = file.node("Conv", &[&from, &weight], &sum, &ints);
        file = file.node(if last { "Softplus" } else { "Relu" }, &[&sum], if last { "y" } else { &out }, &[]);
        from = out;
    }
    Ok(file.bytes())
}

/// The most memory that this process has had so far, MB; 0 where the system does not say.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok()).unwrap_or(0) / 1024
}
