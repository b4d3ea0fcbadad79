//! The VENI decoder on the GPU.
