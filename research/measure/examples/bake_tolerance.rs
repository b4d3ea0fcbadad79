//! What a bake could leave out: a field evaluated on a lattice that is refined where interpolation errs, against the whole
//! bake: `cargo run --release -p veni-research --example bake_tolerance -- WIDTH TOLERANCE D SKIES [PANORAMA …]`.
//!
//! SKIES random skies of the embedded model of latent dimension D, and the encoded panoramas, are baked at WIDTH × WIDTH/2.
//! Then the bake is done again as it could be: exact at every eighth pixel of every eighth row; each cell is either filled by
//! bicubic interpolation of log radiance or divided in four, down to single pixels. What divides it is an estimate of the
//! error from exact values alone, in two forms with a factor each:
//!
//! - *differences*: the factor times the greatest fourth difference of log radiance along the cell's edges. A kink in the
//!   interior of an edge of length h whose slopes differ by J has one of at least J h/2, and interpolation errs by at most
//!   J h/4 there: a factor of ½ bounds the error of a single kink.
//! - *surprise*: the factor times the greatest error of the prediction of the five exact values that divided the parent.
//!
//! A third run of each divides by the true error, which no bake knows (*oracle*): no estimate evaluates less at that tolerance.
//!
//! The error is that of radiance, |interpolated/exact − 1|, greatest of the three colours. Rows within 24 of a pole are
//! exact. *Evaluated* is the part of the pixels that the network was asked for: the bake cannot be faster than its inverse.

#![allow(clippy::print_stdout, reason = "a program for a terminal")]

use std::path::Path;

use rayon::prelude::*;
use veni_fit::Encoder;
use veni_image::Panorama;
use veni_light::latent::Latent;
use veni_light::model::Model;
use veni_light::sphere::Equirect;

/// Step of the first lattice, in pixels.
const COARSE: usize = 8;
/// Rows at each pole that are exact.
const POLE: usize = 3 * COARSE;
/// Factors of differences and of surprise, each pair a run.
const FACTORS: [[f32; 2]; 7] =
    [ORACLE, [0.05, 0.0], [0.2, 0.0], [0.5, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 4.0]];
/// Stands for the error itself, which no bake knows: how well the best estimate could do.
const ORACLE: [f32; 2] = [-1.0, -1.0];

type Error = Box<dyn std::error::Error>;

fn main() -> Result<(), Error> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [width, tolerance, dimension, skies, panoramas @ ..] = arguments.as_slice() else {
        return Err("usage: bake_tolerance WIDTH TOLERANCE D SKIES [PANORAMA …]".into());
    };
    let (width, tolerance): (usize, f32) = (width.parse()?, tolerance.parse()?);
    let (dimension, skies): (usize, u64) = (dimension.parse()?, skies.parse()?);
    let grid = Equirect::new(width, width / 2);
    if width % 64 != 0 {
        return Err(format!("{width} is not a multiple of 64").into());
    }
    let model = Model::pretrained_of(dimension).ok_or("no embedded model of this dimension")?;
    let mut latents: Vec<_> =
        (0..skies).map(|seed| (format!("seed {seed}"), Latent::from_seed(&model.prior(), seed))).collect();
    for path in panoramas {
        latents.push((path.clone(), encoded(&model, Path::new(path))?));
    }
    let decoder = model.decoder()?;
    let mut all = vec![Vec::new(); FACTORS.len()];
    for (name, latent) in &latents {
        let mut exact = vec![[0.0; 3]; grid.len()];
        decoder.condition(latent)?.log_radiance_batch(&grid.directions(), &mut exact);
        for (factors, all) in FACTORS.iter().zip(&mut all) {
            let found = Refined::new(grid, &exact, tolerance, *factors).outcome();
            eprintln!("{name} {factors:?} {found:?}");
            all.push(found);
        }
    }
    println!(
        "| differences | surprise | evaluated, mean | evaluated, most | worst error | 99.99 % | mean error |"
    );
    println!("|---|---|---|---|---|---|---|");
    for ([differences, surprise], all) in FACTORS.iter().zip(&all) {
        let mean = |f: fn(&Outcome) -> f64| all.iter().map(f).sum::<f64>() / all.len() as f64;
        let most = |f: fn(&Outcome) -> f64| all.iter().map(f).fold(0.0, f64::max);
        println!(
            "| {differences} | {surprise} | {:.1} % | {:.1} % | {:.3} % | {:.3} % | {:.4} % |",
            mean(|o| o.evaluated),
            most(|o| o.evaluated),
            most(|o| o.worst),
            most(|o| o.rare),
            mean(|o| o.mean)
        );
    }
    Ok(())
}

