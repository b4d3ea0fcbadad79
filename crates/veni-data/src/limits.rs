//! Limits of what is read, each with its reason. They are checked before anything of the size in question is allocated.
#![cfg_attr(not(feature = "onnx"), allow(dead_code, reason = "networks are read with the feature onnx"))]

/// Bytes of an ONNX file: Protocol Buffers, and so ONNX files, are no larger.
pub const MAX_ONNX_BYTES: u64 = 1 << 31;

/// Operators of a network, those of graphs within it too. Image networks have hundreds, language models ten thousand.
pub const MAX_ONNX_NODES: usize = 1 << 16;

/// Graphs within graphs, types within types: branches lie one or two deep; each level is one call of a function.
pub const MAX_ONNX_NESTING: usize = 16;

/// Values of one constant, or of what a constant asks an operator to make: 2²⁹ floats are the 2 GiB of the largest file.
pub const MAX_ONNX_CONSTANT: u64 = 1 << 29;

/// Strides and dilations. Networks use up to 32; an output grows by the square.
pub const MAX_ONNX_STRIDE: u64 = 64;

/// Padding and sides of a kernel, in pixels. Networks use up to a hundred.
pub const MAX_ONNX_PADDING: u64 = 1024;

/// Pixels that a network of fixed size is tried on: 8,192 × 4,096, larger than any that runs on a workstation.
pub const MAX_ONNX_PIXELS: u64 = 1 << 25;

/// Seconds that the runtime may take to load a network, whose weights it packs and whose constant parts it computes: the
/// largest take some ten.
pub const MAX_ONNX_SECONDS: u64 = 120;
