//! The uniform of a bake: `VeniRequest` in `request.wgsl`.

use veni_light::light::Falloff;
use veni_light::sphere::Frame;

/// How the directions of a bake are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grid {
    /// Latitude and longitude: `width` × `height` pixel centres, row 0 on top, as
    /// [`Equirect`](veni_light::sphere::Equirect). The frame changes nothing here: pixels stay where they are.
    Equirect {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// Six square faces, +X −X +Y −Y +Z −Z of the frame, as [`CubeFace`](veni_light::sphere::CubeFace).
    Cube {
        /// Texels along an edge.
        size: u32,
    },
    /// As many directions in a buffer, in the frame's coordinates.
    List {
        /// Their number.
        count: u32,
    },
}

impl Grid {
    /// Directions in a row of the grid; those of a list are rows of one.
    pub fn width(self) -> u32 {
        match self {
            Self::Equirect { width, .. } => width,
            Self::Cube { size } => size,
            Self::List { .. } => 1,
        }
    }

    /// Directions of the whole grid for one latent.
    pub fn directions(self) -> u64 {
        match self {
            Self::Equirect { width, height } => u64::from(width) * u64::from(height),
            Self::Cube { size } => 6 * u64::from(size) * u64::from(size),
            Self::List { count } => u64::from(count),
        }
    }
}

/// What one dispatch computes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// The whole grid.
    pub grid: Grid,
    /// Coordinates of the directions: of cube faces and lists.
    pub frame: Frame,
    /// Yaw: rotates the scene about z by this angle, radians, counter-clockwise seen from above.
    pub rotation: f64,
    /// Added to log radiance.
    pub log_exposure: f32,
    /// Largest number that is stored; values beyond it are clamped to it, of either sign.
    pub largest: f32,
    /// Store log radiance, which is without lights, instead of radiance.
    pub logarithm: bool,
    /// Add the lights of the latents.
    pub lights: bool,
    /// Index of the first direction within the grid.
    pub first: u32,
    /// Directions for each latent.
    pub count: u32,
    /// First latent of the batch.
    pub latent: u32,
    /// First tile of this dispatch.
    pub tile: u32,
}

impl Request {
    /// Bytes of the uniform.
    pub const BYTES: usize = 96;

    /// Factor of the radiance of lights.
    pub fn light_scale(&self) -> f32 {
        if self.lights { self.log_exposure.exp() } else { 0.0 }
    }

    /// Half of the largest κ of a glow that is smooth within a pixel, and taken at its middle; 0 for a list, which has no pixels.
    pub fn smoothest(&self) -> f32 {
        let pixel = match self.grid {
            Grid::Equirect { height, .. } => std::f64::consts::PI / f64::from(height),
            Grid::Cube { size } => 2.0 / f64::from(size),
            Grid::List { .. } => return 0.0,
        };
        (0.5 * Falloff::sharpest(pixel)) as f32
    }

    /// The uniform, little endian as WGSL lays it out.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let (layout, width, height) = match self.grid {
            Grid::Equirect { width, height } => (0, width, height),
            Grid::Cube { size } => (1, size, size),
            Grid::List { .. } => (0, 1, 1),
        };
        let [x, y, z] = axes(self.grid, self.frame, self.rotation);
        let f = |v: [f32; 3]| v.map(f32::to_bits);
        let ([a, b, c], [d, e, g], [h, i, j]) = (f(x), f(y), f(z));
        let words = [
            [a, b, c, layout],
            [d, e, g, width],
            [h, i, j, height],
            [self.first, self.count, self.latent, self.log_exposure.to_bits()],
            [self.largest.to_bits(), u32::from(self.logarithm), self.tile, self.light_scale().to_bits()],
            [self.smoothest().to_bits(), 0, 0, 0],
        ];
        let mut bytes = [0; Self::BYTES];
        let words = words.as_flattened().iter();
        bytes.as_chunks_mut::<4>().0.iter_mut().zip(words).for_each(|(b, w)| *b = w.to_le_bytes());
        bytes
    }
}

/// What the coordinate axes of directions are in the native frame of the unrotated scene.
pub(super) fn axes(grid: Grid, frame: Frame, rotation: f64) -> [[f32; 3]; 3] {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let (sin, cos) = rotation.sin_cos();
    let (sin, cos) = (sin as f32, cos as f32);
    axes.map(|axis| {
        let axis = match grid {
            Grid::Equirect { .. } => axis,
            // Bevy's shaders negate z before they look a cube map up
            Grid::Cube { .. } if frame == Frame::Bevy => frame.to_native([axis[0], axis[1], -axis[2]]),
            _ => frame.to_native(axis),
        };
        // rotating the scene by α looks up at −α
        let [x, y, z] = axis;
        [cos * x + sin * y, cos * y - sin * x, z]
    })
}
