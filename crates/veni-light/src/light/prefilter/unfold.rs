//! Where the texels of a cube lie in a panorama, and what it shows there.
//!
//! A face is its own mirror image, and those around the horizon are alike: the angles of the places of one quarter of a face serve
//! all, so that few are computed.

use super::{CubeAxes, CubeMap};
use crate::light::angle::atan2;
use crate::sphere::{CubeFace, Equirect};
use crate::tasks;

use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// What is looked up: radiance up to a ceiling.
#[derive(Clone, Copy)]
pub(super) struct Dim<'a> {
    pub(super) grid: Equirect,
    pub(super) pixels: &'a [[f32; 3]],
    pub(super) ceiling: [f32; 3],
}

impl Dim<'_> {
    /// Radiance between four pixels; columns within a round of the map and rows count from the centre of the first pixel. Columns
    /// wrap, rows go on beyond a pole half a turn away.
    #[inline]
    fn at(&self, column: f32, row: f32) -> [f32; 3] {
        let Equirect { width, height } = self.grid;
        let round = width as f32;
        let x = if column < 0.0 {
            column + round
        } else if column >= round {
            column - round
        } else {
            column
        };
        let left = (x as usize).min(width - 1);
        let right = if left + 1 == width { 0 } else { left + 1 };
        // rows are −½ at least
        let top = (row + 1.0) as isize - 1;
        let (u, v) = (x - left as f32, row - top as f32);
        let mut sum = [0.0; 3];
        for (j, down) in [(top, 1.0 - v), (top + 1, v)] {
            let (row, turn) = match usize::try_from(j) {
                Err(_) => (0, width / 2),
                Ok(j) if j >= height => (height - 1, width / 2),
                Ok(j) => (j, 0),
            };
            let pixels = &self.pixels[row * width..][..width];
            for (column, across) in [(left, 1.0 - u), (right, u)] {
                let column = if column + turn >= width { column + turn - width } else { column + turn };
                let (pixel, weight) = (pixels[column], down * across);
                sum = [0, 1, 2].map(|c| sum[c] + weight * pixel[c].min(self.ceiling[c]));
            }
        }
        sum
    }
}

/// Angles of the places of one row at the distances |a| from a face's middle column, in columns and rows of the panorama.
#[derive(Default)]
struct Angles {
    /// Height above the horizon where rows of the face are level.
    rise: Vec<f32>,
    /// The same where its columns are.
    rise_of_column: Vec<f32>,
    /// Distance from the pole that the face is around.
    drop: Vec<f32>,
    /// Azimuth about that pole, from the direction of rows to that of columns.
    turn: Vec<f32>,
    /// Solid angle, relative.
    weight: Vec<f32>,
}

/// The grid of places of a face.
#[derive(Clone, Copy)]
struct Places {
    /// Along a side.
    count: usize,
    /// Columns per radian, and rows.
    scale: [f32; 2],
    /// Whether faces around the horizon have level columns, some of them.
    tilted: bool,
}

impl Places {
    /// Twice a place's distance from the middle in places, signed.
    fn offset(self, k: usize) -> isize {
        (2 * k + 1) as isize - self.count as isize
    }

    /// Which of the distances from the middle is a place's.
    fn distance(self, k: usize) -> usize {
        self.offset(k).unsigned_abs() / 2
    }

    /// Distances from the middle of half a row.
    fn distances(self) -> impl Iterator<Item = f32> {
        let odd = self.count % 2;
        (0..self.count.div_ceil(2)).map(move |i| (2 * i + 1 - odd) as f32 / self.count as f32)
    }

    /// Angles of the row of places `k`.
    fn angles(self, k: usize, angles: &mut Angles) {
        let b = self.offset(k).unsigned_abs() as f32 / self.count as f32;
        let [columns, rows] = self.scale;
        fn fill(values: &mut Vec<f32>, of: impl Iterator<Item = f32>) {
            values.clear();
            values.extend(of);
        }
        fill(&mut angles.rise, self.distances().map(|a| rows * atan2(b, (1.0 + a * a).sqrt())));
        fill(&mut angles.drop, self.distances().map(|a| rows * atan2((a * a + b * b).sqrt(), 1.0)));
        fill(&mut angles.turn, self.distances().map(|a| columns * atan2(b, a)));
        let square = |a: f32| 1.0 + a * a + b * b;
        fill(&mut angles.weight, self.distances().map(|a| 1.0 / (square(a) * square(a).sqrt())));
        if self.tilted {
            let across = (1.0 + b * b).sqrt();
            fill(&mut angles.rise_of_column, self.distances().map(|a| rows * atan2(a, across)));
        }
    }
}

