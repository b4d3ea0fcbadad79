//! The VENI decoder on the GPU.
//!
//! Nothing yet: the crate holds its place in the workspace, and the rule that it may know the lighting world of
//! `veni-core` only. Until the WGSL stages stand, bake on the CPU (`veni_core::field`) and upload the panorama.
