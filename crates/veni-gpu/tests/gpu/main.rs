//! The GPU decoder against the CPU, on whatever adapter there is: a graphics card, or Mesa's lavapipe.
//!
//! Without an adapter the tests fail, unless `VENI_SKIP_GPU=1` says that this is known; then each says that it was
//! skipped. Every cross-check comes with deliberate breaks that it catches ([`breaks`]).

mod bakes;
mod breaks;
mod compact;
mod cross_check;
mod errors;
mod kernels;
mod light;
#[cfg(unix)]
mod memory;
mod naga;
mod prefilter;
mod prefilter_by_hand;
mod prefilter_lights;
mod repetition;
mod stages;
mod util;
