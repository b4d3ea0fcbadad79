//! Running a network on a sphere: without edges where its image would have them. MODEL (64).

use std::f64::consts::PI;

use super::{ExpansionNetwork, NetworkOutput};
use crate::{Error, Result};
use veni_image::Panorama;
use veni_light::sphere::Equirect;

/// By this many pixels a panorama is continued beyond each of its edges.
const MARGIN: usize = 64;
/// Sides become a multiple of this: encoders and decoders of five levels halve them five times.
const MULTIPLE: usize = 32;

/// The network's radiance for the values it is shown, at their own size.
pub(super) fn run(
    network: &dyn ExpansionNetwork,
    shown: &Panorama,
    output: NetworkOutput,
) -> Result<Panorama> {
    let Equirect { width, height } = shown.grid();
    let [fixed_height, fixed_width] = network.size();
    let (top, rows) = extent(height, fixed_height.is_some());
    let (left, columns) = extent(width, fixed_width.is_some());
    let turns: &[usize] = if fixed_width.is_some() { &[0, width / 2] } else { &[0] };
    let mut sums = vec![[0f64; 4]; width * height];
    for &turn in turns {
        // the first column that is shown, and the column of the image where the panorama's first one is
        let origin = [turn as isize - left as isize, -(top as isize)];
        let planes = network.run(gather(shown, origin, [rows, columns]), [rows, columns])?;
        let planes = radiance(planes, rows * columns, output, network.name())?;
        for (k, sum) in sums.iter_mut().enumerate() {
            let column = (k % width + width - turn) % width;
            let at = (k / width + top) * columns + column + left;
            let weight = if turns.len() == 1 { 1.0 } else { middle(column, width) };
            for (c, s) in sum.iter_mut().take(3).enumerate() {
                *s += weight * f64::from(planes[c * rows * columns + at]);
            }
            sum[3] += weight;
        }
    }
    let pixels = sums.into_iter().map(|[r, g, b, weight]| [r, g, b].map(|v| (v / weight) as f32));
    Ok(Panorama::new(shown.grid(), pixels.collect()))
}

/// Where the panorama begins along one side of the network's image, and how long that side is.
fn extent(side: usize, fixed: bool) -> (usize, usize) {
    if fixed {
        return (0, side);
    }
    let long = (side + 2 * MARGIN).next_multiple_of(MULTIPLE);
    ((long - side) / 2, long)
}

/// Rises from 0 at an image's edges to 1 in its middle; with the same half a turn away it sums to 1.
fn middle(column: usize, width: usize) -> f64 {
    (PI * (column as f64 + 0.5) / width as f64).sin().powi(2)
}

/// Planes of an image whose first pixel is at `origin` (column, row) of the panorama and may lie beyond its edges: columns
/// wrap, rows go on over the poles, half a turn away.
fn gather(panorama: &Panorama, origin: [isize; 2], [rows, columns]: [usize; 2]) -> Vec<f32> {
    let Equirect { width, height } = panorama.grid();
    let mut planes = vec![0.0; 3 * rows * columns];
    for row in 0..rows {
        let around = (origin[1] + row as isize).rem_euclid(2 * height as isize) as usize;
        let (from, rotated) =
            if around < height { (around, 0) } else { (2 * height - 1 - around, width / 2) };
        for column in 0..columns {
            let at = (origin[0] + (column + rotated) as isize).rem_euclid(width as isize) as usize;
            let pixel = panorama.pixel(at, from);
            for (c, v) in pixel.into_iter().enumerate() {
                planes[(c * rows + row) * columns + column] = v;
            }
        }
    }
    planes
}

/// A network's values as linear radiance.
fn radiance(mut planes: Vec<f32>, pixels: usize, output: NetworkOutput, name: &str) -> Result<Vec<f32>> {
    if planes.len() != 3 * pixels {
        let (found, wanted) = (planes.len(), 3 * pixels);
        return Err(Error::invalid(format!("{name} gave {found} values where {wanted} were expected")));
    }
    let kinds = [("not numbers", f32::is_nan as fn(f32) -> bool), ("infinite", f32::is_infinite)];
    let complain = |planes: &[f32], what: &str| {
        for (kind, is) in kinds {
            let count = planes.iter().filter(|v| is(**v)).count();
            if count > 0 {
                return Err(Error::invalid(format!(
                    "{count} of the {} values that {name} gave{what} are {kind}",
                    planes.len()
                )));
            }
        }
        Ok(())
    };
    complain(&planes, "")?;
    if output == NetworkOutput::Log {
        planes.iter_mut().for_each(|v| *v = v.exp());
        complain(&planes, " as logarithms")?;
    }
    Ok(planes)
}