/// How a face lies.
struct Lie {
    /// Native directions of its middle, of a to the right, of b downwards.
    middle: [f32; 3],
    right: [f32; 3],
    down: [f32; 3],
}

impl Lie {
    fn new(face: CubeFace, axes: CubeAxes) -> Self {
        let native = |a: f64, b: f64| axes.native(face.lookup(a, b).map(|v| v as f32));
        let (middle, a, b) = (native(0.0, 0.0), native(1.0, 0.0), native(0.0, 1.0));
        Self { middle, right: [0, 1, 2].map(|c| a[c] - middle[c]), down: [0, 1, 2].map(|c| b[c] - middle[c]) }
    }

    /// Column of an azimuth (of one of the axes), from the centre of the first pixel.
    fn column([x, y, _]: [f32; 3], scale: f32) -> f32 {
        (PI - atan2(y, x)) * scale - 0.5
    }

    /// Whether b turns a counter-clockwise seen from above (1) or clockwise (−1).
    fn sense(a: [f32; 3], b: [f32; 3]) -> f32 {
        a[0] * b[1] - a[1] * b[0]
    }
}

impl CubeMap {
    /// A cube whose texels are means over `samples`² places each of a panorama, weighted by solid angle.
    pub(super) fn unfolded(dim: Dim<'_>, size: usize, axes: CubeAxes, samples: usize) -> Self {
        let mut texels = vec![[0.0; 3]; 6 * size * size];
        let count = size * samples;
        let Equirect { width, height } = dim.grid;
        let places = Places {
            count,
            scale: [width as f32 / TAU, height as f32 / PI],
            tilted: axes.native([0.0, 1.0, 0.0])[2] == 0.0,
        };
        let turns: Vec<f32> = places.distances().map(|a| places.scale[0] * atan2(a, 1.0)).collect();
        let lies = CubeFace::ALL.map(|face| Lie::new(face, axes));
        // rows above and below the middle of a face share their angles
        let mut pairs: Vec<Vec<Line<'_>>> = (0..size.div_ceil(2)).map(|_| Vec::new()).collect();
        for (line, texels) in texels.chunks_exact_mut(size).enumerate() {
            pairs[(line % size).min(size - 1 - line % size)].push((line, texels));
        }
        tasks::each(pairs.into_iter().enumerate(), Angles::default, |angles, (upper, lines)| {
            let (mut lines, mut weights) = (lines, vec![0.0; size]);
            for k in upper * samples..(upper + 1) * samples {
                places.angles(k, angles);
                for (column, weight) in weights.iter_mut().enumerate() {
                    let of_texel = column * samples..(column + 1) * samples;
                    *weight += of_texel.map(|k| angles.weight[places.distance(k)]).sum::<f32>();
                }
                for (line, texels) in &mut lines {
                    let b = if *line % size == upper { places.offset(k) } else { -places.offset(k) };
                    let row = FaceRow { dim, places, lie: &lies[*line / size], angles, turns: &turns, b };
                    row.add_to(texels, samples);
                }
            }
            for (_, texels) in &mut lines {
                for (texel, weight) in texels.iter_mut().zip(&weights) {
                    *texel = texel.map(|v| v / weight);
                }
            }
        });
        Self::new(size, texels)
    }
}

/// A row of texels: its number in the cube, and the texels.
type Line<'a> = (usize, &'a mut [[f32; 3]]);

/// A row of places on one face.
struct FaceRow<'a> {
    dim: Dim<'a>,
    places: Places,
    lie: &'a Lie,
    angles: &'a Angles,
    /// Azimuth of the distances |a| on a face around the horizon.
    turns: &'a [f32],
    /// Its signed distance from the middle, as [`Places::offset`].
    b: isize,
}

