//! Baking on all cores.

use veni_light::field::Field;
use veni_light::sphere::{CubeFace, Frame};

use super::directions::Directions;
use super::on_cube::OnCube;
use crate::output::Push;

/// Pixels of a cube map that are decoded at a time.
const CUBE_BAND: usize = 1 << 18;

/// Hands over the rows of an image from the top.
pub(super) fn rows(field: &Field, directions: Directions, each: Push<'_>) -> veni_light::Result<()> {
    match directions {
        Directions::Equirect(grid) => field.bake_rows(grid, 0..grid.height, |_, row| each(row)),
        Directions::Cube { edge, frame } => cube_rows(field, edge, frame, each),
    }
}

fn cube_rows(field: &Field, edge: usize, frame: Frame, each: Push<'_>) -> veni_light::Result<()> {
    let band = (CUBE_BAND / edge).clamp(1, edge);
    let mut pixels = vec![[0.0; 3]; band * edge];
    let mut directions = Vec::with_capacity(pixels.len());
    let mut lights = OnCube::new(field.lights(), frame, edge);
    let field = field.without_lights();
    for face in CubeFace::ALL {
        for first in (0..edge).step_by(band) {
            let rows = first..edge.min(first + band);
            directions.clear();
            directions
                .extend(rows.flat_map(|row| (0..edge).map(move |i| face.direction(frame, edge, i, row))));
            let pixels = &mut pixels[..directions.len()];
            field.radiance_batch(&directions, pixels);
            lights.add_to(pixels);
            pixels.chunks_exact(edge).try_for_each(&mut *each)?;
        }
    }
    Ok(())
}
