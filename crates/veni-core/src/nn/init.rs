//! Initial values, drawn from the caller's generator and not from the device's global one.

use burn::module::Param;
use burn::tensor::{Device, Tensor, TensorData};
use veni_light::random::Stream;

/// A trainable tensor of `shape` with entries U(−bound, bound), in row-major order of the generator's words.
///
/// Each entry takes the upper 24 bits of one 32-bit word, so that the values depend on the generator alone.
pub fn uniform<const D: usize>(
    shape: [usize; D],
    bound: f64,
    rng: &mut Stream,
    device: &Device,
) -> Param<Tensor<D>> {
    let values: Vec<f32> = (0..shape.iter().product::<usize>())
        .map(|_| {
            let unit = (f64::from(rng.next_u32() >> 8) + 0.5) / f64::from(1u32 << 24);
            ((2.0 * unit - 1.0) * bound) as f32
        })
        .collect();
    Param::from_data(TensorData::new(values, shape), device)
}

/// A trainable tensor of `shape` with normal entries of this mean and deviation, in row-major order of the draws.
pub fn normal<const D: usize>(
    shape: [usize; D],
    [mean, deviation]: [f64; 2],
    rng: &mut Stream,
    device: &Device,
) -> Param<Tensor<D>> {
    let count = shape.iter().product::<usize>();
    let values: Vec<f32> = (0..count).map(|_| (mean + deviation * rng.normal()) as f32).collect();
    Param::from_data(TensorData::new(values, shape), device)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_follow_the_seed_and_fill_the_interval() {
        let draw = |seed| -> Vec<f32> {
            let mut rng = Stream::from_seed(seed);
            uniform([40, 50], 0.25, &mut rng, &Device::flex()).val().try_into_vec_as().unwrap()
        };
        let a = draw(1);
        assert_eq!(a, draw(1));
        assert_ne!(a, draw(2));
        assert!(a.iter().all(|v| v.abs() < 0.25));
        let mean = a.iter().sum::<f32>() / 2000.0;
        let variance = a.iter().map(|v| v * v).sum::<f32>() / 2000.0;
        assert!(mean.abs() < 0.02, "mean {mean}");
        assert!((variance - 0.25f32.powi(2) / 3.0).abs() < 0.002, "variance {variance}");
    }
}
