//! The shaders as text, with everything a host needs to run them by any API. No wgpu types.
//!
//! The ways in:
//!
//! - **A function** to paste or import: [`field`] gives WGSL with `fn veni_radiance(direction: vec3f) -> vec3f`,
//!   `fn veni_log_radiance` (lobes included, lights not) and `fn veni_lights` (the lights alone), and no bindings inside. The host declares the three read-only storage buffers that
//!   [`field_bindings`] spells, and fills them with [`pack_model`] and [`pack_latent`]. [`field_module`] is the same
//!   as a naga_oil module.
//! - **A compute kernel**: [`Variant::source`] gives the module whose entry point [`ENTRY_POINT`] writes a panorama, cube
//!   faces or a buffer of radiances; [`Variant::bindings`] its group 0, [`Request`] its uniform, [`pack_gains`] what the
//!   lights add to pixels, [`Variant::dispatches`] its dispatches.
//!
//! - **A light to sample**: [`light`] gives `veni_sample_light`, `veni_light_pdf`, `veni_sun` and `veni_irradiance` over the
//!   buffers that [`pack_light`] fills and [`light_bindings`] declares.
//! - **Harmonics and levels**: [`spectrum_source`] and [`level_source`] are kernels over the tables of [`SpectrumTables`] and the
//!   uniform [`Level`]; lights come into them by [`pack_light_harmonics`] and [`Glints`].
//!
//! `twin` evaluates the same stages under the same names on the CPU in double precision, for comparing stage by
//! stage.

mod gains;
mod glints;
mod level;
mod light_pack;
mod light_text;
mod light_uniform;
mod pack;
mod request;
mod sizes;
mod spectrum;
mod text;
pub mod twin;
mod variant;

pub use gains::pack_gains;
pub use glints::{Glints, pack_light_harmonics};
pub use level::Level;
pub use light_pack::{LightDensity, PackedLight, pack_light};
pub use light_text::{light, light_bindings, light_module};
pub use light_uniform::{LightUniform, MAX_LIGHTS, PackedDisc};
pub use pack::{MatrixWords, PackedModel, pack_latent, pack_model};
pub use request::{Grid, Request};
pub use sizes::{MAX_LOBES, Sizes};
pub use spectrum::{
    LEVEL_ENTRY_POINT, MAX_DEGREE, SPECTRUM_ENTRY_POINTS, SpectrumTables, level_source, spectrum_source,
};
pub use text::{field, field_bindings, field_module, probe_source};
pub use variant::{Binding, Directions, Kernel, MAX_GROUPS, StorageFormat, Store, Variant, WeightPrecision};

/// Name of the entry point of every kernel.
pub const ENTRY_POINT: &str = "veni_bake";
