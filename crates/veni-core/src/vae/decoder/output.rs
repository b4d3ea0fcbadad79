//! From the output map to log radiance. MODEL (20, 24).

use burn::tensor::Tensor;
use veni_light::model::{DecoderConfig, OutputForm};

/// Log radiance of the output map's y [B, R, 3].
pub(super) fn log_radiance(config: &DecoderConfig, y: Tensor<3>) -> Tensor<3> {
    match config.output {
        OutputForm::Linear => y,
        OutputForm::Sine => (y * config.omega).sin(),
        OutputForm::Tanh => {
            let [least, most] = OutputForm::TANH_RANGE;
            (y.tanh() + 1.0) * (0.5 * (most - least)) + least
        }
    }
}
