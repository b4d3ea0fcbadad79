//! A cube map whose mip levels are prefiltered.

use veni_light::light::{Law, Levels};
use veni_light::sphere::Frame;
use wgpu::Texture;

use crate::decoder::{Bake, texture_grid};
use crate::error::{Error, Result};
use crate::shader::{Grid, StorageFormat};

/// Description of a prefiltered cube map: make it, change it by its methods, and hand it to
/// [`GpuPrefilter::bake`](super::GpuPrefilter::bake).
#[derive(Clone, Copy, Debug)]
pub struct PrefilteredCube<'a> {
    pub(super) texture: &'a Texture,
    law: Law,
    pub(super) frame: Frame,
    pub(super) rotation: f64,
    pub(super) lights: bool,
}

impl<'a> PrefilteredCube<'a> {
    /// All mip levels of a storage texture: `rgba32float` or `rgba16float`, 2D, square, six layers per latent (+X −X +Y −Y +Z −Z of
    /// the frame), usage `STORAGE_BINDING`. `law` says which roughness a level has.
    pub fn new(texture: &'a Texture, law: Law) -> Self {
        Self { texture, law, frame: Frame::default(), rotation: 0.0, lights: true }
    }

    /// The frame whose axes name the faces.
    #[must_use]
    pub fn frame(self, frame: Frame) -> Self {
        Self { frame, ..self }
    }

    /// Yaw: rotates the scene about z by this angle, radians, counter-clockwise seen from above. The harmonics need not be found
    /// again.
    #[must_use]
    pub fn rotate(self, radians: f64) -> Self {
        Self { rotation: radians, ..self }
    }

    /// Leaves the compact lights of the latents out, for hosts that draw the sun as a light of its own.
    #[must_use]
    pub fn without_lights(self) -> Self {
        Self { lights: false, ..self }
    }

    /// The first level, which is the field itself.
    pub(super) fn first(&self) -> Bake<'a> {
        let bake = Bake::cube(self.texture).frame(self.frame).rotate(self.rotation);
        if self.lights { bake } else { bake.without_lights() }
    }

    /// Its chain of levels and its texels, once the texture is known to fit.
    pub(super) fn levels(&self, latents: u32) -> Result<(Levels, StorageFormat)> {
        let (grid, format) = texture_grid(self.texture, true, latents)?;
        if !self.rotation.is_finite() {
            return Err(Error::invalid(format!("a rotation by {}: it must be finite", self.rotation)));
        }
        let count = self.texture.mip_level_count() as usize;
        let Grid::Cube { size } = grid else { return Err(Error::invalid("the texture is not a cube")) };
        Ok((Levels::new(size as usize, count, self.law), format))
    }
}
