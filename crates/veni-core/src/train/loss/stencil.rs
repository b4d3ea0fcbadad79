//! 3 × 3 stencils on image planes as products with small constant matrices, so that forward and backward
//! are a few matrix products and no padding, shifting or copying. MODEL (29).

use burn::tensor::{Device, Tensor, TensorData};

/// A 3 × 3 stencil as a sum of (vertical taps) ⊗ (horizontal taps).
pub type Stencil = &'static [([f64; 3], [f64; 3])];

/// Scharr's derivative along a row of the image.
pub const SCHARR_HORIZONTAL: Stencil = &[([3.0, 10.0, 3.0], [-1.0, 0.0, 1.0])];
/// Scharr's derivative along a column.
pub const SCHARR_VERTICAL: Stencil = &[([-1.0, 0.0, 1.0], [3.0, 10.0, 3.0])];
/// What the reference implementation has in place of [`SCHARR_VERTICAL`]: [−3 10 −3 / 0 0 0 / 3 10 3]. Its entries
/// sum to 20, so it is not a derivative.
pub const REFERENCE_VERTICAL: Stencil =
    &[([1.0, 0.0, 0.0], [-3.0, 10.0, -3.0]), ([0.0, 0.0, 1.0], [3.0, 10.0, 3.0])];
/// The five-point Laplacian.
pub const LAPLACE: Stencil = &[([0.0, 1.0, 0.0], [1.0, -2.0, 1.0]), ([1.0, -2.0, 1.0], [0.0, 1.0, 0.0])];

/// What happens at the ends of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// Only positions where the stencil fits: two fewer.
    Valid,
    /// The axis closes on itself.
    Periodic,
}

/// How an axis is made coarser by a factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coarsen {
    /// Every k-th element, from the first.
    Stride,
    /// Means of k elements; an incomplete rest is dropped.
    Average,
}

impl Coarsen {
    /// Elements left of `n`.
    pub fn count(self, n: usize, factor: usize) -> usize {
        match self {
            Self::Stride => n.div_ceil(factor),
            Self::Average => n / factor,
        }
    }
}

/// A dense row-major matrix of constants.
struct Matrix {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

/// Coarsening by `factor` followed by three taps, [outputs, n].
fn axis(n: usize, factor: usize, coarsen: Coarsen, taps: [f64; 3], edge: Edge) -> Matrix {
    let coarse = coarsen.count(n, factor);
    assert!(coarse >= 3, "an axis of {n} pixels coarsened {factor} times is too short for a 3 × 3 stencil");
    let rows = if edge == Edge::Valid { coarse - 2 } else { coarse };
    let mut values = vec![0.0; rows * n];
    for row in 0..rows {
        for (t, tap) in taps.into_iter().enumerate() {
            // Periodic outputs sit on their element, valid ones begin one further.
            let at = if edge == Edge::Valid { row + t } else { (row + t + coarse - 1) % coarse };
            match coarsen {
                Coarsen::Stride => values[row * n + at * factor] += tap,
                Coarsen::Average => {
                    for k in 0..factor {
                        values[row * n + at * factor + k] += tap / factor as f64;
                    }
                }
            }
        }
    }
    Matrix { rows, columns: n, values }
}

/// A stencil on a coarsened image, prepared for planes [M, H, W·C] (channels interleaved).
#[derive(Clone, Debug)]
pub struct Filter {
    /// Per term: vertical [1, H', H], horizontal [W·C, W'·C].
    terms: Vec<(Tensor<3>, Tensor<2>)>,
}

/// An axis pair's size, coarsening and edges.
#[derive(Clone, Copy, Debug)]
pub struct StencilGrid {
    /// Rows and columns of the image.
    pub size: [usize; 2],
    /// Interleaved channels.
    pub channels: usize,
    /// The factor by which both axes are made coarser.
    pub factor: usize,
    /// How they are.
    pub coarsen: Coarsen,
    /// Ends of the columns' axis; rows are always [`Edge::Valid`].
    pub horizontal_edge: Edge,
}

impl Filter {
    /// # Panics
    /// If an axis has fewer than three elements after coarsening.
    pub fn new(stencil: Stencil, grid: StencilGrid, device: &Device) -> Self {
        let ([height, width], channels) = (grid.size, grid.channels);
        let term = |&(vertical, horizontal): &([f64; 3], [f64; 3])| {
            let v = axis(height, grid.factor, grid.coarsen, vertical, Edge::Valid);
            let h = axis(width, grid.factor, grid.coarsen, horizontal, grid.horizontal_edge);
            let (v_shape, h_shape) = ([1, v.rows, v.columns], [h.columns * channels, h.rows * channels]);
            let v: Vec<f32> = v.values.iter().map(|x| *x as f32).collect();
            let mut columns = vec![0.0f32; h_shape[0] * h_shape[1]];
            for row in 0..h.rows {
                for column in 0..h.columns {
                    for c in 0..channels {
                        columns[(column * channels + c) * h_shape[1] + row * channels + c] =
                            h.values[row * h.columns + column] as f32;
                    }
                }
            }
            let vertical = Tensor::from_data(TensorData::new(v, v_shape), device);
            (vertical, Tensor::from_data(TensorData::new(columns, h_shape), device))
        };
        Self { terms: stencil.iter().map(term).collect() }
    }

