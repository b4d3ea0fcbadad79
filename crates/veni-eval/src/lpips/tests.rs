use std::path::{Path, PathBuf};

use super::weights::{LAYERS, LayerWeights};
use super::*;
use veni_light::random::{Purpose, stream};

/// Pseudo-random weights that keep activations of order 1; heads are positive, as trained ones are.
fn filler() -> Vec<LayerWeights> {
    let mut rng = stream(7, Purpose::Weights, 0, 0);
    let layer = |l: &Convolution| {
        let inputs = l.inputs * l.kernel * l.kernel;
        let amplitude = (6.0 / inputs as f64).sqrt();
        let weight = (0..l.outputs * inputs).map(|_| (amplitude * rng.signed()) as f32).collect();
        let bias = (0..l.outputs).map(|_| (0.1 * rng.signed()) as f32).collect();
        let head = (0..l.outputs).map(|_| rng.uniform() as f32).collect();
        LayerWeights { weight, bias, head }
    };
    LAYERS.iter().map(layer).collect()
}

fn image(seed: u64, height: usize, width: usize) -> Vec<f32> {
    let mut rng = stream(seed, Purpose::Noise, 0, 0);
    (0..3 * height * width).map(|_| rng.uniform() as f32).collect()
}

/// Planes [channel][row][column] in f64.
struct Planes(Vec<Vec<Vec<f64>>>);

impl Planes {
    fn side(&self) -> (usize, usize) {
        (self.0[0].len(), self.0[0][0].len())
    }

    fn at(&self, c: usize, y: i64, x: i64) -> f64 {
        let (h, w) = self.side();
        let inside = (0..h as i64).contains(&y) && (0..w as i64).contains(&x);
        if inside { self.0[c][y as usize][x as usize] } else { 0.0 }
    }

    fn map(channels: usize, h: usize, w: usize, f: impl Fn(usize, usize, usize) -> f64) -> Self {
        let row = |c, y| (0..w).map(|x| f(c, y, x)).collect();
        Self((0..channels).map(|c| (0..h).map(|y| row(c, y)).collect()).collect())
    }
}

/// The definition, sum by sum; numbers of AlexNet written out again so that a wrong table is seen.
fn by_definition(weights: &[LayerWeights], a: &[f32], b: &[f32], height: usize, width: usize) -> f64 {
    let (shift, scale) = ([-0.030, -0.088, -0.188], [0.458, 0.448, 0.450]);
    let input = |image: &[f32]| {
        Planes::map(3, height, width, |c, y, x| {
            (2.0 * f64::from(image[(y * width + x) * 3 + c]) - 1.0 - shift[c]) / scale[c]
        })
    };
    let (mut a, mut b) = (input(a), input(b));
    let mut distance = 0.0;
    for (l, w) in weights.iter().enumerate() {
        let (kernel, stride, padding, pooled) =
            [(11, 4, 2, false), (5, 1, 2, true), (3, 1, 1, true), (3, 1, 1, false), (3, 1, 1, false)][l];
        (a, b) =
            (layer(&a, w, kernel, stride, padding, pooled), layer(&b, w, kernel, stride, padding, pooled));
        let (h, wide) = a.side();
        let length =
            |p: &Planes, y: usize, x: usize| p.0.iter().map(|c| c[y][x].powi(2)).sum::<f64>().sqrt() + 1e-10;
        for y in 0..h {
            for x in 0..wide {
                let (la, lb) = (length(&a, y, x), length(&b, y, x));
                for c in 0..w.head.len() {
                    let difference = a.0[c][y][x] / la - b.0[c][y][x] / lb;
                    distance += f64::from(w.head[c]) * difference.powi(2) / (h * wide) as f64;
                }
            }
        }
    }
    distance
}

fn layer(
    input: &Planes,
    w: &LayerWeights,
    kernel: usize,
    stride: usize,
    padding: i64,
    pooled: bool,
) -> Planes {
    let channels = input.0.len();
    let pool = |p: &Planes| {
        let (h, wide) = p.side();
        Planes::map(channels, (h - 3) / 2 + 1, (wide - 3) / 2 + 1, |c, y, x| {
            let window = (0..9).map(|k| p.0[c][2 * y + k / 3][2 * x + k % 3]);
            window.fold(f64::NEG_INFINITY, f64::max)
        })
    };
    let pooled_input;
    let input = if pooled {
        pooled_input = pool(input);
        &pooled_input
    } else {
        input
    };
    let (h, wide) = input.side();
    let out = |side: usize| (side + 2 * padding as usize - kernel) / stride + 1;
    Planes::map(w.bias.len(), out(h), out(wide), |o, y, x| {
        let mut sum = f64::from(w.bias[o]);
        for c in 0..channels {
            for ky in 0..kernel {
                for kx in 0..kernel {
                    let weight = f64::from(w.weight[((o * channels + c) * kernel + ky) * kernel + kx]);
                    let (y, x) = ((y * stride + ky) as i64 - padding, (x * stride + kx) as i64 - padding);
                    sum += weight * input.at(c, y, x);
                }
            }
        }
        sum.max(0.0)
    })
}

