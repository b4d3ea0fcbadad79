//! A module's float parameters by dotted path: taking gradients out, putting values in.

use std::collections::BTreeMap;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Gradients, Tensor, TensorData};

/// Values by dotted path, in path order.
pub type Named = BTreeMap<String, Values>;

/// Shape and row-major values of one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// Sizes of the axes.
    pub shape: Vec<usize>,
    /// Row-major numbers.
    pub data: Vec<f32>,
}

impl Values {
    /// Zeros of the same shape.
    #[must_use]
    pub fn zeros_like(&self) -> Self {
        Self { shape: self.shape.clone(), data: vec![0.0; self.data.len()] }
    }

    fn of<const D: usize>(tensor: Tensor<D>) -> Self {
        let shape = tensor.dims().to_vec();
        let data = tensor.into_data().convert::<f32>().try_into_vec().expect("converted to f32 just now");
        Self { shape, data }
    }
}

/// The trained parameters of `module` (those that require a gradient).
pub fn trained<M: Module>(module: &M) -> Named {
    let mut visitor = Collect { path: Vec::new(), grads: None, out: Named::new() };
    module.visit(&mut visitor);
    visitor.out
}

/// Takes the gradients of `module`'s parameters out of `grads`; a parameter that the loss does not depend on
/// is absent.
pub fn gradients<M: Module>(module: &M, grads: &mut Gradients) -> Named {
    let mut visitor = Collect { path: Vec::new(), grads: Some(grads), out: Named::new() };
    module.visit(&mut visitor);
    visitor.out
}

/// `module` with the parameters named in `values` replaced; every other parameter stays. The parameters keep
/// their device and whether they require a gradient.
///
/// # Panics
/// If a value's shape differs from its parameter's.
pub fn replaced<M: Module>(module: M, values: &Named) -> M {
    module.map(&mut Replace { path: Vec::new(), values })
}

struct Collect<'a> {
    path: Vec<String>,
    grads: Option<&'a mut Gradients>,
    out: Named,
}

impl ModuleVisitor for Collect<'_> {
    fn enter_module(&mut self, name: &str, _container: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if !param.is_require_grad() {
            return;
        }
        let tensor = match &mut self.grads {
            Some(grads) => param.val().grad_remove(grads),
            None => Some(param.val().detach()),
        };
        if let Some(tensor) = tensor {
            self.out.insert(self.path.join("."), Values::of(tensor));
        }
    }
}

struct Replace<'a> {
    path: Vec<String>,
    values: &'a Named,
}

impl ModuleMapper for Replace<'_> {
    fn enter_module(&mut self, name: &str, _container: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let path = self.path.join(".");
        let Some(values) = self.values.get(&path) else {
            return param;
        };
        let requires = param.is_require_grad();
        let (id, old, mapper) = param.consume();
        assert_eq!(old.dims().as_slice(), values.shape, "shape of parameter {path}");
        let data = TensorData::new(values.data.clone(), values.shape.clone());
        let tensor = Tensor::<D>::from_data(data, &old.device());
        let tensor = if requires { tensor.require_grad() } else { tensor };
        Param::from_mapped_value(id, tensor, mapper)
    }
}
