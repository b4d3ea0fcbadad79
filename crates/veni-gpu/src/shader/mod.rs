//! The shaders as text, with everything a host needs to run them by any API. No wgpu types.
//!
//! Two ways in:
//!
//! - **A function** to paste or import: [`field`] gives WGSL with `fn veni_log_radiance(direction: vec3f) -> vec3f` and
//!   `fn veni_radiance`, and no bindings inside. The host declares the three read-only storage buffers that
//!   [`field_bindings`] spells, and fills them with [`pack_model`] and [`pack_latent`]. [`field_module`] is the same
//!   as a naga_oil module.
//! - **A compute kernel**: [`Variant::source`] gives the module whose entry point [`ENTRY_POINT`] writes a panorama, cube
//!   faces or a buffer of radiances; [`Variant::bindings`] its group 0, [`Request`] its uniform,
//!   [`Variant::dispatches`] its dispatches.
//!
//! `twin` evaluates the same stages under the same names on the CPU in double precision, for comparing stage by
//! stage.

mod pack;
mod request;
mod sizes;
mod text;
pub mod twin;
mod variant;

pub use pack::{MatrixWords, PackedModel, pack_latent, pack_model};
pub use request::{Grid, Request};
pub use sizes::Sizes;
pub use text::{field, field_bindings, field_module, probe_source};
pub use variant::{Binding, Directions, Kernel, MAX_GROUPS, Store, TexelFormat, Variant, Weights};

/// Name of the entry point of every kernel.
pub const ENTRY_POINT: &str = "veni_bake";
