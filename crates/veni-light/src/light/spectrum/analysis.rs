//! From pixels to coefficients: FFT along rows, Legendre functions along columns.
//!
//! With X the Fourier transform of a row, Σ_i f_i e^{imφ_i} = (−1)^m e^{−iπm/W} X_m, since φ_i = π − 2π(i + ½)/W. A pixel's
//! integral along φ adds the factor 2π/W · sinc(πm/W). Along θ a row holds ∫ P̄_lm(cos θ) sin θ dθ over its band. A row and
//! its mirror image below the horizon share P̄_lm up to the sign (−1)^{l+m}.

use std::f64::consts::PI;
use std::sync::Arc;

use realfft::num_complex::Complex32;
use realfft::{RealFftPlanner, RealToComplex};

use super::legendre::{LANES, Lanes, Latitudes, Order, orders};
use super::{Coefficient, EnvironmentMap};
use crate::light::quadrature::gauss_legendre;
use crate::light::reduce::Reduced;
use crate::sphere::Equirect;
use crate::tasks;

/// Sums of eight rows and their mirror images, and differences: cosine and sine parts of R, G, B at one order.
type Pairs = [[[f32; LANES]; 6]; 2];

/// Quadrature nodes of eight rows.
struct Node {
    at: Latitudes,
    weight: Lanes,
}

pub(super) fn analyse(map: EnvironmentMap<'_>, degree: usize) -> Vec<Coefficient> {
    // four pixels for the shortest wave that is asked for, and never less than 1024 columns
    let reduced = Reduced::to_width(map, (4 * (degree + 1)).max(1024));
    let map = reduced.map();
    let grid = map.grid();
    let blocks = nodes(grid, degree);
    let rows = transformed(map, degree, blocks.len());
    let orders = orders(degree);
    // the first orders have the most degrees: begun first, they do not come last
    let columns = tasks::map(
        orders.iter().enumerate(),
        || (),
        |(), (m, order)| {
            let width = {
                let x = PI * m as f64 / grid.width as f64;
                2.0 * PI / grid.width as f64 * if m == 0 { 1.0 } else { x.sin() / x }
            };
            pulp::Arch::new().dispatch(|| column(order, degree, &blocks, &rows, m, width))
        },
    );
    columns.into_iter().flatten().collect()
}

/// For blocks of eight rows from the top to the equator, the nodes of their quadrature along θ.
fn nodes(grid: Equirect, degree: usize) -> Vec<Vec<Node>> {
    let step = PI / grid.height as f64;
    // two nodes per row are exact to 1e-4 for waves of four rows
    let rule = gauss_legendre((degree as f64 * step / 0.8).ceil().max(2.0) as usize);
    let pairs = grid.height.div_ceil(2);
    (0..pairs.div_ceil(LANES))
        .map(|block| {
            let row = |lane: usize| block * LANES + lane;
            // the weights of a row sum to its band exactly, so that energy is exact
            let band = |j: usize| grid.solid_angle(j) * grid.width as f64 / (2.0 * PI);
            let polar = |j: usize, x: f64| step * (j as f64 + 0.5 + 0.5 * x);
            let sum = |j: usize| rule.iter().map(|(x, w)| w * polar(j, *x).sin()).sum::<f64>();
            rule.iter()
                .map(|(x, w)| Node {
                    // lanes past the equator repeat the last row with weight 0
                    at: Latitudes::new(std::array::from_fn(|k| polar(row(k).min(pairs - 1), *x))),
                    weight: std::array::from_fn(|k| {
                        let j = row(k);
                        if j < pairs { band(j) * w * polar(j, *x).sin() / sum(j) } else { 0.0 }
                    }),
                })
                .collect()
        })
        .collect()
}

