//! `directions_grid.wgsl`

use veni_light::sphere::{CubeFace, Equirect, Frame};

use crate::shader::{Grid, Request};

/// Native direction that pixel `index` of the whole grid is looked up at: the rotation of the scene included.
///
/// # Panics
/// If the grid is a list, whose directions are the host's.
pub fn direction_of(request: &Request, index: u32) -> [f32; 3] {
    let index = index as usize;
    let direction = match request.grid {
        Grid::Equirect { width, height } => {
            let grid = Equirect::new(width as usize, height as usize);
            grid.direction(index % grid.width, index / grid.width)
        }
        Grid::Cube { size } => {
            let size = size as usize;
            let (face, texel) = (CubeFace::ALL[index / (size * size)], index % (size * size));
            face.direction(request.frame, size, texel % size, texel / size)
        }
        Grid::List { .. } => panic!("a list has no directions of its own"),
    };
    rotated(direction, -request.rotation)
}

/// A direction of a list, in the request's frame, made native.
pub fn listed(request: &Request, direction: [f32; 3]) -> [f32; 3] {
    rotated(Frame::to_native(request.frame, direction), -request.rotation)
}

fn rotated([x, y, z]: [f32; 3], radians: f64) -> [f32; 3] {
    let (sin, cos) = radians.sin_cos();
    let (x, y) = (f64::from(x), f64::from(y));
    [(x * cos - y * sin) as f32, (x * sin + y * cos) as f32, z]
}
