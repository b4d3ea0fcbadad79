//! Shared by the layers' tests: random features, rotations, and gradients against central differences in f64.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{DType, Device, Tensor, TensorData};
use veni_light::random::Stream;

pub(crate) fn rng(seed: u64) -> Stream {
    Stream::from_seed(seed)
}

/// Entries U(−1, 1).
pub(crate) fn features(shape: [usize; 4], seed: u64, device: &Device) -> Tensor<4> {
    let mut rng = rng(seed);
    let values: Vec<f32> = (0..shape.iter().product::<usize>())
        .map(|_| (f64::from(rng.next_u32()) / f64::from(u32::MAX) * 2.0 - 1.0) as f32)
        .collect();
    Tensor::from_data(TensorData::new(values, shape), device)
}

/// Rotates x and y of a feature by `angle`.
pub(crate) fn rotate_xy(x: Tensor<4>, angle: f64) -> Tensor<4> {
    let (sin, cos) = angle.sin_cos();
    let (a, b) = (x.clone().narrow(2, 0, 1), x.clone().narrow(2, 1, 1));
    let rest = x.dims()[2] - 2;
    let mut parts = vec![a.clone() * cos - b.clone() * sin, a * sin + b * cos];
    if rest > 0 {
        parts.push(x.narrow(2, 2, rest));
    }
    Tensor::cat(parts, 2)
}

/// Changes the sign of y.
pub(crate) fn reflect_y(x: Tensor<4>) -> Tensor<4> {
    let coordinates = x.dims()[2];
    let y = x.clone().narrow(2, 1, 1).neg();
    let mut parts = vec![x.clone().narrow(2, 0, 1), y];
    if coordinates > 2 {
        parts.push(x.narrow(2, 2, coordinates - 2));
    }
    Tensor::cat(parts, 2)
}

pub(crate) fn max_difference(a: Tensor<4>, b: Tensor<4>) -> f32 {
    (a - b).abs().max().into_scalar()
}

/// Casts every parameter to f64.
struct ToF64;

impl ModuleMapper for ToF64 {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        param.map(|t| to_f64(t).require_grad())
    }
}

/// Adds `step` to the `index`-th number of all parameters.
struct Nudge {
    index: usize,
    seen: usize,
    step: f64,
}

impl ModuleMapper for Nudge {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (start, count) = (self.seen, param.val().shape().num_elements());
        self.seen += count;
        if !(start..start + count).contains(&self.index) {
            return param;
        }
        param.map(|t| nudged(t, self.index - start, self.step))
    }
}

/// A copy in f64, outside any graph.
fn to_f64<const D: usize>(t: Tensor<D>) -> Tensor<D> {
    let (data, device) = (t.to_data_as::<f64>(), t.device());
    Tensor::from_data(data, (&device, DType::F64))
}

fn nudged<const D: usize>(t: Tensor<D>, index: usize, step: f64) -> Tensor<D> {
    let (shape, device) = (t.dims(), t.device());
    let mut values: Vec<f64> = t.try_into_vec_as().unwrap();
    values[index] += step;
    Tensor::from_data(TensorData::new(values, shape), (&device, DType::F64))
}

/// All parameters' gradients, one after the other.
struct Collect<'a> {
    gradients: &'a burn::tensor::Gradients,
    values: Vec<f64>,
}

impl ModuleVisitor for Collect<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let value = param.val();
        match value.grad(self.gradients) {
            Some(gradient) => self.values.extend(gradient.try_into_vec_as::<f64>().unwrap()),
            None => self.values.extend(std::iter::repeat_n(0.0, value.shape().num_elements())),
        }
    }
}

/// Compares the gradients of Σ forward(x) · probe by `x` and by every parameter with central differences.
///
/// Runs in f64, where central differences of step 1e-5 are good to about 1e-9.
pub(crate) fn assert_gradients<M: Module>(
    module: M,
    x: Tensor<4>,
    forward: impl Fn(&M, Tensor<4>) -> Tensor<4>,
) {
    let device = x.device();
    let module = module.map(&mut ToF64);
    let x = to_f64(x);
    let shape = forward(&module, x.clone()).dims();
    let probe = to_f64(features(shape, 77, &device));
    let loss = |module: &M, x: Tensor<4>| (forward(module, x) * probe.clone()).sum();
    let value = |module: &M, x: Tensor<4>| -> f64 { loss(module, x).into_scalar() };

    let tracked = x.clone().require_grad();
    let gradients = loss(&module, tracked.clone()).backward();
    let by_input: Vec<f64> = tracked.grad(&gradients).unwrap().try_into_vec_as().unwrap();
    let mut collect = Collect { gradients: &gradients, values: Vec::new() };
    module.visit(&mut collect);
    let by_parameter = collect.values;
    assert!(!by_parameter.is_empty() && by_parameter.iter().any(|g| g.abs() > 1e-3), "no parameter gradient");

    let step = 1e-5;
    let check = |what: &str, index: usize, gradient: f64, difference: f64| {
        let tolerance = 1e-6 * (1.0 + gradient.abs());
        assert!(
            (gradient - difference).abs() < tolerance,
            "{what} {index}: gradient {gradient}, central difference {difference}"
        );
    };
    for (index, &gradient) in by_input.iter().enumerate() {
        let at = |step| value(&module, nudged(x.clone(), index, step));
        check("input", index, gradient, (at(step) - at(-step)) / (2.0 * step));
    }
    // Of many parameters a sample that meets every layer: one of every 37, 37 being prime to the usual sizes.
    let stride = if by_parameter.len() > 400 { 37 } else { 1 };
    for (index, &gradient) in by_parameter.iter().enumerate().step_by(stride) {
        let at = |step| {
            let moved = module.clone().map(&mut Nudge { index, seen: 0, step });
            value(&moved, x.clone())
        };
        check("parameter", index, gradient, (at(step) - at(-step)) / (2.0 * step));
    }
}