fn encoded(model: &Model, path: &Path) -> Result<Latent, Error> {
    let mut panorama = Panorama::read(path)?.resample(Equirect::new(128, 64));
    panorama.sanitise()?;
    let log_exposure = panorama.mean_log_luminance();
    let log: Vec<f32> = panorama.log().as_flattened().iter().map(|v| v - log_exposure).collect();
    let found = Encoder::new(model)?.encode(panorama.grid(), &[&log])?;
    Ok(Latent { log_exposure, ..Latent::new(found[0].vectors.clone()) })
}

/// In percent.
#[derive(Clone, Debug)]
struct Outcome {
    evaluated: f64,
    worst: f64,
    rare: f64,
    mean: f64,
}

/// A bake that was done by refinement.
struct Refined<'a> {
    grid: Equirect,
    /// Log radiance of every pixel.
    exact: &'a [[f32; 3]],
    found: Vec<[f32; 3]>,
    evaluated: Vec<bool>,
}

/// What is known at a step of the lattice.
struct Level<'a> {
    step: usize,
    columns: usize,
    /// Log radiance at the nodes.
    nodes: Vec<[f32; 3]>,
    /// Which cells the division of the parents has left, and how much their prediction erred.
    cells: &'a [Option<f32>],
}

impl<'a> Refined<'a> {
    fn new(grid: Equirect, exact: &'a [[f32; 3]], tolerance: f32, factors: [f32; 2]) -> Self {
        let pixels = grid.len();
        let mut bake =
            Self { grid, exact, found: vec![[f32::NAN; 3]; pixels], evaluated: vec![false; pixels] };
        let (columns, rows) = (grid.width / COARSE, grid.height / COARSE);
        for row in 0..grid.height {
            let whole = row < POLE || row >= grid.height - POLE;
            let step = if whole { 1 } else { COARSE };
            if whole || row % COARSE == 0 {
                (0..grid.width).step_by(step).for_each(|column| bake.evaluate(row, column));
            }
        }
        let inside = |row: usize| (POLE / COARSE..rows - POLE / COARSE).contains(&row);
        // the first cells have no parents to be surprised by: where only surprise counts, all of them are divided
        let first = if factors[0] == 0.0 { f32::INFINITY } else { 0.0 };
        let mut cells: Vec<_> = (0..rows * columns).map(|k| inside(k / columns).then_some(first)).collect();
        let mut step = COARSE;
        while step > 1 {
            cells = bake.refine(step, &cells, tolerance, factors);
            step /= 2;
        }
        bake
    }

    fn evaluate(&mut self, row: usize, column: usize) {
        let at = row * self.grid.width + column % self.grid.width;
        (self.found[at], self.evaluated[at]) = (self.exact[at], true);
    }

    /// Fills or divides every cell of a step; returns those of half of it.
    fn refine(
        &mut self,
        step: usize,
        cells: &[Option<f32>],
        tolerance: f32,
        factors: [f32; 2],
    ) -> Vec<Option<f32>> {
        let [differences, surprise] = factors;
        let Equirect { width, height } = self.grid;
        let (columns, rows) = (width / step, height / step);
        let nodes = (0..rows * columns).map(|k| self.found[k / columns * step * width + k % columns * step]);
        let level = Level { step, columns, nodes: nodes.collect(), cells };
        let divided: Vec<bool> = (0..rows * columns)
            .into_par_iter()
            .map(|k| {
                let estimate = |erred: f32| match erred {
                    f32::INFINITY => erred,
                    _ if factors == ORACLE => level.error(k / columns, k % columns, self.exact),
                    _ => (surprise * erred)
                        .max(differences * level.fourth_difference(k / columns, k % columns)),
                };
                level.cells[k].is_some_and(|erred| estimate(erred) > tolerance)
            })
            .collect();
        let found = self.found.par_chunks_mut(step * width).zip(self.evaluated.par_chunks(step * width));
        found.enumerate().for_each(|(row, (pixels, evaluated))| level.fill(row, &divided, pixels, evaluated));
        let mut next = vec![None; 4 * rows * columns];
        let half = step / 2;
        for k in (0..rows * columns).filter(|k| divided[*k]) {
            let (row, column) = (k / columns, k % columns);
            let mut erred = 0f32;
            for (down, right) in [(0, half), (half, 0), (half, half), (half, step), (step, half)] {
                let (y, x) = (row * step + down, (column * step + right) % width);
                let predicted = level.interpolated(row, column, down, right);
                let distance = |c: usize| (predicted[c] - self.exact[y * width + x][c]).abs();
                erred = (0..3).map(distance).fold(erred, f32::max);
                self.evaluate(y, x);
            }
            // corners that a coarser cell has filled
            for (down, right) in [(0, 0), (0, step), (step, 0), (step, step)] {
                self.evaluate(row * step + down, column * step + right);
            }
            for (down, right) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                next[(2 * row + down) * 2 * columns + 2 * column + right] = Some(erred);
            }
        }
        next
    }

    fn outcome(&self) -> Outcome {
        let mut errors: Vec<f32> = self
            .found
            .par_iter()
            .zip(self.exact)
            .map(|(a, b)| {
                (0..3)
                    .map(|c| (a[c] - b[c]).exp_m1().abs())
                    .fold(0.0, |m: f32, e| if e.is_nan() { f32::INFINITY } else { m.max(e) })
            })
            .collect();
        let mean = errors.iter().map(|e| f64::from(*e)).sum::<f64>() / errors.len() as f64;
        let rank = errors.len() - 1 - errors.len() / 10_000;
        let (_, rare, above) = errors.select_nth_unstable_by(rank, f32::total_cmp);
        let worst = above.iter().copied().fold(*rare, f32::max);
        let evaluated = self.evaluated.iter().filter(|e| **e).count() as f64 / self.evaluated.len() as f64;
        let percent = |v: f32| 100.0 * f64::from(v);
        Outcome {
            evaluated: 100.0 * evaluated,
            worst: percent(worst),
            rare: percent(*rare),
            mean: 100.0 * mean,
        }
    }
}

