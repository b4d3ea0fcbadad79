//! Entry points of a field: one direction, many, a panorama.

use std::ops::Range;

use super::Field;
use super::aligned::Aligned;
use super::block::Blocks;
use super::single::Single;
use crate::sphere::Equirect;
use crate::tasks;

/// Up to this many directions are faster one by one than as a block with idle lanes.
const FEW: usize = 6;
/// Directions of one task: a few blocks, so that all cores finish together.
pub(super) const TASK: usize = 192;
/// Pixels that are decoded before they are handed over: enough to keep all cores busy, and bounded (3 MB).
const BAND: usize = 1 << 18;

impl Field {
    /// Linear RGB radiance from unit direction `direction`, lights included.
    pub fn radiance(&self, direction: [f32; 3]) -> [f32; 3] {
        let mut out = [[0.0; 3]];
        self.run(&[direction], &mut out, false, &mut Aligned::default());
        out[0]
    }

    /// Natural log of [`Field::radiance`] without the lights.
    pub fn log_radiance(&self, direction: [f32; 3]) -> [f32; 3] {
        let mut out = [[0.0; 3]];
        self.run(&[direction], &mut out, true, &mut Aligned::default());
        out[0]
    }

    /// Linear RGB radiance from many unit directions, on all cores.
    ///
    /// # Panics
    /// If `out` is not as long as `directions`.
    pub fn radiance_batch(&self, directions: &[[f32; 3]], out: &mut [[f32; 3]]) {
        self.batch(directions, out, false);
    }

    /// Natural log of [`Field::radiance_batch`] without the lights.
    ///
    /// # Panics
    /// If `out` is not as long as `directions`.
    pub fn log_radiance_batch(&self, directions: &[[f32; 3]], out: &mut [[f32; 3]]) {
        self.batch(directions, out, true);
    }

    fn batch(&self, directions: &[[f32; 3]], out: &mut [[f32; 3]], log: bool) {
        let (n, m) = (directions.len(), out.len());
        assert!(n == m, "{n} directions need memory for {n} radiances, not {m}");
        if n <= TASK {
            return self.run(directions, out, log, &mut Aligned::default());
        }
        let parts = directions.chunks(TASK).zip(out.chunks_mut(TASK));
        tasks::each(parts, Aligned::default, |scratch, (directions, out)| {
            self.run(directions, out, log, scratch);
        });
    }

    pub(super) fn run(
        &self,
        directions: &[[f32; 3]],
        out: &mut [[f32; 3]],
        log: bool,
        scratch: &mut Aligned,
    ) {
        self.run_with(directions, out, log, true, scratch);
    }

    fn run_with(
        &self,
        directions: &[[f32; 3]],
        out: &mut [[f32; 3]],
        log: bool,
        lights: bool,
        scratch: &mut Aligned,
    ) {
        let (mlp, folded, arch) = (&self.weights.mlp, &*self.folded, pulp::Arch::new());
        let few = directions.len() <= FEW;
        let work = Blocks { mlp, folded, directions, out, log, lights, scratch };
        if few { arch.dispatch(Single(work)) } else { arch.dispatch(work) }
    }

    /// Linear RGB radiance of every pixel centre of `grid`, row-major from the top, on all cores; of the lights the mean over the
    /// pixel, so that their energy is right at any resolution.
    pub fn bake(&self, grid: Equirect) -> Vec<[f32; 3]> {
        let mut pixels = vec![[0.0; 3]; grid.len()];
        self.bake_band(grid, &Columns::new(grid), 0, &mut pixels);
        pixels
    }

    /// Bakes some rows of `grid` and hands them over one by one, from the top: `each_row(row, pixels)`. However
    /// large the grid, only a few rows are held.
    ///
    /// # Errors
    /// The first error of `each_row`, which ends the work.
    pub fn bake_rows<E>(
        &self,
        grid: Equirect,
        rows: Range<usize>,
        mut each_row: impl FnMut(usize, &[[f32; 3]]) -> Result<(), E>,
    ) -> Result<(), E> {
        let columns = Columns::new(grid);
        let band = (BAND / grid.width).clamp(1, rows.len().max(1));
        let mut pixels = vec![[0.0; 3]; band * grid.width];
        for first in rows.clone().step_by(band) {
            let pixels = &mut pixels[..band.min(rows.end - first) * grid.width];
            self.bake_band(grid, &columns, first, pixels);
            for (row, pixels) in (first..).zip(pixels.chunks_exact(grid.width)) {
                each_row(row, pixels)?;
            }
        }
        Ok(())
    }

    /// Whole rows from row `first` on.
    fn bake_band(&self, grid: Equirect, columns: &Columns, first: usize, pixels: &mut [[f32; 3]]) {
        let parts = pixels.chunks_mut(TASK).enumerate();
        let workspace = || (Aligned::default(), Vec::with_capacity(TASK));
        tasks::each(parts, workspace, |(scratch, directions), (task, out)| {
            directions.clear();
            columns.directions(grid, first * grid.width + task * TASK, out.len(), directions);
            self.run_with(directions, out, false, false, scratch);
        });
        self.folded.lights.add_to_rows(grid, first..first + pixels.len() / grid.width, pixels);
    }
}

/// (sin φ, cos φ) of every column, so that a pixel's direction costs two products.
struct Columns(Vec<(f64, f64)>);

impl Columns {
    fn new(grid: Equirect) -> Self {
        Self((0..grid.width).map(|column| grid.azimuth(column).sin_cos()).collect())
    }

    /// Appends the directions of `count` pixels from row-major index `from` on: to the bit
    /// [`Equirect::direction`].
    fn directions(&self, grid: Equirect, from: usize, count: usize, directions: &mut Vec<[f32; 3]>) {
        let end = from + count;
        for row in from / grid.width..end.div_ceil(grid.width) {
            let start = row * grid.width;
            let columns = from.max(start) - start..end.min(start + grid.width) - start;
            let (sin_t, cos_t) = grid.polar(row).sin_cos();
            let direction = |(s, c): &(f64, f64)| [(sin_t * c) as f32, (sin_t * s) as f32, cos_t as f32];
            directions.extend(self.0[columns].iter().map(direction));
        }
    }
}
