//! A random sky, as pixels: the shortest way from this crate to light.
//!
//! ```sh
//! cargo run --release -p veni-light --features pretrained --example 0_random_sky -- 7    # another number, another sky
//! ```
//!
//! Writes `sky.pfm`, a portable float map: linear radiance that GIMP, ImageMagick and most HDR viewers open.

#![allow(clippy::print_stdout, reason = "an example")]

use veni_light::latent::Latent;
use veni_light::model::Model;
use veni_light::sphere::Equirect;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let seed = std::env::args().nth(1).map_or(Ok(7), |word| word.parse())?;

    let model = Model::pretrained();
    let latent = Latent::from_seed(&model.prior(), seed);
    println!("sky {seed} has latent dimension {}:", 3 * latent.vectors.len());
    for [x, y, z] in &latent.vectors {
        println!("{x:8.3} {y:8.3} {z:8.3}");
    }

    // Conditioning folds the network for this latent; what is left is a small perceptron per direction.
    let field = model.decoder()?.condition(&latent)?;
    println!("straight up: {:?}", field.radiance([0.0, 0.0, 1.0]));

    let grid = Equirect::new(512, 256);
    let pixels = field.bake(grid);
    std::fs::write("sky.pfm", pfm(grid, &pixels))?;
    println!("sky.pfm: {} × {}, row 0 is up, the centre looks along +x", grid.width, grid.height);
    Ok(())
}

/// A portable float map: a head, then rows from the bottom up, little-endian.
fn pfm(grid: Equirect, pixels: &[[f32; 3]]) -> Vec<u8> {
    let mut file = format!("PF\n{} {}\n-1.0\n", grid.width, grid.height).into_bytes();
    for row in pixels.chunks_exact(grid.width).rev() {
        file.extend(row.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
    }
    file
}
