//! What is baked, and into what.

use std::ops::Range;

use veni_light::sphere::Frame;
use wgpu::{Buffer, BufferUsages, Texture, TextureDimension, TextureFormat, TextureUsages};

use crate::error::{Error, Result};
use crate::shader::{Directions, Grid, Request, StorageFormat, Store};

/// Description of a bake: make it by one of its constructors, change it by its methods, and hand it to
/// [`GpuDecoder::bake`](super::GpuDecoder::bake).
///
/// Pixels of panoramas and cube faces hold the part of a light that lies in them, so that its energy is right at any resolution.
#[derive(Clone, Copy, Debug)]
pub struct Bake<'a> {
    pub(super) target: Target<'a>,
    pub(super) frame: Frame,
    pub(super) rotation: f64,
    pub(super) stops: f32,
    pub(super) logarithm: bool,
    pub(super) lights: bool,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Target<'a> {
    Texture { texture: &'a Texture, cube: bool },
    Pixels { buffer: &'a Buffer, grid: Grid, first: u32, count: u32 },
    List { directions: &'a Buffer, buffer: &'a Buffer, count: u32 },
}

impl<'a> Bake<'a> {
    /// A panorama over the whole of a storage texture: `rgba32float` or `rgba16float`, 2D, one layer per latent, usage
    /// `STORAGE_BINDING`; mip level 0 is written.
    pub fn equirect(texture: &'a Texture) -> Self {
        Self::new(Target::Texture { texture, cube: false })
    }

    /// Six square faces per latent, +X −X +Y −Y +Z −Z of the frame as layers, in a storage texture as for
    /// [`Bake::equirect`]. View it as a cube to sample it.
    pub fn cube(texture: &'a Texture) -> Self {
        Self::new(Target::Texture { texture, cube: true })
    }

    /// Rows of a panorama or of stacked cube faces (row `face · size + row`) into a storage buffer: a `vec4f` per pixel,
    /// row-major, latent after latent. Panoramas larger than a texture or a binding may be are baked in bands.
    pub fn rows(buffer: &'a Buffer, grid: Grid, rows: Range<u32>) -> Self {
        let width = grid.width();
        let (first, count) = (rows.start.saturating_mul(width), rows.len() as u32);
        Self::new(Target::Pixels { buffer, grid, first, count: count.saturating_mul(width) })
    }

    /// Radiance for `count` unit directions, of lights what is seen there: a storage buffer of `vec4f` (the fourth component is ignored) to a
    /// storage buffer of `vec4f` per latent and direction, which must be another one.
    pub fn directions(directions: &'a Buffer, radiance: &'a Buffer, count: u32) -> Self {
        Self::new(Target::List { directions, buffer: radiance, count })
    }

    fn new(target: Target<'a>) -> Self {
        Self { target, frame: Frame::default(), rotation: 0.0, stops: 0.0, logarithm: false, lights: true }
    }

    /// The frame whose axes name cube faces and directions. Panoramas do not depend on it.
    #[must_use]
    pub fn frame(self, frame: Frame) -> Self {
        Self { frame, ..self }
    }

    /// Yaw: rotates the scene about z by this angle, radians, counter-clockwise seen from above.
    #[must_use]
    pub fn rotate(self, radians: f64) -> Self {
        Self { rotation: radians, ..self }
    }

    /// Radiance times 2^stops.
    #[must_use]
    pub fn brighten(self, stops: f32) -> Self {
        Self { stops, ..self }
    }

    /// Natural log of radiance, the network's own output with its lobes, instead of radiance. Lights are not in it.
    #[must_use]
    pub fn logarithm(self) -> Self {
        Self { logarithm: true, ..self }
    }

    /// Leaves the compact lights of the latents out: for hosts that draw the sun as a light of its own
    /// ([`Field::lights`](veni_light::field::Field::lights) has it).
    #[must_use]
    pub fn without_lights(self) -> Self {
        Self { lights: false, ..self }
    }

    /// The kernel's ends and the request, once the target is known to fit `latents` latents.
    pub(super) fn request(&self, latents: u32) -> Result<(Directions, Store, Request)> {
        if !self.rotation.is_finite() || !self.stops.is_finite() {
            let (rotation, stops) = (self.rotation, self.stops);
            return Err(Error::invalid(format!(
                "a rotation by {rotation} and {stops} stops: both must be finite"
            )));
        }
        let (directions, store, grid, first, count) = match self.target {
            Target::Texture { texture, cube } => {
                let (grid, format) = texture_grid(texture, cube, latents)?;
                let count = count(grid)?;
                (Directions::Grid, Store::Texture(format), grid, 0, count)
            }
            Target::Pixels { buffer, grid, first, count } => {
                let whole = self::count(grid)?;
                if first.checked_add(count).is_none_or(|end| end > whole) || matches!(grid, Grid::List { .. })
                {
                    return Err(Error::invalid(format!("{grid:?} does not have these rows")));
                }
                check_buffer(buffer, "radiance", latents, count)?;
                (Directions::Grid, Store::Buffer, grid, first, count)
            }
            Target::List { directions, buffer, count } => {
                // wgpu would say so only when the host finishes its encoder, which is lost then
                if directions == buffer {
                    return Err(Error::invalid("directions and radiance are the same buffer; they need two"));
                }
                check_buffer(directions, "direction", 1, count)?;
                check_buffer(buffer, "radiance", latents, count)?;
                (Directions::Buffer, Store::Buffer, Grid::List { count }, 0, count)
            }
        };
        let largest = match store {
            Store::Texture(format) => format.largest(),
            Store::Buffer => f32::MAX,
        };
        let request = Request {
            grid,
            frame: self.frame,
            rotation: self.rotation,
            log_exposure: self.stops * std::f32::consts::LN_2,
            largest,
            logarithm: self.logarithm,
            lights: self.lights,
            first,
            count,
            latent: 0,
            tile: 0,
        };
        Ok((directions, store, request))
    }
}

/// Grid and texels of a texture that can be written.
pub(crate) fn texture_grid(texture: &Texture, cube: bool, latents: u32) -> Result<(Grid, StorageFormat)> {
    let format = match texture.format() {
        TextureFormat::Rgba32Float => StorageFormat::Rgba32Float,
        TextureFormat::Rgba16Float => StorageFormat::Rgba16Float,
        other => {
            return Err(Error::invalid(format!(
                "the target texture has the format {other:?}; radiance goes into Rgba32Float or Rgba16Float"
            )));
        }
    };
    if !texture.usage().contains(TextureUsages::STORAGE_BINDING) {
        let usage = texture.usage();
        return Err(Error::invalid(format!(
            "the target texture has usage {usage:?}, without STORAGE_BINDING"
        )));
    }
    let (dimension, samples) = (texture.dimension(), texture.sample_count());
    if dimension != TextureDimension::D2 || samples != 1 {
        return Err(Error::invalid(format!(
            "the target texture is {dimension:?} with {samples} samples; it must be D2 with one"
        )));
    }
    let (width, height, layers) = (texture.width(), texture.height(), texture.depth_or_array_layers());
    let needed = if cube { latents.saturating_mul(6) } else { latents };
    if layers < needed {
        let what = if cube { "six layers per latent" } else { "a layer per latent" };
        return Err(Error::invalid(format!(
            "the target texture has {layers} layers; {latents} latents need {needed}, {what}"
        )));
    }
    if cube && width != height {
        return Err(Error::invalid(format!("cube faces of {width} × {height} texels: they must be square")));
    }
    Ok((if cube { Grid::Cube { size: width } } else { Grid::Equirect { width, height } }, format))
}

fn check_buffer(buffer: &Buffer, what: &str, latents: u32, count: u32) -> Result<()> {
    let usage = buffer.usage();
    if !usage.contains(BufferUsages::STORAGE) {
        return Err(Error::invalid(format!("the {what} buffer has usage {usage:?}, without STORAGE")));
    }
    let (size, needed) = (buffer.size(), 16 * u64::from(latents) * u64::from(count));
    if size < needed || count == 0 {
        return Err(Error::invalid(format!(
            "the {what} buffer has {size} bytes; {latents} × {count} vec4f take {needed}, and there must be some"
        )));
    }
    Ok(())
}

/// Directions of a grid, which are counted in 32 bits.
pub(crate) fn count(grid: Grid) -> Result<u32> {
    let directions = grid.directions();
    match u32::try_from(directions) {
        Ok(count) if count > 0 => Ok(count),
        _ => Err(Error::invalid(format!(
            "a grid of {directions} directions: it must have from 1 to {}",
            u32::MAX
        ))),
    }
}