#[test]
fn distances_are_those_of_the_definition() {
    let (h, w) = (33, 47);
    let weights = filler();
    let (a, b) = (image(1, h, w), image(2, h, w));
    let expected = by_definition(&weights, &a, &b, h, w);
    let lpips = Lpips::new(weights, &Device::flex());
    let ours = lpips.distance(&a, &b, h, w).unwrap();
    assert!((ours - expected).abs() < 2e-5 * expected && expected > 1e-2, "{ours} instead of {expected}");
    let back = lpips.distance(&b, &a, h, w).unwrap();
    assert!((ours - back).abs() < 1e-6 * ours);
    assert_eq!(lpips.distance(&a, &a, h, w).unwrap(), 0.0);
}

#[cfg(feature = "ndarray")]
#[test]
#[allow(deprecated, reason = "kept and tested while burn ships it")]
fn both_devices_agree() {
    let (a, b) = (image(3, 64, 32), image(4, 64, 32));
    let [flex, ndarray] = [Device::flex(), Device::ndarray()]
        .map(|device| Lpips::new(filler(), &device).distance(&a, &b, 64, 32).unwrap());
    assert!((flex - ndarray).abs() < 1e-5 * flex, "{flex} and {ndarray}");
}

#[test]
fn images_must_be_large_enough() {
    let lpips = Lpips::new(filler(), &Device::flex());
    assert!(lpips.distance(&image(1, 31, 31), &image(2, 31, 31), 31, 31).unwrap() > 0.0);
    let message = lpips.distance(&image(1, 30, 62), &image(2, 30, 62), 30, 62).unwrap_err().to_string();
    assert!(message.contains("31") && message.contains("62 × 30"), "{message}");
}

/// A safetensors file of the parts of the weights that `name` wants, under the name it gives.
fn save(path: &Path, weights: &[LayerWeights], name: impl Fn(usize, &str) -> Option<String>) -> PathBuf {
    let mut tensors = Vec::new();
    for (at, (l, w)) in LAYERS.iter().zip(weights).enumerate() {
        let parts = [
            ("weight", vec![l.outputs, l.inputs, l.kernel, l.kernel], &w.weight),
            ("bias", vec![l.outputs], &w.bias),
            ("head", vec![1, l.outputs, 1, 1], &w.head),
        ];
        for (part, shape, data) in parts {
            if let Some(name) = name(at, part) {
                let bytes: Vec<u8> = data.iter().flat_map(|v| v.to_le_bytes()).collect();
                tensors.push((name, shape, bytes));
            }
        }
    }
    let views = tensors.iter().map(|(name, shape, bytes)| {
        let dtype = safetensors::Dtype::F32;
        (name.as_str(), safetensors::tensor::TensorView::new(dtype, shape.clone(), bytes).unwrap())
    });
    std::fs::write(path, safetensors::serialize(views, None).unwrap()).unwrap();
    path.to_owned()
}

#[test]
fn weights_are_found_under_every_name_they_have() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let weights = filler();
    let features = save(&path("alexnet.safetensors"), &weights, |at, part| {
        (part != "head").then(|| format!("features.{}.{part}", LAYERS[at].index))
    });
    let heads = save(&path("heads.safetensors"), &weights, |at, part| {
        (part == "head").then(|| format!("lin{at}.model.1.weight"))
    });
    let whole = save(&path("whole.safetensors"), &weights, |at, part| match part {
        "head" => Some(format!("lpips.net.lins.{at}.model.1.weight")),
        _ => Some(format!("lpips.net.net.slice{}.{}.{part}", at + 1, LAYERS[at].index)),
    });
    let two = weights::load(&[features.clone(), heads.clone()]).unwrap();
    assert!(two == weights && weights::load(std::slice::from_ref(&whole)).unwrap() == weights);

    let message = |files: &[PathBuf]| weights::load(files).unwrap_err().to_string();
    let missing = message(std::slice::from_ref(&features));
    assert!(missing.contains("alexnet.safetensors") && missing.contains("lin0.model.1.weight"), "{missing}");
    let twice = message(&[heads.clone(), features.clone(), heads]);
    assert!(twice.contains("could both be"), "{twice}");
    let swapped = save(&path("swapped.safetensors"), &weights, |at, part| match part {
        "head" => Some(format!("lin{at}.model.1.weight")),
        _ => Some(format!("features.{}.{part}", LAYERS[if at < 2 { 1 - at } else { at }].index)),
    });
    let shape = message(&[swapped]);
    assert!(shape.contains("features.0.weight") && shape.contains("[64, 3, 11, 11]"), "{shape}");
}
