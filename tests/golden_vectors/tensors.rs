//! Golden numbers as burn tensors, and back.

use crate::case::{Case, Data};
use burn::tensor::{Device, Tensor, TensorData};

impl Data {
    /// The values of a burn tensor, any rank.
    pub(crate) fn of<const D: usize>(tensor: &Tensor<D>) -> Self {
        let values = tensor.to_data().convert::<f32>().try_into_vec().expect("a float tensor");
        Self::new(tensor.dims().to_vec(), values)
    }

    /// The same numbers as a burn tensor; the number of elements must agree, the shape may differ.
    pub(crate) fn tensor<const D: usize>(&self, shape: [usize; D], device: &Device) -> Tensor<D> {
        let count: usize = shape.iter().product();
        assert_eq!(count, self.values.len(), "cannot view {:?} as {shape:?}", self.shape);
        Tensor::from_data(TensorData::new(self.values.clone(), shape), device)
    }
}

impl Case {
    /// A tensor on a device, in its own shape (rank `D`).
    pub(crate) fn tensor<const D: usize>(&self, name: &str, device: &Device) -> Tensor<D> {
        let data = self.data(name);
        let shape = data.shape.clone().try_into();
        data.tensor(shape.unwrap_or_else(|s| panic!("`{name}` has shape {s:?}, not rank {D}")), device)
    }

    /// [`compare`](Self::compare) for a burn tensor.
    pub(crate) fn compare_tensor<const D: usize>(&self, name: &str, ours: &Tensor<D>) {
        self.compare(name, &Data::of(ours));
    }
}
