//! Any burn module's parameters as named plain numbers, and back: the bridge to the model file.
//!
//! Names are the dotted paths of the fields, e.g. `decoder.layers.0.ff1.weight`. Where a field holds one of
//! several kinds of layer (an enum), the kind adds no component: the configuration tells it.

use crate::{Error, Result};
use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Gradients, Tensor, TensorData, Transaction};
use std::collections::BTreeMap;
use veni_light::model::Array;

/// Parameters by dotted path.
pub type Weights = BTreeMap<String, Array>;

/// Every float parameter of a module; `prefix` (e.g. `decoder`, or empty) is put before each path.
pub fn read<M: Module>(module: &M, prefix: &str) -> Weights {
    collect(module, prefix, None)
}

/// The gradients of every float parameter that has one, under the parameter's name. A parameter that the
/// loss does not depend on is absent.
pub fn gradients<M: Module>(module: &M, prefix: &str, gradients: &Gradients) -> Weights {
    collect(module, prefix, Some(gradients))
}

/// The module with all its float parameters replaced by `weights`, on the device where they are and with
/// gradients recorded as before. Entries of `weights` outside `prefix` are left alone.
///
/// # Errors
/// [`Error::Invalid`] names the first parameter that is missing, of another shape, or in `weights` under
/// `prefix` without being in the module.
pub fn write<M: Module>(module: M, prefix: &str, weights: &Weights) -> Result<M> {
    let mut writer = Writer { path: Path::new(prefix), weights, used: 0, error: None };
    let module = module.map(&mut writer);
    if let Some(error) = writer.error {
        return Err(error);
    }
    let inside =
        |name: &&String| prefix.is_empty() || name.strip_prefix(prefix).is_some_and(|r| r.starts_with('.'));
    if weights.keys().filter(inside).count() != writer.used {
        let known = read(&module, prefix);
        let unknown = weights.keys().filter(inside).find(|name| !known.contains_key(*name));
        return Err(Error::invalid(format!(
            "tensor {} is not part of this model; its configuration and its weights disagree",
            unknown.map_or("(unnamed)", |n| n)
        )));
    }
    Ok(module)
}

/// The components that lead to the parameter being visited.
struct Path(Vec<String>);

impl Path {
    fn new(prefix: &str) -> Self {
        Self(prefix.split('.').filter(|s| !s.is_empty()).map(str::to_owned).collect())
    }

    fn enter(&mut self, name: &str, container_type: &str) {
        if !container_type.starts_with("Enum:") {
            self.0.push(name.to_owned());
        }
    }

    fn exit(&mut self, container_type: &str) {
        if !container_type.starts_with("Enum:") {
            self.0.pop();
        }
    }

    fn dotted(&self) -> String {
        self.0.join(".")
    }
}

struct Reader<'a> {
    path: Path,
    gradients: Option<&'a Gradients>,
    /// Names and shapes, in the order of `values`.
    found: Vec<(String, Vec<usize>)>,
    /// All tensors in one reading: a graphics device is waited for once, not once for each.
    values: Transaction,
}

fn collect<M: Module>(module: &M, prefix: &str, gradients: Option<&Gradients>) -> Weights {
    let (path, found) = (Path::new(prefix), Vec::new());
    let mut reader = Reader { path, gradients, found, values: Transaction::default() };
    module.visit(&mut reader);
    let numbers = |data: TensorData| data.convert::<f32>().try_into_vec().expect("just converted to f32");
    (reader.found.into_iter().zip(reader.values.execute()))
        .map(|((name, shape), data)| (name, Array { shape, data: numbers(data) }))
        .collect()
}

impl ModuleVisitor for Reader<'_> {
    fn enter_module(&mut self, name: &str, container_type: &str) {
        self.path.enter(name, container_type);
    }

    fn exit_module(&mut self, _name: &str, container_type: &str) {
        self.path.exit(container_type);
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let tensor = match self.gradients {
            None => Some(param.val()),
            Some(gradients) => param.val().grad(gradients),
        };
        if let Some(tensor) = tensor {
            self.found.push((self.path.dotted(), tensor.dims().to_vec()));
            self.values = std::mem::take(&mut self.values).register(tensor);
        }
    }
}

