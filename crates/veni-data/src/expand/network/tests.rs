//! What becomes of a network's values, by networks that are a few lines of Rust.

use super::*;
use crate::expand::CLIPPED;
use crate::expand::Expand;

const GRID: Equirect = Equirect { width: 32, height: 16 };

/// Planes of an image of \[H, W\] to planes.
type Function = fn(&[f32], [usize; 2]) -> Vec<f32>;

#[derive(Debug)]
struct Written(Function, [Option<usize>; 2]);

impl ExpansionNetwork for Written {
    fn name(&self) -> &str {
        "written.onnx"
    }

    fn size(&self) -> [Option<usize>; 2] {
        self.1
    }

    fn run(&self, planes: Vec<f32>, size: [usize; 2]) -> Result<Vec<f32>> {
        for (side, fixed) in size.iter().zip(self.1) {
            assert!(fixed.map_or(side % 32 == 0, |n| n == *side), "{size:?}");
        }
        assert_eq!(planes.len(), 3 * size[0] * size[1]);
        Ok((self.0)(&planes, size))
    }
}

const FREE: [Option<usize>; 2] = [None, None];

fn times_four(planes: &[f32], _: [usize; 2]) -> Vec<f32> {
    planes.iter().map(|v| 4.0 * v).collect()
}

/// The mean of three neighbours along a row (or column), 0 beyond the edges: a convolution with zero padding.
fn blur(planes: &[f32], [height, width]: [usize; 2], down: bool) -> Vec<f32> {
    let (step, length) = if down { (width, height) } else { (1, width) };
    let mean = |k: usize| {
        let at = k / step % length;
        let before = if at > 0 { planes[k - step] } else { 0.0 };
        let after = if at + 1 < length { planes[k + step] } else { 0.0 };
        2.0 * (before + planes[k] + after)
    };
    (0..planes.len()).map(mean).collect()
}

/// Brightness between `low` and white, with a gradient in every direction; where it is above 1 it is clipped.
fn sky(low: f32) -> LdrPanorama {
    let grid = GRID;
    let values = grid.directions().into_iter().map(|[x, y, z]| {
        let v = low + 0.35 * (x - 0.7 * y + 0.3 * z);
        [v, v + 0.02, v - 0.02]
    });
    LdrPanorama::new(grid, values.collect())
}

fn rotated(ldr: &LdrPanorama, columns: usize) -> LdrPanorama {
    let mut values = ldr.values().to_vec();
    values.chunks_exact_mut(ldr.grid().width).for_each(|row| row.rotate_left(columns));
    LdrPanorama::new(ldr.grid(), values)
}

#[test]
fn clipped_values_are_the_networks_and_others_are_kept() {
    let ldr = sky(0.9);
    let network = Written(times_four, FREE);
    for (input, transfer) in [
        (NetworkInput::Linear, TransferFunction::Srgb),
        (NetworkInput::Srgb, TransferFunction::Srgb),
        (NetworkInput::Linear, TransferFunction::Gamma(2.0)),
        (NetworkInput::Srgb, TransferFunction::Gamma(2.0)),
    ] {
        let options = NetworkOptions { transfer, input, ..Default::default() };
        let done = ldr.expand_by(&network, &options).unwrap();
        let (mut kept, mut clipped) = (0, 0);
        for (&v, &l) in ldr.values().as_flattened().iter().zip(done.panorama.pixels().as_flattened()) {
            let linear = transfer.linear(v);
            let shown = match input {
                NetworkInput::Linear => linear,
                NetworkInput::Srgb => tonemap::srgb(linear),
            };
            if v <= 0.95 {
                assert_eq!(l, linear, "{v} is not clipped");
                kept += 1;
            } else {
                let a = ((v - 0.95) / (CLIPPED - 0.95)).min(1.0);
                let expected = linear + a * (4.0 * shown - linear);
                assert!((l - expected).abs() < 1e-5, "{v}: {l} is not {expected}");
                clipped += usize::from(a == 1.0);
            }
        }
        assert!(kept > 300 && clipped > 300, "{kept} {clipped}");
        assert!(done.clipped > 0.2 && done.clipped < 0.8);
        assert_eq!(done.estimate, Some(Estimate { factor: 1.0, below: 0.0 }));
    }
    // as bright as recorded at least, and said how often that was needed
    let dim = Written(|planes, _| planes.iter().map(|v| 0.5 * v).collect(), FREE);
    let done = ldr.expand_by(&dim, &NetworkOptions::default()).unwrap();
    assert_eq!(done.panorama, ldr.linear(TransferFunction::Srgb));
    assert_eq!(done.estimate.map(|e| e.below), Some(1.0));
    // nothing is near clipping: the network is not even asked
    let panics = Written(|_, _| unreachable!("nothing to estimate"), FREE);
    let done = sky(0.4).expand_by(&panics, &NetworkOptions::default()).unwrap();
    assert_eq!(
        (done.panorama, done.clipped, done.estimate),
        (sky(0.4).linear(TransferFunction::Srgb), 0.0, None)
    );
}

