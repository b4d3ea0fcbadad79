//! Equivariant layers on burn: a case's weights into a module, gradients out of it, features in our order of axes.

use crate::bindings::{Binding, Bindings};
use crate::case::{Case, Data};
use burn::module::Module;
use burn::tensor::{Gradients, Tensor};
use veni::vae::weights::{self, Weights};

impl Bindings {
    /// `module` with the case's weights.
    pub(crate) fn load<M: Module>(&self, case: &Case, module: M) -> M {
        let mut ours = weights::read(&module, "");
        for (name, data) in self.weights(case) {
            let slot = ours.get_mut(&name).unwrap_or_else(|| panic!("our module has no parameter {name}"));
            slot.data = data.values;
        }
        weights::write(module, "", &ours).unwrap_or_else(|e| panic!("{e}"))
    }

    /// Compares the gradients that the case records under `grad.param.<key>`.
    pub(crate) fn compare_gradients<M: Module>(&self, case: &Case, module: &M, gradients: &Gradients) {
        self.compare_records(case, "grad.param.", &weights::gradients(module, "", gradients));
    }

    /// Compares `ours` (by our names; absent: zeros) with what the case records under `<record><key>`.
    pub(crate) fn compare_records(&self, case: &Case, record: &str, ours: &Weights) {
        for (key, shape) in &self.zeros {
            let name = format!("{record}{key}");
            if case.expects(&name) {
                case.compare(&name, &Data::new(shape.clone(), vec![0.0; shape.iter().product()]));
            }
        }
        for Binding { key, shape, view, order, ours: name } in &self.parameters {
            let record = format!("{record}{key}");
            if !case.expects(&record) {
                continue;
            }
            let there: Vec<usize> = order.iter().map(|&axis| view[axis]).collect();
            let back: Vec<usize> = (0..order.len())
                .map(|axis| order.iter().position(|&o| o == axis).expect("a permutation"))
                .collect();
            let gradient = match ours.get(name) {
                Some(gradient) => gradient.data.clone(),
                None => vec![0.0; shape.iter().product()],
            };
            let gradient = Data::new(there.clone(), gradient).permuted(&there, &back);
            case.compare(&record, &Data::new(shape.clone(), gradient.values));
        }
    }
}

/// Theirs `[.., token, channel, coordinate]` as ours `[batch, token, coordinate, channel]`, coordinates picked in
/// the order of `axes`.
pub(crate) fn feature<const D: usize>(x: Tensor<D>, axes: &[usize]) -> Tensor<4> {
    let dims = x.dims();
    assert!(D >= 3, "a vector feature has channels and coordinates, not shape {dims:?}");
    let x = x.reshape([-1, dims[D - 3] as i64, dims[D - 2] as i64, dims[D - 1] as i64]);
    let parts = axes.iter().map(|&axis| x.clone().narrow(3, axis, 1)).collect();
    Tensor::cat(parts, 3).swap_dims(2, 3)
}

/// Ours `[batch, token, coordinate, channel]` as theirs, coordinate i of ours at place `axes[i]`.
pub(crate) fn official(x: Tensor<4>, axes: &[usize]) -> Tensor<4> {
    assert_eq!(x.dims()[2], axes.len(), "the output has another number of coordinates than its axes");
    let parts = (0..axes.len()).map(|place| {
        let index = axes.iter().position(|&axis| axis == place).expect("output axes are a permutation");
        x.clone().narrow(2, index, 1)
    });
    Tensor::cat(parts.collect(), 2).swap_dims(2, 3)
}