impl Level<'_> {
    /// A node, by offsets from a cell's first one; columns go round.
    fn node(&self, row: usize, column: usize, down: isize, right: isize) -> [f32; 3] {
        let columns = self.columns as isize;
        let column = (column as isize + right).rem_euclid(columns) as usize;
        self.nodes[(row as isize + down) as usize * self.columns + column]
    }

    /// The greatest along the four edges of a cell, of the stencils about their ends.
    fn fourth_difference(&self, row: usize, column: usize) -> f32 {
        let difference = |at: &dyn Fn(isize) -> [f32; 3]| {
            let [a, b, c, d, e] = [-2, -1, 0, 1, 2].map(at);
            (0..3).map(|k| (a[k] - 4.0 * b[k] + 6.0 * c[k] - 4.0 * d[k] + e[k]).abs()).fold(0.0, f32::max)
        };
        let mut most = 0f32;
        for (down, right) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            most = most.max(difference(&|k| self.node(row, column, down, right + k)));
            most = most.max(difference(&|k| self.node(row, column, down + k, right)));
        }
        most
    }

    /// Log radiance at a pixel of a cell, from its 4 × 4 nodes.
    fn interpolated(&self, row: usize, column: usize, down: usize, right: usize) -> [f32; 3] {
        let [v, u] = [down, right].map(|k| weights(k as f32 / self.step as f32));
        let mut sum = [0.0; 3];
        for (i, v) in (-1..).zip(v) {
            for (j, u) in (-1..).zip(u) {
                let node = self.node(row, column, i, j);
                sum = [0, 1, 2].map(|c| sum[c] + v * u * node[c]);
            }
        }
        sum
    }

    /// The true error of a cell, were it filled.
    fn error(&self, row: usize, column: usize, exact: &[[f32; 3]]) -> f32 {
        let width = self.columns * self.step;
        let pixels = (0..self.step * self.step).map(|k| (k / self.step, k % self.step));
        pixels.fold(0.0, |most, (down, right)| {
            let found = self.interpolated(row, column, down, right);
            let exact = exact[(row * self.step + down) * width + column * self.step + right];
            (0..3).map(|c| (found[c] - exact[c]).exp_m1().abs()).fold(most, f32::max)
        })
    }

    /// The pixels of the cells of a row that are not divided.
    fn fill(&self, row: usize, divided: &[bool], pixels: &mut [[f32; 3]], evaluated: &[bool]) {
        let width = self.columns * self.step;
        for column in 0..self.columns {
            let k = row * self.columns + column;
            if self.cells[k].is_none() || divided[k] {
                continue;
            }
            for (down, right) in (0..self.step * self.step).map(|k| (k / self.step, k % self.step)) {
                let at = down * width + column * self.step + right;
                if !evaluated[at] {
                    pixels[at] = self.interpolated(row, column, down, right);
                }
            }
        }
    }
}

/// Of Lagrange's cubic through −1, 0, 1, 2.
fn weights(t: f32) -> [f32; 4] {
    let (a, b, c, d) = (t + 1.0, t, t - 1.0, t - 2.0);
    [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0]
}
