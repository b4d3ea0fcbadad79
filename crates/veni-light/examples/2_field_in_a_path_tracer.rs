//! The field as the sky of a path tracer: a ray that misses everything asks for the radiance in its direction, and surfaces look
//! where the sky is bright.
//!
//! ```sh
//! cargo run --release -p veni-light --features pretrained --example 2_field_in_a_path_tracer
//! cargo run --release -p veni-light --features pretrained --example 2_field_in_a_path_tracer -- --sampler light
//! ```
//!
//! One grey ball on a grey floor; writes `ball.ppm`. Directions are drawn by the surface's cosine (`--sampler bsdf`), by the sky's
//! luminance (`light`), or half of the time by either (`mis`, the default: multiple importance sampling by the balance
//! heuristic). The variance of a pixel is printed beside that of `bsdf`.

#![allow(clippy::print_stdout, reason = "an example")]

use std::f32::consts::{PI, TAU};
use std::time::Instant;

use veni_light::field::{Evaluator, Field};
use veni_light::latent::Latent;
use veni_light::light::{EnvironmentMap, Sampler, luminance};
use veni_light::model::Model;
use veni_light::random::{Purpose, Stream, stream};
use veni_light::sphere::Equirect;

const SIZE: [usize; 2] = [240, 160];
const SAMPLES: usize = 32;
/// Light that a diffuse surface gives back.
const ALBEDO: f32 = 0.7;
type Vector = [f32; 3];

/// How directions are drawn.
#[derive(Clone, Copy, PartialEq)]
enum Strategy {
    Bsdf,
    Light,
    Mis,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let strategy = match &*std::env::args().skip(1).collect::<Vec<_>>().join(" ") {
        "" | "--sampler mis" => Strategy::Mis,
        "--sampler light" => Strategy::Light,
        "--sampler bsdf" => Strategy::Bsdf,
        other => return Err(format!("{other}: 2_field_in_a_path_tracer [--sampler bsdf|light|mis]").into()),
    };
    let model = Model::pretrained();
    // two stops brighter, for the picture's sake
    let field = model.decoder()?.condition(&Latent::from_seed(&model.prior(), 19))?.brightened(2.0);
    // where it is bright: a coarse map is enough, since radiance comes from the field itself
    let grid = Equirect::new(128, 64);
    let pixels = field.bake(grid);
    let sampler = Sampler::new(EnvironmentMap::new(grid, &pixels)?);
    // what is even anyway is left to the cosine
    let compensated = sampler.compensated();
    let [_, before, time] = render(&field, &sampler, Strategy::Bsdf)?;
    if strategy != Strategy::Bsdf {
        let sampler = if strategy == Strategy::Mis { &compensated } else { &sampler };
        let [_, after, seconds] = render(&field, sampler, strategy)?;
        let (samples, same_time) = (before / after, before * time / (after * seconds));
        println!("{samples:.2} times less variance at equal samples, {same_time:.2} times at equal time");
    }
    println!("ball.ppm: {} × {}, {SAMPLES} paths per pixel", SIZE[0], SIZE[1]);
    Ok(())
}

/// Writes the picture; mean luminance, variance of a pixel over the squared mean, seconds.
fn render(field: &Field, sampler: &Sampler<'_>, strategy: Strategy) -> std::io::Result<[f64; 3]> {
    let started = Instant::now();
    // keeps its workspace from ray to ray; a renderer has one per thread
    let mut tracer =
        Tracer { sky: field.evaluator(), sampler, strategy, rng: stream(0, Purpose::Sampling, 0, 0) };
    let [width, height] = SIZE;
    let mut picture = format!("P6 {width} {height} 255\n").into_bytes();
    let (mut total, mut spread) = (0.0, 0.0);
    for pixel in 0..width * height {
        let (column, row) = ((pixel % width) as f32, (pixel / width) as f32);
        let (u, v) = ((column + 0.5) / height as f32 - 0.75, 0.5 - (row + 0.5) / height as f32);
        tracer.rng = stream(0, Purpose::Sampling, pixel as u64, 0);
        let (mut sum, mut squares) = ([0.0; 3], 0.0);
        for _ in 0..SAMPLES {
            let light = tracer.trace([-4.0, 0.0, 1.0], unit([1.5, -u, v - 0.25]));
            sum = add(sum, 1.0 / SAMPLES as f32, light);
            squares += f64::from(luminance(light)).powi(2) / SAMPLES as f64;
        }
        let mean = f64::from(luminance(sum));
        total += mean;
        spread += (squares - mean * mean).max(0.0) / (SAMPLES - 1) as f64;
        picture.extend(sum.map(|v| (255.0 * (v / (1.0 + v)).powf(1.0 / 2.2)) as u8));
    }
    std::fs::write("ball.ppm", picture)?;
    let (count, seconds) = ((width * height) as f64, started.elapsed().as_secs_f64());
    let (mean, variance) = (total / count, spread * count / (total * total));
    let name = ["bsdf", "light", "mis"][strategy as usize];
    println!(
        "{name}: mean luminance {mean:.4}, variance of a pixel {variance:.2e} of its square, {seconds:.1} s"
    );
    Ok([mean, variance, seconds])
}

struct Tracer<'a> {
    sky: Evaluator,
    sampler: &'a Sampler<'a>,
    strategy: Strategy,
    rng: Stream,
}

impl Tracer<'_> {
    /// All surfaces are diffuse.
    fn trace(&mut self, mut from: Vector, mut along: Vector) -> Vector {
        let mut weight = 1.0;
        for _ in 0..4 {
            let Some((distance, normal)) = hit(from, along) else {
                // the whole interface: a direction (z up) in, linear Rec. 709 out
                return self.sky.radiance(along).map(|v| weight * v);
            };
            from = add(add(from, distance, along), 1e-3, normal);
            let density;
            (along, density) = self.draw(normal);
            weight *= ALBEDO * dot(along, normal).max(0.0) / PI / density;
            if weight == 0.0 {
                break;
            }
        }
        [0.0; 3]
    }

    /// A direction and its density: with `mis` the mean of both, whichever it was drawn by.
    fn draw(&mut self, normal: Vector) -> (Vector, f32) {
        let [u, v, choice] = [0; 3].map(|_| (self.rng.next_u32() >> 8) as f32 / (1 << 24) as f32);
        let by_light = self.strategy == Strategy::Light || (self.strategy == Strategy::Mis && choice < 0.5);
        let along = if by_light {
            self.sampler.sample([u, v]).direction
        } else {
            let (z, (s, c)) = (1.0 - 2.0 * u, (TAU * v).sin_cos());
            let r = (1.0 - z * z).sqrt();
            unit(add([r * c, r * s, z], 1.0, normal))
        };
        let (cosine, light) = (dot(along, normal).max(0.0) / PI, self.sampler.pdf(along));
        let density = match self.strategy {
            Strategy::Bsdf => cosine,
            Strategy::Light => light,
            Strategy::Mis => 0.5 * (cosine + light),
        };
        (along, density.max(1e-20))
    }
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
