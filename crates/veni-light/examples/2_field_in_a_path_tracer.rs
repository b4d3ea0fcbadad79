//! The field as the sky of a path tracer: a ray that misses everything asks for the radiance in its direction.
//!
//! ```sh
//! cargo run --release -p veni-light --features pretrained --example 2_field_in_a_path_tracer
//! ```
//!
//! One grey ball on a grey floor; writes `ball.ppm`.

#![allow(clippy::print_stdout, reason = "an example")]

use veni_light::field::Evaluator;
use veni_light::latent::Latent;
use veni_light::model::Model;
use veni_light::random::{Purpose, stream};

const SIZE: [usize; 2] = [240, 160];
const SAMPLES: usize = 32;
/// Light that a diffuse surface gives back.
const ALBEDO: f32 = 0.7;
type Vector = [f32; 3];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let model = Model::pretrained();
    // two stops brighter, for the picture's sake
    let field = model.decoder()?.condition(&Latent::from_seed(&model.prior(), 19))?.brightened(2.0);
    // keeps its workspace from ray to ray; a renderer has one per thread
    let mut sky = field.evaluator();
    let [width, height] = SIZE;
    let mut picture = format!("P6 {width} {height} 255\n").into_bytes();
    for pixel in 0..width * height {
        let (column, row) = ((pixel % width) as f32, (pixel / width) as f32);
        let (u, v) = ((column + 0.5) / height as f32 - 0.75, 0.5 - (row + 0.5) / height as f32);
        let mut rng = stream(0, Purpose::Sampling, pixel as u64, 0);
        let mut sum = [0.0; 3];
        for _ in 0..SAMPLES {
            let random = &mut || unit([0; 3].map(|_| rng.normal() as f32));
            let light = trace(&mut sky, [-4.0, 0.0, 1.0], unit([1.5, -u, v - 0.25]), random);
            sum = add(sum, 1.0 / SAMPLES as f32, light);
        }
        picture.extend(sum.map(|v| (255.0 * (v / (1.0 + v)).powf(1.0 / 2.2)) as u8));
    }
    std::fs::write("ball.ppm", picture)?;
    println!("ball.ppm: {width} × {height}, {SAMPLES} paths per pixel");
    Ok(())
}

/// All surfaces are diffuse: a path goes on in a direction distributed by the cosine.
fn trace(
    sky: &mut Evaluator,
    mut from: Vector,
    mut along: Vector,
    random: &mut impl FnMut() -> Vector,
) -> Vector {
    let mut weight = 1.0;
    for _ in 0..4 {
        let Some((distance, normal)) = hit(from, along) else {
            // the whole interface: a direction (z up) in, linear Rec. 709 out
            return sky.radiance(along).map(|v| weight * v);
        };
        from = add(add(from, distance, along), 1e-3, normal);
        along = unit(add(normal, 1.0, random()));
        weight *= ALBEDO;
    }
    [0.0; 3]
}

/// The nearer of a ball of radius 1 about the origin and the floor z = −1.
fn hit(from: Vector, along: Vector) -> Option<(f32, Vector)> {
    let (b, c) = (dot(from, along), dot(from, from) - 1.0);
    let ball = (b * b - c).max(-1.0).sqrt();
    match -b - ball {
        distance if distance > 0.0 => Some((distance, add(from, distance, along))),
        _ if along[2] < 0.0 => Some(((-1.0 - from[2]) / along[2], [0.0, 0.0, 1.0])),
        _ => None,
    }
}

fn dot(a: Vector, b: Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn add(a: Vector, scale: f32, b: Vector) -> Vector {
    [0, 1, 2].map(|k| a[k] + scale * b[k])
}

fn unit(v: Vector) -> Vector {
    add([0.0; 3], dot(v, v).sqrt().recip(), v)
}