/// The Fourier coefficients of all rows, for each block those of every order.
fn transformed(map: EnvironmentMap<'_>, degree: usize, blocks: usize) -> Vec<Pairs> {
    let Equirect { width, height } = map.grid();
    let fft = RealFftPlanner::<f32>::new().plan_fft_forward(width);
    let phases: Vec<Complex32> = (0..=degree)
        .map(|m| {
            let sign = if m % 2 == 0 { 1.0 } else { -1.0 };
            let (s, c) = (PI * m as f64 / width as f64).sin_cos();
            Complex32::new((sign * c) as f32, (-sign * s) as f32)
        })
        .collect();
    let mut out = vec![[[[0.0; LANES]; 6]; 2]; blocks * (degree + 1)];
    tasks::each(
        out.chunks_exact_mut(degree + 1).enumerate(),
        || RowTransform::new(&fft, width),
        |transform, (block, out)| {
            for lane in 0..LANES {
                let (north, south) = (block * LANES + lane, (height - 1).wrapping_sub(block * LANES + lane));
                if north >= height.div_ceil(2) {
                    break;
                }
                for channel in 0..3 {
                    for (row, sign) in [(north, 1.0), (south, -1.0)] {
                        // the middle row of an odd number is its own mirror image
                        if sign < 0.0 && north == south {
                            continue;
                        }
                        transform.run(&map.pixels()[row * width..][..width], channel);
                        for (m, (out, phase)) in out.iter_mut().zip(&phases).enumerate() {
                            let value = transform.at(m) * phase;
                            for (part, v) in [(channel, value.re), (channel + 3, value.im)] {
                                out[0][part][lane] += v;
                                out[1][part][lane] += sign * v;
                            }
                        }
                    }
                }
            }
        },
    );
    out
}

/// Workspace for the Fourier transform of rows.
struct RowTransform {
    fft: Arc<dyn RealToComplex<f32>>,
    input: Vec<f32>,
    output: Vec<Complex32>,
    scratch: Vec<Complex32>,
}

impl RowTransform {
    fn new(fft: &Arc<dyn RealToComplex<f32>>, width: usize) -> Self {
        Self {
            fft: fft.clone(),
            input: vec![0.0; width],
            output: fft.make_output_vec(),
            scratch: fft.make_scratch_vec(),
        }
    }

    fn run(&mut self, row: &[[f32; 3]], channel: usize) {
        for (to, pixel) in self.input.iter_mut().zip(row) {
            *to = pixel[channel];
        }
        let done = self.fft.process_with_scratch(&mut self.input, &mut self.output, &mut self.scratch);
        // it refuses buffers of other lengths only, and these are its own
        debug_assert!(done.is_ok());
    }

    /// Frequency m, which repeats with the width: beyond half of it, a pixel's own shape makes the wave.
    fn at(&self, m: usize) -> Complex32 {
        let width = self.input.len();
        let k = m % width;
        if k < self.output.len() { self.output[k] } else { self.output[width - k].conj() }
    }
}

/// All degrees of one order.
#[inline(always)]
fn column(
    order: &Order,
    degree: usize,
    blocks: &[Vec<Node>],
    rows: &[Pairs],
    m: usize,
    width: f64,
) -> Vec<Coefficient> {
    struct State<'a> {
        nodes: &'a [Node],
        pairs: &'a Pairs,
        /// P̄ of this degree and the one before, times the node's weight.
        p: Vec<[Lanes; 2]>,
    }
    let mut states: Vec<State<'_>> = blocks
        .iter()
        .enumerate()
        .filter(|(_, nodes)| !nodes.iter().all(|node| order.negligible(&node.at, degree)))
        .map(|(block, nodes)| State {
            nodes,
            pairs: &rows[block * (degree + 1) + m],
            p: (nodes.iter())
                .map(|node| {
                    let first = order.first(&node.at);
                    [std::array::from_fn(|k| first[k] * node.weight[k]), [0.0; LANES]]
                })
                .collect(),
        })
        .collect();
    let mut out = Vec::with_capacity(degree + 1 - m);
    for l in m..=degree {
        let mut sums = [[0.0; LANES]; 6];
        for state in &mut states {
            let mut band = [0.0; LANES];
            for ([current, before], node) in state.p.iter_mut().zip(state.nodes) {
                if l > m {
                    Order::step(order.factors[l - m - 1], &node.at.cos, current, before);
                }
                for k in 0..LANES {
                    band[k] += current[k];
                }
            }
            for (sum, values) in sums.iter_mut().zip(&state.pairs[(l - m) % 2]) {
                for k in 0..LANES {
                    sum[k] += band[k] * f64::from(values[k]);
                }
            }
        }
        out.push(sums.map(|lanes| width * lanes.iter().sum::<f64>()));
    }
    out
}
