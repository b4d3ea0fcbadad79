//! Prints the machine's f32 matrix-product rate, and the decoder's as a fraction of it.
//!
//! `cargo run --release -p veni-research --example gemm_rate`; `RAYON_NUM_THREADS=1` before it for one core.
//!
//! The rate is that of burn's flex device (the `gemm` crate) on 2048 × 2048 matrices. The decoder bakes filler
//! weights of the paper's sizes; its multiply-adds are 5(N+2)·128 + 12·128² + 128·3 per direction. Both take
//! turns and the best of several runs counts, so that other work on the machine disturbs both alike.

use std::hint::black_box;
use std::time::Instant;

use burn::tensor::{Device, Distribution, Tensor};
use veni_core::latent::{Latent, Prior};
use veni_core::model::{Model, ModelConfig};
use veni_core::sphere::Equirect;

const N: usize = 2048;
const ROUNDS: usize = 8;

#[allow(clippy::print_stdout, reason = "printing is what this program is for")]
fn main() -> veni_core::Result<()> {
    let grid = Equirect::new(512, 256);
    let mut fields = Vec::new();
    for n in [9, 49, 100] {
        let model = Model::filler(&ModelConfig::decode_only(n), 1)?;
        fields.push((n, model.decoder()?.condition(&Latent::from_seed(&Prior::standard(n), 1))?, 0.0f64));
    }
    let device = Device::flex();
    let [a, b] = [0, 1].map(|_| Tensor::<2>::random([N, N], Distribution::Default, &device));
    let mut product = 0.0f64;
    for _ in 0..ROUNDS {
        let time = Instant::now();
        let c = a.clone().matmul(b.clone());
        product = product.max(2.0 * (N * N * N) as f64 / time.elapsed().as_secs_f64());
        black_box(c);
        for (n, field, best) in &mut fields {
            let work = 2.0 * (5 * (*n + 2) * 128 + 12 * 128 * 128 + 128 * 3) as f64 * grid.len() as f64;
            let time = Instant::now();
            black_box(field.bake(grid));
            *best = best.max(work / time.elapsed().as_secs_f64());
        }
    }
    let threads = rayon::current_num_threads();
    println!("f32 GEMM, {threads} threads: {:.1} GFLOP/s", product / 1e9);
    for (n, _, rate) in fields {
        println!("bake, D = {:3}: {:.1} GFLOP/s, {:.0} % of it", 3 * n, rate / 1e9, 100.0 * rate / product);
    }
    Ok(())
}
