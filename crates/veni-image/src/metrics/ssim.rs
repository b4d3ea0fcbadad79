//! Structural similarity (Wang et al. 2004) as the common implementation computes it.

const SIGMA: f64 = 1.5;
const TAPS: usize = 11;
const K1: f64 = 0.01;
const K2: f64 = 0.03;

/// Mean structural similarity of two images [height, width, channels]: Gaussian window of 11 × 11 pixels,
/// σ = 1.5, mirrored at the edges (the edge pixel itself is not repeated), k₁ = 0.01, k₂ = 0.03; the data
/// range is the larger of the two images' own. Mean over all pixels and channels. 1 for equal images,
/// constant ones included.
///
/// # Panics
/// If a length disagrees with the shape, or a side is shorter than 6 pixels.
pub fn ssim(prediction: &[f64], target: &[f64], shape: [usize; 3]) -> f64 {
    let [height, width, channels] = shape;
    let count = height * width * channels;
    assert!(prediction.len() == count && target.len() == count, "images of {shape:?} hold {count} values");
    assert!(height.min(width) > TAPS / 2, "SSIM needs more than {} pixels a side, got {shape:?}", TAPS / 2);
    let extent = |x: &[f64]| {
        let (low, high) = x.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
        high - low
    };
    let range = extent(prediction).max(extent(target));
    if range == 0.0 {
        // Two constants: contrast and structure say nothing, the luminance term with c = 0 does.
        let (a, b) = (prediction[0], target[0]);
        return if a == b { 1.0 } else { 2.0 * a * b / (a * a + b * b) };
    }
    let (c1, c2) = ((K1 * range).powi(2), (K2 * range).powi(2));
    let product = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(x, y)| x * y).collect() };
    let (mean_p, mean_i) = (blur(prediction, shape), blur(target, shape));
    let pp = blur(&product(prediction, prediction), shape);
    let ii = blur(&product(target, target), shape);
    let pi = blur(&product(prediction, target), shape);
    let similarity = |k: usize| {
        let (p, i) = (mean_p[k], mean_i[k]);
        let (variance_p, variance_i) = ((pp[k] - p * p).max(0.0), (ii[k] - i * i).max(0.0));
        let covariance = pi[k] - p * i;
        (2.0 * p * i + c1) * (2.0 * covariance + c2) / ((p * p + i * i + c1) * (variance_p + variance_i + c2))
    };
    (0..count).map(similarity).sum::<f64>() / count as f64
}

/// The Gaussian window along both axes.
fn blur(image: &[f64], [height, width, channels]: [usize; 3]) -> Vec<f64> {
    let weights: [f64; TAPS] = std::array::from_fn(|t| {
        let x = t as f64 - (TAPS / 2) as f64;
        (-x * x / (2.0 * SIGMA * SIGMA)).exp()
    });
    let total: f64 = weights.iter().sum();
    let weights = weights.map(|w| w / total);
    let along = |image: &[f64], length: usize, stride: usize| -> Vec<f64> {
        let value = |k: usize| {
            let position = k / stride % length;
            let start = k - position * stride;
            let tap = |t: usize| image[start + mirrored(position + t, length) * stride] * weights[t];
            (0..TAPS).map(tap).sum::<f64>()
        };
        (0..image.len()).map(value).collect()
    };
    debug_assert_eq!(image.len(), height * width * channels);
    let rows = along(image, width, channels);
    along(&rows, height, width * channels)
}

/// Position `shifted` − 5 on an axis of `length` that is mirrored at its end elements.
fn mirrored(shifted: usize, length: usize) -> usize {
    let position = shifted.abs_diff(TAPS / 2);
    if position >= length { 2 * (length - 1) - position } else { position }
}