#[test]
fn logarithms_and_foreign_scales_become_radiance_in_units_of_white() {
    let ldr = sky(0.9);
    let linear = NetworkOptions { input: NetworkInput::Linear, ..Default::default() };
    let plain = ldr.expand_by(&Written(times_four, FREE), &linear).unwrap();
    let log = Written(|planes, _| planes.iter().map(|v| (4.0 * v).ln()).collect(), FREE);
    let logs = NetworkOptions { output: NetworkOutput::Log, ..linear.clone() };
    // right where nothing is clipped but for a factor of 1/50, four times as bright where it is
    let dim = Written(
        |planes, _| {
            planes
                .iter()
                .map(|v| if *v < tonemap::srgb_to_linear(KEPT) { v / 50.0 } else { v / 12.5 })
                .collect()
        },
        FREE,
    );
    let matched = NetworkOptions { scale: NetworkScale::Match, ..linear };
    for done in [ldr.expand_by(&log, &logs).unwrap(), ldr.expand_by(&dim, &matched).unwrap()] {
        for (a, b) in done.panorama.pixels().iter().flatten().zip(plain.panorama.pixels().iter().flatten()) {
            assert!((a - b).abs() < 1e-4 * b, "{a} is not {b}");
        }
    }
    let factor = ldr.expand_by(&dim, &matched).unwrap().estimate.unwrap().factor;
    assert!((factor - 50.0).abs() < 1e-3, "{factor}");
    let white = LdrPanorama::new(GRID, vec![[1.0; 3]; GRID.len()]);
    let error = white.expand_by(&dim, &matched).unwrap_err().to_string();
    assert!(error.contains("scale") && error.contains("written.onnx"), "{error}");
}

/// How much it matters by how many columns a panorama was rotated when `expand` saw it.
fn seam(expand: impl Fn(&LdrPanorama) -> Panorama) -> f32 {
    let ldr = sky(1.2);
    let straight = expand(&ldr);
    let mut worst = 0f32;
    for columns in [1, 5, 16] {
        let mut there = expand(&rotated(&ldr, columns));
        there.pixels_mut().chunks_exact_mut(GRID.width).for_each(|row| row.rotate_right(columns));
        let pairs = straight.pixels().iter().flatten().zip(there.pixels().iter().flatten());
        worst = pairs.fold(worst, |w, (a, b)| w.max((a - b).abs()));
    }
    worst
}

#[test]
fn a_convolution_sees_neither_seam_nor_poles() {
    let across = Written(|planes, size| blur(planes, size, false), FREE);
    let options = NetworkOptions { input: NetworkInput::Linear, ..Default::default() };
    assert!(seam(|ldr| ldr.expand_by(&across, &options).unwrap().panorama) < 1e-6);
    // the same network on the bare image has a seam, and the check sees it
    let bare = |ldr: &LdrPanorama| {
        let linear = ldr.linear(TransferFunction::Srgb);
        let planes: Vec<f32> = (0..3).flat_map(|c| linear.pixels().iter().map(move |p| p[c])).collect();
        let out = blur(&planes, [GRID.height, GRID.width], false);
        Panorama::new(GRID, (0..GRID.len()).map(|k| [0, 1, 2].map(|c| out[c * GRID.len() + k])).collect())
    };
    assert!(seam(bare) > 1.0, "{}", seam(bare));

    let down = Written(|planes, size| blur(planes, size, true), FREE);
    let ldr = sky(1.2);
    let linear = ldr.linear(TransferFunction::Srgb);
    let done = ldr.expand_by(&down, &options).unwrap().panorama;
    for column in 0..GRID.width {
        // above the first row is the first row, half a turn away
        for (row, next) in [(0, 1), (GRID.height - 1, GRID.height - 2)] {
            let beyond = linear.pixel((column + GRID.width / 2) % GRID.width, row);
            let values = ldr.values()[row * GRID.width + column];
            for (c, value) in values.into_iter().enumerate() {
                let mean = 2.0 * (beyond[c] + linear.pixel(column, row)[c] + linear.pixel(column, next)[c]);
                assert!(value < CLIPPED || (done.pixel(column, row)[c] - mean).abs() < 1e-5);
            }
        }
    }
}

