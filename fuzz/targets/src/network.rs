//! Networks in ONNX files.

use std::path::Path;

use veni_data::expand::network::OnnxNetwork;

use super::{Target, untouched};

#[path = "../../../crates/veni-data/src/expand/network/onnx_file.rs"]
#[allow(dead_code, reason = "veni-data's tests use the rest of it")]
mod onnx_file;

use onnx_file::OnnxFile;

pub(super) const TARGETS: &[Target] =
    &[Target { name: "onnx", run: network, seeds: networks, repair: untouched }];

/// Loading runs the network once.
fn network(path: &Path) -> bool {
    OnnxNetwork::load(path).is_ok()
}

fn networks() -> Vec<Vec<u8>> {
    let mut kernel = vec![0.0; 27];
    (0..3).for_each(|c| kernel[c * 9 + c * 3..][..3].copy_from_slice(&[2.0, 0.0, 2.0]));
    let conv = OnnxFile::image([8, 16]).constant("kernel", &[3, 3, 1, 3], &kernel).node(
        "Conv",
        &["x", "kernel"],
        "y",
        &[("kernel_shape", &[1, 3]), ("strides", &[1, 1]), ("pads", &[0, 1, 0, 1])],
    );
    vec![OnnxFile::times(4.0, [8, 16]).bytes(), conv.bytes()]
}
