//! What the code of a light is for: rotating it rotates the light, exactly, and between two codes lie other skies.
//!
//! ```sh
//! cargo run --release -p veni-light --features pretrained --example 3_rotate_and_interpolate
//! ```
//!
//! Prints how exact the rotation is, and writes `between.ppm`: eleven skies, one above the other, from one to another.

#![allow(clippy::print_stdout, reason = "an example")]

use veni_light::latent::Latent;
use veni_light::model::Model;
use veni_light::sphere::Equirect;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let model = Model::pretrained();
    let decoder = model.decoder()?;
    let [morning, evening] = [1, 2].map(|seed| Latent::from_seed(&model.prior(), seed));

    // The radiance in a direction, and that of the rotated light in the rotated direction: no pixel is resampled.
    let angle = 1.234_f64;
    let (sin, cos) = angle.sin_cos();
    let (still, rotated) = (decoder.condition(&morning)?, decoder.condition(&morning.rotated(angle))?);
    let mut largest = 0.0_f32;
    for d in Equirect::new(64, 32).directions() {
        let [x, y, z] = d.map(f64::from);
        let there = [x * cos - y * sin, x * sin + y * cos, z].map(|v| v as f32);
        for (a, b) in still.log_radiance(d).into_iter().zip(rotated.log_radiance(there)) {
            largest = largest.max((a - b).abs());
        }
    }
    println!("rotated by {angle} radians, log radiance differs by {largest:.1e} at most");

    let grid = Equirect::new(256, 128);
    let mut picture = format!("P6 {} {} 255\n", grid.width, 11 * grid.height).into_bytes();
    for step in 0..=10 {
        // along the great circle: midway there is as much contrast as at the ends
        let between = morning.slerp(&evening, step as f32 / 10.0)?;
        for pixel in decoder.condition(&between)?.bake(grid) {
            picture.extend(pixel.map(|v| (255.0 * (v / (1.0 + v)).powf(1.0 / 2.2)) as u8));
        }
    }
    std::fs::write("between.ppm", picture)?;
    println!("between.ppm: eleven skies of {} × {}", grid.width, grid.height);
    Ok(())
}
