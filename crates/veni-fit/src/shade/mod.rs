//! Shading: what a surface of known shape and material looks like under distant light, and how that changes with
//! the light.
//!
//! Light is a finite set of [`DistantLights`] at infinity (the pixels of a panorama, with their solid angles). Without shadows
//! and interreflections, the radiance that leaves a pixel's surface towards the camera is linear in their radiance:
//!
//! > R_c = Σ_l f_c(n, v, l) max(n·l, 0) ω_l L_{l,c}
//!
//! So a [`Transfer`] knows everything but L: it renders, and takes gradients back. A [`RenderedImage`] compares the
//! result with a photograph and gives the gradient of a loss with respect to log radiance and exposure, which is all
//! that a fit of a latent to a rendered image needs.
//!
//! | here | what |
//! |---|---|
//! | [`DistantLights`] | directions and solid angles: equirectangular, icosahedral |
//! | [`Material`] | Lambert, Blinn-Phong |
//! | [`Camera`], [`Surface`], [`Mesh`] | rays; normals of a sphere, a triangle mesh |
//! | [`NormalMap`], [`read_mask`], [`read_albedo`] | a surface from image files |
//! | [`Transfer`] | light to image, and the transpose |
//! | [`RenderedImage`], [`RenderingLoss`] | loss and gradients |
//!
//! Directions are unit vectors of one frame that all of these share: the native one of [`veni_light::sphere`] (z up) where
//! nothing else is said.

mod camera;
mod icosahedron;
mod image;
mod kernel;
mod lights;
mod loss;
mod maps;
mod material;
mod raster;
mod surface;
mod transfer;
mod unit;

#[cfg(test)]
mod tests;

pub use camera::{Camera, REFERENCE_FIELD_OF_VIEW};
pub use image::{ExposureForm, LossAndGradients, RenderedImage};
pub use lights::DistantLights;
pub use loss::RenderingLoss;
pub use maps::{NormalMap, read_albedo, read_mask};
pub use material::{Colour, Material, Specular};
pub use raster::Mesh;
pub use surface::Surface;
pub use transfer::{DEFAULT_MEMORY, Transfer};

/// Physics, or the reference implementation to the letter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ShadingForm {
    /// Reflected radiance Σ f L cos θ ω with normalised f; the view vector points to the camera; pixels that show no
    /// surface are 0.
    #[default]
    Physical,
    /// MODEL (57): the sum over the lights uses no 1/π; the view vector of Blinn-Phong points *away* from the camera,
    /// its lobe has no cosine and the factor (s + 2)/(4 (2 − e^{−s/2})); its result is at least 1e-3; pixels that
    /// show no surface are 1. Lights of [`DistantLights::reference`] belong to it, which have no solid angles either.
    Reference,
}
