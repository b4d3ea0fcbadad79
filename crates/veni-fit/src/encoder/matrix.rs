//! The matrix product: weights packed once, activations packed as they come.

use std::ops::Range;

use pulp::{Simd, WithSimd};

/// Outputs of a panel. Every channel axis is filled up with zeros to whole panels.
pub(super) const PANEL: usize = 32;
/// Rows of a register tile: two tokens of six coordinates.
const TILE: usize = 12;
/// Inputs at a time, so that a panel of weights stays in the first-level cache.
const DEPTH: usize = 256;

/// `n` filled up to whole panels.
pub(super) fn padded(n: usize) -> usize {
    n.next_multiple_of(PANEL)
}

/// One input's weights of a panel, on cache lines of its own.
#[derive(Clone, Copy, Debug)]
#[repr(align(128))]
struct Line([f32; PANEL]);

/// A matrix `[inputs, outputs]`, panel-major, then input, then output; outputs are filled up with zeros.
#[derive(Clone, Debug, Default)]
pub(super) struct Matrix {
    inputs: usize,
    lines: Vec<Line>,
}

impl Matrix {
    /// Of a row-major matrix.
    pub(super) fn new(data: &[f32], outputs: usize) -> Self {
        Self::from_rows(data.len() / outputs, outputs, |k| &data[k * outputs..][..outputs])
    }

    /// `row(k)` holds the weights of input k, one per output.
    pub(super) fn from_rows<'a>(inputs: usize, outputs: usize, row: impl Fn(usize) -> &'a [f32]) -> Self {
        let mut matrix = Self::default();
        matrix.reset(inputs, outputs);
        for k in 0..inputs {
            matrix.put(k, 0, row(k));
        }
        matrix
    }

    /// Makes it `[inputs, outputs]` of zeros, in the memory it has.
    pub(super) fn reset(&mut self, inputs: usize, outputs: usize) {
        self.inputs = inputs;
        self.lines.clear();
        self.lines.resize(inputs * outputs.div_ceil(PANEL), Line([0.0; PANEL]));
    }

    /// Sets weights of input `k` from output `at` on.
    pub(super) fn put(&mut self, k: usize, mut at: usize, mut values: &[f32]) {
        while !values.is_empty() {
            let (panel, from) = (at / PANEL, at % PANEL);
            let (now, later) = values.split_at(values.len().min(PANEL - from));
            self.lines[panel * self.inputs + k].0[from..from + now.len()].copy_from_slice(now);
            (at, values) = (at + now.len(), later);
        }
    }

    /// Sets the weights of output `at` from input `k` on.
    pub(super) fn put_column(&mut self, k: usize, at: usize, values: &[f32]) {
        let lines = &mut self.lines[at / PANEL * self.inputs + k..][..values.len()];
        for (line, value) in lines.iter_mut().zip(values) {
            line.0[at % PANEL] = *value;
        }
    }

    /// Outputs, filled up to whole panels.
    pub(super) fn outputs(&self) -> usize {
        self.panels() * PANEL
    }

    pub(super) fn panels(&self) -> usize {
        self.lines.len().checked_div(self.inputs).unwrap_or(0)
    }
}

/// Rows in a longer slice: row r starts at r · stride.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rows<'a> {
    pub(super) data: &'a [f32],
    pub(super) stride: usize,
    pub(super) count: usize,
}

/// Rows of activations as the kernel reads them: in pieces of [`DEPTH`] inputs, then tiles, inputs, rows. Rows that
/// are missing in the last tile are zeros.
#[derive(Clone, Debug, Default)]
pub(super) struct PackedRows {
    count: usize,
    inputs: usize,
    data: Vec<[f32; TILE]>,
}

impl PackedRows {
    /// Packs the first `inputs` numbers of every row, in the memory it has.
    pub(super) fn pack(&mut self, x: Rows<'_>, inputs: usize) {
        let tiles = x.count.div_ceil(TILE);
        (self.count, self.inputs) = (x.count, inputs);
        self.data.resize(tiles * inputs, [0.0; TILE]);
        for from in (0..inputs).step_by(DEPTH) {
            let depth = DEPTH.min(inputs - from);
            let tiles = self.data[tiles * from..][..tiles * depth].chunks_exact_mut(depth);
            for (t, tile) in tiles.enumerate() {
                let row = |r: usize| match t * TILE + r {
                    row if row < x.count => &x.data[row * x.stride + from..][..depth],
                    _ => &ZEROS[..depth],
                };
                for at in (0..TILE).step_by(SIDE) {
                    interleave([row(at), row(at + 1), row(at + 2), row(at + 3)], at, tile);
                }
            }
        }
    }
}

static ZEROS: [f32; DEPTH] = [0.0; DEPTH];

/// Rows that are interleaved at a time.
const SIDE: usize = 4;

/// Element k of some rows next to each other, from place `at` on, in squares of 4 × 4, which compile to shuffles of
/// vectors.
fn interleave([a, b, c, d]: [&[f32]; SIDE], at: usize, tile: &mut [[f32; TILE]]) {
    let (squares, rest) = tile.as_chunks_mut::<SIDE>();
    let whole = SIDE * squares.len();
    let chunks = <[f32]>::as_chunks::<SIDE>;
    let rows = chunks(a).0.iter().zip(chunks(b).0).zip(chunks(c).0).zip(chunks(d).0);
    for (square, (((a, b), c), d)) in squares.iter_mut().zip(rows) {
        for (k, column) in square.iter_mut().enumerate() {
            column[at..at + SIDE].copy_from_slice(&[a[k], b[k], c[k], d[k]]);
        }
    }
    let rows = a[whole..].iter().zip(&b[whole..]).zip(&c[whole..]).zip(&d[whole..]);
    for (column, (((a, b), c), d)) in rest.iter_mut().zip(rows) {
        column[at..at + SIDE].copy_from_slice(&[*a, *b, *c, *d]);
    }
}