struct Writer<'a> {
    path: Path,
    weights: &'a Weights,
    used: usize,
    error: Option<Error>,
}

impl ModuleMapper for Writer<'_> {
    fn enter_module(&mut self, name: &str, container_type: &str) {
        self.path.enter(name, container_type);
    }

    fn exit_module(&mut self, _name: &str, container_type: &str) {
        self.path.exit(container_type);
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let name = self.path.dotted();
        let shape = param.shape().as_slice().to_vec();
        let problem = match self.weights.get(&name) {
            None => format!("tensor {name} {shape:?} is missing"),
            Some(w) if w.shape != shape => {
                format!("tensor {name} has shape {:?}; the model needs {shape:?}", w.shape)
            }
            Some(w) if w.data.len() != shape.iter().product::<usize>() => {
                format!("tensor {name} {shape:?} holds {} values", w.data.len())
            }
            Some(weight) => {
                self.used += 1;
                let data = TensorData::new(weight.data.clone(), shape);
                return param.map(|old| {
                    Tensor::from_data(data, &old.device()).set_require_grad(old.is_require_grad())
                });
            }
        };
        self.error.get_or_insert(Error::invalid(problem));
        param
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vae::Decoder;
    use burn::tensor::Device;
    use veni_light::model::DecoderConfig;
    use veni_light::random::Stream;

    fn decoder(seed: u64) -> Decoder {
        let config = DecoderConfig { hidden: 8, layers: 2, heads: 2, ..DecoderConfig::default() };
        Decoder::new(&config, 3, &mut Stream::from_seed(seed), &Device::flex().autodiff())
    }

    #[test]
    fn names_and_shapes_are_those_of_the_model_file() {
        let weights = read(&decoder(1), "decoder");
        let shape = |name: &str| weights[&format!("decoder.{name}")].shape.clone();
        assert_eq!(shape("condition.scale"), [1]);
        assert_eq!(shape("condition.linear"), [1, 2]);
        assert_eq!(shape("condition.u"), [2, 2]);
        assert_eq!(shape("input.weight"), [25, 8]);
        assert_eq!(shape("layers.1.value.weight"), [9, 8]);
        assert_eq!(shape("layers.0.norm2.gamma"), [8]);
        assert_eq!(shape("output.weight"), [8, 3]);
        assert_eq!(weights.len(), 4 + 2 + 2 * 12 + 2);
    }

    #[test]
    fn weights_written_are_weights_read() {
        let source = read(&decoder(1), "decoder");
        let other = decoder(2);
        assert_ne!(read(&other, "decoder"), source);
        let other = write(other, "decoder", &source).unwrap();
        assert_eq!(read(&other, "decoder"), source);
        assert!(other.input.weight.val().is_require_grad(), "still trainable");
        // Another module's tensors in the same file are no business of this one.
        let mut file = source.clone();
        file.insert("encoder.class".into(), Array { shape: vec![1], data: vec![0.0] });
        assert!(write(other, "decoder", &file).is_ok());
    }

    #[test]
    fn missing_extra_and_misshapen_weights_are_named() {
        let source = read(&decoder(1), "decoder");
        let message = |change: &dyn Fn(&mut Weights)| {
            let mut weights = source.clone();
            change(&mut weights);
            write(decoder(2), "decoder", &weights).unwrap_err().to_string()
        };
        let missing = message(&|w| drop(w.remove("decoder.output.bias")));
        assert_eq!(missing, "tensor decoder.output.bias [3] is missing");
        let misshapen = message(&|w| w.get_mut("decoder.input.bias").unwrap().shape = vec![2, 4]);
        assert_eq!(misshapen, "tensor decoder.input.bias has shape [2, 4]; the model needs [8]");
        let short = message(&|w| w.get_mut("decoder.input.bias").unwrap().data.truncate(3));
        assert_eq!(short, "tensor decoder.input.bias [8] holds 3 values");
        let extra = message(&|w| {
            w.insert("decoder.query".into(), Array { shape: vec![1], data: vec![0.0] });
        });
        assert!(extra.starts_with("tensor decoder.query is not part"), "{extra}");
    }
}