#[test]
fn a_fixed_size_leaves_no_seam_and_keeps_resolution_elsewhere() {
    // as wrong as can be at its edges: it rises from 2 to 4 along a row
    fn ramp(planes: &[f32], [_, width]: [usize; 2]) -> Vec<f32> {
        (0..planes.len()).map(|k| 2.0 + 2.0 * (k % width) as f32 / width as f32).collect()
    }
    let white = LdrPanorama::new(GRID, vec![[1.0; 3]; GRID.len()]);
    let step = |row: &[f32]| {
        let around = (0..row.len()).map(|i| (row[i] - row[(i + 1) % row.len()]).abs());
        around.fold(0f32, f32::max)
    };
    let same = [Some(GRID.height), Some(GRID.width)];
    let done = white.expand_by(&Written(ramp, same), &NetworkOptions::default()).unwrap();
    let row: Vec<f32> = done.panorama.pixels()[..GRID.width].iter().map(|p| p[1]).collect();
    assert!(step(&row) < 0.2, "{row:?}");
    assert!(step(&ramp(&[0.0; 32], [1, GRID.width])) > 1.9, "the network's own edge would be seen");

    // of another size and shape: what is not clipped is not resampled
    let ldr = sky(0.9);
    let options = NetworkOptions { input: NetworkInput::Linear, ..Default::default() };
    for size in [[Some(8), Some(16)], [Some(20), Some(20)], [None, Some(16)], [Some(8), None]] {
        let done = ldr.expand_by(&Written(times_four, size), &options).unwrap().panorama;
        let mut off = 0f32;
        for (&v, &l) in ldr.values().as_flattened().iter().zip(done.pixels().as_flattened()) {
            let linear = tonemap::srgb_to_linear(v);
            assert!(v > KEPT || l == linear, "{size:?}: {v}");
            off = if v >= CLIPPED { off.max((l / (4.0 * linear)).ln().abs()) } else { off };
        }
        assert!(off < 0.15, "{size:?}: {off}");
    }
    let large = NetworkOptions { grid: Some(Equirect::new(64, 32)), ..options };
    assert!(ldr.expand_by(&Written(times_four, FREE), &large).is_ok());
    let error = ldr.expand_by(&Written(times_four, same), &large).unwrap_err().to_string();
    for word in ["written.onnx", "32 × 16", "64 × 32"] {
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn what_is_no_radiance_is_refused() {
    let ldr = sky(0.9);
    let refused = |function: Function, output: NetworkOutput, words: &[&str]| {
        let options = NetworkOptions { output, ..Default::default() };
        let error = ldr.expand_by(&Written(function, FREE), &options).unwrap_err().to_string();
        for word in ["written.onnx"].iter().chain(words) {
            assert!(error.contains(word), "'{word}' is missing in: {error}");
        }
    };
    let one_nan: Function =
        |planes, _| planes.iter().enumerate().map(|(k, v)| if k == 7 { f32::NAN } else { *v }).collect();
    refused(one_nan, NetworkOutput::Linear, &["1 of the", "not numbers"]);
    refused(one_nan, NetworkOutput::Log, &["1 of the", "not numbers"]);
    refused(|planes, _| vec![f32::INFINITY; planes.len()], NetworkOutput::Linear, &["infinite"]);
    refused(|planes, _| vec![100.0; planes.len()], NetworkOutput::Log, &["as logarithms", "infinite"]);
    refused(|planes, _| vec![-1.0; planes.len()], NetworkOutput::Linear, &["negative"]);
    refused(|planes, _| vec![1.0; planes.len() - 1], NetworkOutput::Linear, &["values where"]);
    // below zero where nothing is taken from it: many a network does that in the dark
    let dark =
        Written(|planes, _| planes.iter().map(|v| if *v < 0.9 { -0.1 } else { 4.0 * v }).collect(), FREE);
    assert!(ldr.expand_by(&dark, &NetworkOptions::default()).is_ok());
}