impl FaceRow<'_> {
    /// Adds radiance times solid angle of each texel's places.
    fn add_to(&self, texels: &mut [[f32; 3]], samples: usize) {
        let Self { places, lie, angles, .. } = *self;
        let [columns, rows] = places.scale;
        let below = if self.b < 0 { -1.0 } else { 1.0 };
        let horizon = FRAC_PI_2 * rows - 0.5;
        let middle = Lie::column(lie.middle, columns);
        if lie.middle[2] != 0.0 {
            // azimuth from the direction of a, either way of it
            let down = lie.down.map(|c| below * c);
            let ways = [-1.0, 1.0].map(|side| {
                let right = lie.right.map(|c| side * c);
                (Lie::column(right, columns), Lie::sense(right, down))
            });
            let (pole, sign) = if lie.middle[2] > 0.0 { (-0.5, 1.0) } else { (2.0 * horizon + 0.5, -1.0) };
            self.sum(texels, samples, |i, side| {
                let (from, sense) = ways[side];
                (from - sense * angles.turn[i], pole + sign * angles.drop[i])
            });
        } else if lie.down[2] != 0.0 {
            let (sense, rise) = (Lie::sense(lie.middle, lie.right), below * lie.down[2]);
            self.sum(texels, samples, |i, side| {
                let side = 2.0 * side as f32 - 1.0;
                (middle - side * sense * self.turns[i], horizon - rise * angles.rise[i])
            });
        } else {
            let i = self.b.unsigned_abs() / 2;
            let column = middle - below * Lie::sense(lie.middle, lie.down) * self.turns[i];
            self.sum(texels, samples, |i, side| {
                let side = 2.0 * side as f32 - 1.0;
                (column, horizon - side * lie.right[2] * angles.rise_of_column[i])
            });
        }
    }

    /// `at` gives column and row of the panorama for a distance from the middle and its side, 0 to the left.
    #[inline(always)]
    fn sum(&self, texels: &mut [[f32; 3]], samples: usize, at: impl Fn(usize, usize) -> (f32, f32)) {
        for (column, texel) in texels.iter_mut().enumerate() {
            for k in column * samples..(column + 1) * samples {
                let i = self.places.distance(k);
                let (x, y) = at(i, usize::from(self.places.offset(k) >= 0));
                let (value, weight) = (self.dim.at(x, y), self.angles.weight[i]);
                *texel = [0, 1, 2].map(|c| texel[c] + weight * value[c]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::angle::pixel;

    /// Texels are what the panorama shows in the directions of their places, whatever the axes and sizes.
    #[test]
    fn texels_are_where_their_directions_are() {
        for (width, height) in [(64, 32), (50, 25), (2, 1)] {
            let grid = Equirect::new(width, height);
            let pixels: Vec<[f32; 3]> =
                (0..grid.len()).map(|k| [0, 1, 2].map(|c| 1.0 + ((k * (7 + c) * 31) % 97) as f32)).collect();
            let dim = Dim { grid, pixels: &pixels, ceiling: [60.0, 1e3, 80.0] };
            for axes in
                [CubeAxes::GLTF, CubeAxes::FILAMENT, CubeAxes::BEVY, CubeAxes::THREE, CubeAxes::NATIVE]
            {
                for (size, samples) in [(8, 2), (7, 3), (5, 1), (1, 4)] {
                    let found = CubeMap::unfolded(dim, size, axes, samples);
                    let expected = CubeMap::of(size, axes, samples, |direction| {
                        let [x, y] = pixel(grid, direction);
                        dim.at(x - 0.5, y - 0.5)
                    });
                    for (k, (a, b)) in found.texels().iter().zip(expected.texels()).enumerate() {
                        // a place that is a pole has no azimuth
                        if size * samples % 2 == 1 && k % (size * size) == size * size / 2 {
                            continue;
                        }
                        for (a, b) in a.iter().zip(b) {
                            assert!((a - b).abs() < 2e-3, "{axes:?}, {size} × {samples}: {k}, {a} for {b}");
                        }
                    }
                }
            }
        }
    }
}
