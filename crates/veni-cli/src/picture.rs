//! What is baked: which directions an image holds, and what its file says about them.

use std::collections::BTreeMap;

use anyhow::Result;
use clap::ValueEnum;
use veni_image::Panorama;
use veni_image::tonemap::Tonemap;
use veni_light::latent::Latent;
use veni_light::sphere::{Equirect, Frame};

use crate::device::{Baker, Directions};
use crate::output::{CUBE_FACES, FRAME, LATENT, MODEL};
use crate::size::Size;

/// Default width of an equirectangular image.
const WIDTH: usize = 1024;
/// Default edge of a cube face: the same resolution at the centre of a face.
const EDGE: usize = WIDTH / 4;

/// How directions are laid out in the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Layout {
    /// Latitude and longitude, twice as wide as high
    #[default]
    Equirect,
    /// Six faces, one below the other
    Cubemap,
}

/// The frames by the names that are typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FrameName {
    /// z up, the image's centre looks along +x (also native to this program)
    Blender,
    /// y up, centre +x (glTF, three.js)
    Gltf,
    /// y up, centre +z (OpenEXR, USD)
    Openexr,
    /// y up, centre -z
    Bevy,
}

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

    pub(crate) fn is_panorama(&self) -> bool {
        self.layout == Layout::Equirect
    }

    pub(crate) fn frame_name(&self) -> String {
        self.frame.to_possible_value().map(|v| v.get_name().to_owned()).unwrap_or_default()
    }

    /// Which direction each pixel has.
    pub(crate) fn directions(&self) -> Directions {
        match self.layout {
            Layout::Equirect => Directions::Equirect(self.grid),
            Layout::Cubemap => Directions::Cube { edge: self.grid.width, frame: Frame::from(self.frame) },
        }
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

    /// For the result line: "1024 x 512, half".
    pub(crate) fn describe(&self, precision: Option<&str>) -> String {
        let precision = precision.map(|precision| format!(", {precision}")).unwrap_or_default();
        let Equirect { width, height } = self.grid;
        match self.layout {
            Layout::Equirect => format!("{width} x {height}{precision}"),
            Layout::Cubemap => {
                format!("six faces of {width} x {width}, {} frame{precision}", self.frame_name())
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
pub(crate) fn preview_tonemap(baker: &Baker) -> Result<Tonemap> {
    let grid = Equirect::new(128, 64);
    Ok(Tonemap::filmic(&Panorama::new(grid, baker.bake(grid)?), 0.0))
}
