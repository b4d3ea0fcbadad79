//! What is baked: which directions an image holds, and what its file says about them.

use std::collections::BTreeMap;

use anyhow::Result;
use clap::ValueEnum;
use veni_core::field::Field;
use veni_core::latent::Latent;
use veni_core::panorama::Panorama;
use veni_core::panorama::tonemap::Tonemap;
use veni_core::sphere::{CubeFace, Equirect, Frame};

use crate::commands::bake::{FrameName, Layout};
use crate::output::{CUBE_FACES, FRAME, LATENT, MODEL};
use crate::size::Size;

/// Default width of an equirectangular image.
const WIDTH: usize = 1024;
/// Default edge of a cube face: the same resolution at the centre of a face.
const EDGE: usize = WIDTH / 4;

/// Pixels of a cube map that are decoded at a time.
const CUBE_BAND: usize = 1 << 18;

/// An image to bake.
pub(crate) struct Picture {
    layout: Layout,
    frame: FrameName,
    grid: Equirect,
}

impl Picture {
    pub(crate) fn new(layout: Layout, frame: Option<FrameName>, size: Option<Size>) -> Result<Self> {
        let (default, (width, height)) = match layout {
            Layout::Equirect => (FrameName::Blender, size.map_or(Ok((WIDTH, WIDTH / 2)), Size::equirect)?),
            Layout::Cubemap => {
                let edge = size.map_or(Ok(EDGE), Size::cube)?;
                (FrameName::Gltf, (edge, 6 * edge))
            }
        };
        Ok(Self { layout, frame: frame.unwrap_or(default), grid: Equirect::new(width, height) })
    }

    /// Width and height of the image (for a cube map the pixels do not have this grid's directions).
    pub(crate) fn grid(&self) -> Equirect {
        self.grid
    }

    pub(crate) fn frame_name(&self) -> String {
        self.frame.to_possible_value().map(|v| v.get_name().to_owned()).unwrap_or_default()
    }

    /// The rows from the top, a few in memory at a time.
    pub(crate) fn rows(
        &self,
        field: &Field,
        each: &mut dyn FnMut(&[[f32; 3]]) -> veni_core::Result<()>,
    ) -> veni_core::Result<()> {
        match self.layout {
            Layout::Equirect => field.bake_rows(self.grid, 0..self.grid.height, |_, row| each(row)),
            Layout::Cubemap => self.cube_rows(field, each),
        }
    }

    fn cube_rows(
        &self,
        field: &Field,
        each: &mut dyn FnMut(&[[f32; 3]]) -> veni_core::Result<()>,
    ) -> veni_core::Result<()> {
        let (edge, frame) = (self.grid.width, Frame::from(self.frame));
        let band = (CUBE_BAND / edge).clamp(1, edge);
        let mut pixels = vec![[0.0; 3]; band * edge];
        let mut directions = Vec::with_capacity(pixels.len());
        for face in CubeFace::ALL {
            for first in (0..edge).step_by(band) {
                let rows = first..edge.min(first + band);
                directions.clear();
                directions
                    .extend(rows.flat_map(|row| (0..edge).map(move |i| face.direction(frame, edge, i, row))));
                let pixels = &mut pixels[..directions.len()];
                field.radiance_batch(&directions, pixels);
                pixels.chunks_exact(edge).try_for_each(&mut *each)?;
            }
        }
        Ok(())
    }

    /// Whether the image is a latitude-longitude panorama.
    pub(crate) fn is_latlong(&self) -> bool {
        self.layout == Layout::Equirect
    }

    /// What the file says about itself.
    pub(crate) fn attributes(&self, latent: &Latent, model: &str) -> Result<BTreeMap<String, String>> {
        let mut attributes = BTreeMap::from([
            (LATENT.to_owned(), latent.to_json()?),
            (MODEL.to_owned(), model.to_owned()),
            (FRAME.to_owned(), self.frame_name()),
        ]);
        if self.layout == Layout::Cubemap {
            attributes.insert(CUBE_FACES.to_owned(), "+X -X +Y -Y +Z -Z".to_owned());
        }
        Ok(attributes)
    }

    /// For the result line: "1024 x 512 half".
    pub(crate) fn describe(&self, precision: &str) -> String {
        let Equirect { width, height } = self.grid;
        match self.layout {
            Layout::Equirect => format!("{width} x {height}, {precision}"),
            Layout::Cubemap => {
                format!("six faces of {width} x {width}, {} frame, {precision}", self.frame_name())
            }
        }
    }
}

impl From<FrameName> for Frame {
    fn from(name: FrameName) -> Self {
        match name {
            FrameName::Blender => Self::Blender,
            FrameName::Gltf => Self::Gltf,
            FrameName::Openexr => Self::OpenExr,
            FrameName::Bevy => Self::Bevy,
        }
    }
}

/// The tone curve of a preview, from a small bake, so that it is known before the first row of a large one.
pub(crate) fn preview_tonemap(field: &Field) -> Tonemap {
    let grid = Equirect::new(128, 64);
    Tonemap::filmic(&Panorama::new(grid, field.bake(grid)), 0.0)
}
