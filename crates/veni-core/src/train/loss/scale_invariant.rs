//! The scale-invariant logarithmic error: the variance of log prediction − log target. MODEL (27, 30).

use burn::tensor::Tensor;

/// Per image, over all pixels and channels together: Σω(R − R̄)², R = P − I, R̄ = Σω R, with the row
/// weights ω of [`solid_angle`](super::rows::solid_angle); mean over the images. One factor on the whole
/// radiance image, colour included, is what it does not see, exactly. `[B, H, W, 3]` → `[1]`.
pub fn scale_invariant(prediction: Tensor<4>, target: Tensor<4>, weights: Tensor<4>) -> Tensor<1> {
    let error = prediction - target;
    let [batch, height, width, channels] = error.dims();
    let mean = (error.clone() * weights.clone()).reshape([batch, height * width * channels]).mean_dim(1);
    let deviation = error - mean.reshape([batch, 1, 1, 1]);
    (deviation.clone() * deviation * weights).mean()
}

/// The complement of [`scale_invariant`]: R̄² per image, mean over the images. It pins the exposure,
/// which the other corrected losses leave free; together they are the weighted log MSE. → `[1]`.
pub fn exposure(prediction: Tensor<4>, target: Tensor<4>, weights: Tensor<4>) -> Tensor<1> {
    let error = (prediction - target) * weights;
    let [batch, height, width, channels] = error.dims();
    let mean = error.reshape([batch, height * width * channels]).mean_dim(1);
    (mean.clone() * mean).mean()
}

/// The reference implementation's form, per image and channel: mean(R²) − mean(R)², R = mask·(P − I), over the pixels.
/// With the mask inside it responds to a constant factor too. `[B, H, W, 3]` → `[B, 3]`.
pub fn reference(prediction: Tensor<4>, target: Tensor<4>, mask: Tensor<4>) -> Tensor<2> {
    let error = (prediction - target) * mask;
    let [batch, height, width, channels] = error.dims();
    let error = error.reshape([batch, height * width, channels]);
    let mean = error.clone().mean_dim(1);
    ((error.clone() * error).mean_dim(1) - mean.clone() * mean).squeeze_dim(1)
}

/// RENI++'s form over rays: mean(R²) − mean(R)² over everything at once. → `[1]`.
pub fn rays<const D: usize>(prediction: Tensor<D>, target: Tensor<D>) -> Tensor<1> {
    let error = prediction - target;
    let mean = error.clone().mean();
    (error.clone() * error).mean() - mean.clone() * mean
}