    /// Planes [M, H, W·C] → [M, H', W'·C].
    pub fn apply(&self, planes: Tensor<3>) -> Tensor<3> {
        let term = |(vertical, horizontal): &(Tensor<3>, Tensor<2>)| {
            let x = vertical.clone().matmul(planes.clone());
            let [m, h, w] = x.dims();
            let columns = horizontal.dims()[1];
            x.reshape([m * h, w]).matmul(horizontal.clone()).reshape([m, h, columns])
        };
        self.terms.iter().map(term).reduce(|a, b| a + b).expect("a stencil has at least one term")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dense(stencil: Stencil) -> [[f64; 3]; 3] {
        let mut out = [[0.0; 3]; 3];
        for (vertical, horizontal) in stencil {
            for (i, v) in vertical.iter().enumerate() {
                for (j, h) in horizontal.iter().enumerate() {
                    out[i][j] += v * h;
                }
            }
        }
        out
    }

    #[test]
    fn stencils_are_what_their_names_say() {
        assert_eq!(dense(SCHARR_HORIZONTAL), [[-3.0, 0.0, 3.0], [-10.0, 0.0, 10.0], [-3.0, 0.0, 3.0]]);
        assert_eq!(dense(SCHARR_VERTICAL), [[-3.0, -10.0, -3.0], [0.0, 0.0, 0.0], [3.0, 10.0, 3.0]]);
        assert_eq!(dense(REFERENCE_VERTICAL), [[-3.0, 10.0, -3.0], [0.0, 0.0, 0.0], [3.0, 10.0, 3.0]]);
        assert_eq!(dense(LAPLACE), [[0.0, 1.0, 0.0], [1.0, -4.0, 1.0], [0.0, 1.0, 0.0]]);
    }

    #[test]
    fn filters_agree_with_a_plain_loop() {
        let (height, width, channels) = (8, 10, 2);
        let value =
            |j: usize, i: usize, c: usize| (1.3 * j as f64 + 0.7 * (i * i) as f64 + 2.0 * c as f64).sin();
        let mut data = Vec::new();
        for j in 0..height {
            for i in 0..width {
                data.extend((0..channels).map(|c| value(j, i, c) as f32));
            }
        }
        let device = Device::flex();
        let planes = Tensor::from_data(TensorData::new(data, [1, height, width * channels]), &device);
        for coarsen in [Coarsen::Stride, Coarsen::Average] {
            for edge in [Edge::Valid, Edge::Periodic] {
                let grid = StencilGrid {
                    size: [height, width],
                    channels,
                    factor: 2,
                    coarsen,
                    horizontal_edge: edge,
                };
                let out = Filter::new(REFERENCE_VERTICAL, grid, &device).apply(planes.clone());
                let columns = if edge == Edge::Valid { 3 } else { 5 };
                assert_eq!(out.dims(), [1, 2, columns * channels]);
                let out: Vec<f32> = out.into_data().try_into_vec().unwrap();
                let coarse = |j: usize, i: usize, c: usize| match coarsen {
                    Coarsen::Stride => value(2 * j, 2 * i, c),
                    Coarsen::Average => {
                        let four = [(0, 0), (0, 1), (1, 0), (1, 1)];
                        four.iter().map(|(a, b)| value(2 * j + a, 2 * i + b, c)).sum::<f64>() / 4.0
                    }
                };
                let kernel = dense(REFERENCE_VERTICAL);
                for (at, ours) in out.iter().enumerate() {
                    let (j, i, c) = (at / (columns * channels), at / channels % columns, at % channels);
                    let mut sum = 0.0;
                    for (dj, row) in kernel.iter().enumerate() {
                        for (di, k) in row.iter().enumerate() {
                            let column = if edge == Edge::Valid { i + di } else { (i + di + 4) % 5 };
                            sum += k * coarse(j + dj, column, c);
                        }
                    }
                    assert!((sum - f64::from(*ours)).abs() < 1e-5, "{coarsen:?} {edge:?} {at}: {sum} {ours}");
                }
            }
        }
    }
}
