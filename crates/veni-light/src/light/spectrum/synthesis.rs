//! From coefficients to rings of latitude: Legendre functions along columns, inverse FFT along rows.

use std::f64::consts::PI;
use std::sync::Arc;

use realfft::num_complex::Complex32;
use realfft::{ComplexToReal, RealFftPlanner};

use super::legendre::{LANES, Latitudes, Order, orders};
use super::{Rings, Spectrum};
use crate::sphere::Equirect;
use crate::tasks;

/// The spectrum times one gain per degree, on rings that hold three samples of the shortest wave.
pub(super) fn synthesise(spectrum: &Spectrum, gains: &[f64]) -> Rings {
    let degree = spectrum.degree.min(gains.len().saturating_sub(1));
    let grid = grid(degree);
    let orders = orders(degree);
    let fft = RealFftPlanner::<f32>::new().plan_fft_inverse(grid.width);
    let blocks = (grid.height / 2) / LANES;
    let bands = tasks::map(
        0..blocks,
        || Workspace::new(&fft),
        |work, block| pulp::Arch::new().dispatch(|| band(spectrum, gains, grid, &orders, block, work)),
    );
    let mut pixels = vec![[0.0; 3]; grid.len()];
    for (block, rows) in bands.iter().enumerate() {
        for (k, row) in rows.chunks_exact(grid.width).enumerate() {
            let lane = block * LANES + k / 2;
            let to = if k % 2 == 0 { lane } else { grid.height - 1 - lane };
            pixels[to * grid.width..][..grid.width].copy_from_slice(row);
        }
    }
    Rings::new(grid, &pixels)
}

/// Three columns per wave of the highest order, of a width whose transform is fast,
/// rows in whole blocks.
fn grid(degree: usize) -> Equirect {
    let least = 3 * (degree + 1);
    let width =
        [32, 48, 64, 80, 96, 128, 160, 192, 224, 256, 320, 384, 448, 512, 640, 768, 896, 1024, 1280, 1536]
            .into_iter()
            .chain((7..).map(|k| 256 * k))
            .find(|w| *w >= least && (w / 4) % LANES == 0);
    let width = width.unwrap_or(least);
    Equirect::new(width, width / 2)
}

/// What a thread keeps from block to block.
struct Workspace {
    fft: Arc<dyn ComplexToReal<f32>>,
    /// For each row (north, south, alternating) and channel the spectrum along φ.
    waves: Vec<Complex32>,
    row: Vec<f32>,
    scratch: Vec<Complex32>,
}

impl Workspace {
    fn new(fft: &Arc<dyn ComplexToReal<f32>>) -> Self {
        Self {
            waves: vec![Complex32::default(); 2 * LANES * 3 * (fft.len() / 2 + 1)],
            row: fft.make_output_vec(),
            scratch: fft.make_scratch_vec(),
            fft: fft.clone(),
        }
    }
}

/// Eight rows and their mirror images, alternating.
#[inline(always)]
fn band(
    spectrum: &Spectrum,
    gains: &[f64],
    grid: Equirect,
    orders: &[Order],
    block: usize,
    work: &mut Workspace,
) -> Vec<[f32; 3]> {
    let at = Latitudes::new(std::array::from_fn(|k| grid.polar(block * LANES + k)));
    let bins = grid.width / 2 + 1;
    let degree = orders.len() - 1;
    work.waves.fill(Complex32::default());
    for (m, order) in orders.iter().enumerate() {
        if order.negligible(&at, degree) {
            // the higher ones are, too
            break;
        }
        let (mut p, mut before) = (order.first(&at), [0.0; LANES]);
        // even and odd l + m apart: they have the same and the opposite sign below the horizon
        let mut sums = [[[0.0; LANES]; 6]; 2];
        for (l, (coefficient, gain)) in spectrum.order(m).iter().zip(&gains[m..=degree]).enumerate() {
            if l > 0 {
                Order::step(order.factors[l - 1], &at.cos, &mut p, &mut before);
            }
            for (sum, c) in sums[l % 2].iter_mut().zip(coefficient) {
                let scaled = c * gain;
                for k in 0..LANES {
                    sum[k] += scaled * p[k];
                }
            }
        }
        let sign = if m % 2 == 0 { 1.0 } else { -1.0 };
        let half = if m == 0 { 1.0 } else { 0.5 };
        let (s, c) = (PI * m as f64 / grid.width as f64).sin_cos();
        let (re, im) = (sign * half * c, sign * half * s);
        for row in 0..2 * LANES {
            let (lane, south) = (row / 2, row % 2 == 1);
            let value = |part: usize| {
                let [even, odd] = [sums[0][part][lane], sums[1][part][lane]];
                if south { even - odd } else { even + odd }
            };
            for channel in 0..3 {
                let (a, b) = (value(channel), value(channel + 3));
                let wave = Complex32::new((a * re - b * im) as f32, (a * im + b * re) as f32);
                work.waves[(row * 3 + channel) * bins + m] = wave;
            }
        }
    }
    let mut rows = vec![[0.0; 3]; 2 * LANES * grid.width];
    for (row, waves) in rows.chunks_exact_mut(grid.width).zip(work.waves.chunks_exact_mut(3 * bins)) {
        for (channel, wave) in waves.chunks_exact_mut(bins).enumerate() {
            // a wave of order 0 is real
            wave[0].im = 0.0;
            let done = work.fft.process_with_scratch(wave, &mut work.row, &mut work.scratch);
            // it refuses buffers of other lengths only, and these are its own
            debug_assert!(done.is_ok());
            for (pixel, v) in row.iter_mut().zip(&work.row) {
                pixel[channel] = *v;
            }
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::EnvironmentMap;

    #[test]
    fn grids_have_whole_blocks_and_three_columns_per_wave() {
        for degree in 0..1024 {
            let Equirect { width, height } = grid(degree);
            assert!(width >= 3 * (degree + 1) && width <= 5 * (degree + 1) + 32, "{degree}: {width}");
            assert!(height / 2 % LANES == 0 && 2 * height == width, "{degree}: {width} × {height}");
        }
    }

    /// What was analysed comes back: a function of few degrees at any direction.
    #[test]
    fn there_and_back() {
        let f = |[x, y, z]: [f32; 3]| [2.0 + x * y - z, 1.5 + z * z * x, 2.0 + y - 0.5 * x * x];
        let fine = Equirect::new(1024, 512);
        let pixels: Vec<[f32; 3]> = fine.directions().into_iter().map(f).collect();
        let spectrum = Spectrum::of(EnvironmentMap::new(fine, &pixels).unwrap(), 8);
        let rings = spectrum.convolved(&[1.0; 9]);
        for d in
            Equirect::new(37, 18).directions().into_iter().chain([[0., 0., 1.], [0., 0., -1.], [-1., 0., 0.]])
        {
            for (found, expected) in rings.at(d).into_iter().zip(f(d)) {
                assert!((found - expected).abs() < 1e-3, "{d:?}: {found} for {expected}");
            }
        }
    }
}