/// y = x W, or y + x W, for some panels of W. Row r of y starts at r · `stride`; rows are as wide as these panels.
#[derive(Debug)]
pub(super) struct Product<'a> {
    pub(super) x: &'a PackedRows,
    pub(super) weight: &'a Matrix,
    pub(super) panels: Range<usize>,
    pub(super) y: &'a mut [f32],
    pub(super) stride: usize,
    /// Whether to add to what is there.
    pub(super) add: bool,
}

impl Product<'_> {
    pub(super) fn run(self) {
        let (x, w) = (self.x.inputs, self.weight.inputs);
        assert_eq!(x, w, "rows of {x} do not fit a matrix of {w} inputs");
        super::simd::dispatch(self);
    }
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { x, weight, panels, y, stride, add } = self;
        let (inputs, tiles) = (x.inputs, x.count.div_ceil(TILE));
        for from in (0..inputs).step_by(DEPTH) {
            let depth = DEPTH.min(inputs - from);
            let packed = &x.data[tiles * from..][..tiles * depth];
            for (column, panel) in panels.clone().enumerate() {
                let panel = &weight.lines[panel * inputs + from..][..depth];
                for (t, tile) in packed.chunks_exact(depth).enumerate() {
                    let first = t * TILE;
                    let rows = TILE.min(x.count - first);
                    let data = &mut y[first * stride + column * PANEL..];
                    panel_tile(simd, panel, tile, Out { data, stride, rows, add: add || from > 0 });
                }
            }
        }
    }
}

/// Where a tile's results go: the rows that exist, from the panel's first column on.
struct Out<'a> {
    data: &'a mut [f32],
    stride: usize,
    rows: usize,
    add: bool,
}

/// All rows of a tile against all outputs of a panel, in pieces of two vectors that fill the registers.
#[inline(always)]
fn panel_tile<S: Simd>(simd: S, panel: &[Line], x: &[[f32; TILE]], mut y: Out<'_>) {
    for vector in (0..PANEL / S::F32_LANES).step_by(2) {
        if S::REGISTER_COUNT >= 32 {
            tile::<S, 12, 0>(simd, panel, x, vector, &mut y);
        } else {
            tile::<S, 6, 0>(simd, panel, x, vector, &mut y);
            tile::<S, 6, 6>(simd, panel, x, vector, &mut y);
        }
    }
}

/// Rows FROM .. FROM + ROWS of a tile, two vectors of outputs.
#[inline(always)]
fn tile<S: Simd, const ROWS: usize, const FROM: usize>(
    simd: S,
    panel: &[Line],
    x: &[[f32; TILE]],
    vector: usize,
    y: &mut Out<'_>,
) {
    let mut sums = [[simd.splat_f32s(0.0); 2]; ROWS];
    for (line, x) in panel.iter().zip(x) {
        let weights = S::as_simd_f32s(&line.0).0;
        let (a, b) = (weights[vector], weights[vector + 1]);
        for r in 0..ROWS {
            let x = simd.splat_f32s(x[FROM + r]);
            sums[r][0] = simd.mul_add_e_f32s(x, a, sums[r][0]);
            sums[r][1] = simd.mul_add_e_f32s(x, b, sums[r][1]);
        }
    }
    let width = 2 * S::F32_LANES;
    for (r, sums) in (FROM..y.rows).zip(sums) {
        let row = &mut y.data[r * y.stride + vector * S::F32_LANES..][..width];
        for (value, sum) in S::as_mut_simd_f32s(row).0.iter_mut().zip(sums) {
            *value = if y.add { simd.add_f32s(*value, sum) } else { sum };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sizes around the edges of tiles, panels and depth, against sums in double precision.
    #[test]
    fn a_product_is_the_sum_of_products() {
        let mut packed = PackedRows::default();
        for (count, inputs, outputs) in [(1, 1, 1), (12, 256, 32), (13, 257, 33), (25, 600, 70)] {
            let value = |i: usize| (1.7 * i as f32).sin();
            let x: Vec<f32> = (0..count * inputs).map(value).collect();
            let w: Vec<f32> = (0..inputs * outputs).map(|i| value(3 * i + 1)).collect();
            let weight = Matrix::new(&w, outputs);
            let stride = padded(outputs);
            let mut y = vec![1.0; count * stride];
            for add in [false, true] {
                packed.pack(Rows { data: &x, stride: inputs, count }, inputs);
                let panels = 0..weight.panels();
                Product { x: &packed, weight: &weight, panels, y: &mut y, stride, add }.run();
            }
            for r in 0..count {
                for o in 0..stride {
                    let term = |k: usize| f64::from(x[r * inputs + k]) * f64::from(w[k * outputs + o]);
                    let sum = if o < outputs { 2.0 * (0..inputs).map(term).sum::<f64>() } else { 0.0 };
                    let got = f64::from(y[r * stride + o]);
                    assert!(
                        (got - sum).abs() < 1e-4,
                        "{count} × {inputs} × {outputs}: {got} at {r}, {o}: {sum}"
                    );
                }
            }
        }
    }
}
