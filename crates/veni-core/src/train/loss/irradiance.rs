//! Light on surfaces: the error of the logarithm of irradiance. MODEL (73).

use burn::tensor::{Device, Tensor, TensorData};

use veni_light::sphere::{Equirect, ways};
use veni_light::vector::dot;

/// What turns radiance into irradiance on surfaces that face the [`ways`], `[26, H·W]`: solid angle times cosine.
pub fn surfaces(height: usize, width: usize, device: &Device) -> Tensor<2> {
    let grid = Equirect::new(width, height);
    let directions = grid.directions();
    let weight = |way: [f32; 3]| {
        directions
            .iter()
            .enumerate()
            .map(move |(index, d)| dot(*d, way).max(0.0) * grid.solid_angle(index / width) as f32)
    };
    let weights: Vec<f32> = ways().into_iter().flat_map(weight).collect();
    Tensor::from_data(TensorData::new(weights, [ways().len(), grid.len()]), device)
}

/// Mean over images, surfaces and channels of (ln E(e^P) − ln E(e^I))². `[B, H, W, 3]` → `[1]`. Log radiance is averaged by the other
/// terms, and the mean of a logarithm is below the logarithm of a mean: without this a field that cannot follow what is small and
/// bright is too dark.
pub fn irradiance(prediction: Tensor<4>, target: Tensor<4>, surfaces: Tensor<2>) -> Tensor<1> {
    let [batch, height, width, _] = prediction.dims();
    let [count, _] = surfaces.dims();
    let surfaces = surfaces.reshape([1, count, height * width]).expand([batch, count, height * width]);
    let log =
        |image: Tensor<4>| surfaces.clone().matmul(image.exp().reshape([batch, height * width, 3])).log();
    (log(prediction) - log(target)).powi_scalar(2).mean()
}
