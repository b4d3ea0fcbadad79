//! The linear functions of the expansion, by least squares.

use veni_core::expand::{Analysis, FEATURES, Region};
use veni_core::panorama::{TransferFunction, luminance};
use veni_light::cholesky;

use crate::Failure;
use crate::sample::{Sample, read};

/// A region counts as the sun's for its colour if its mean is this many times white.
const SUNNY: f64 = 10.0;

pub(crate) fn run(folder: &str) -> Result<(), Failure> {
    let panoramas = read(folder)?;
    let (mut exponent, mut sun) = (System::<FEATURES>::default(), System::<FEATURES>::default());
    let (mut red, mut blue) = (System::<2>::default(), System::<2>::default());
    for sample in Sample::all(&panoramas) {
        let analysis = Analysis::new(&sample.ldr, TransferFunction::Srgb);
        let (grid, truth) = (sample.truth.grid(), sample.truth.pixels());
        let weight = |pixel: usize| grid.solid_angle(pixel / grid.width);
        let total: f64 = analysis.regions().iter().map(|r| r.solid_angle).sum();
        let regions = analysis.regions();
        let mut energies = vec![[0f64; 3]; regions.len()];
        for (pixel, region, x) in analysis.pixels() {
            let target = f64::from(luminance(truth[pixel]).max(1.0)).ln();
            let row = regions[region].features.map(|f| f * f64::from(x));
            exponent.add(&row, target, weight(pixel) / total);
            energies[region]
                .iter_mut()
                .zip(truth[pixel])
                .for_each(|(e, v)| *e += weight(pixel) * f64::from(v));
        }
        let Some(chosen) = analysis.sun_region() else { continue };
        let (Region { solid_angle, features, centre, .. }, [r, g, b]) = (&regions[chosen], energies[chosen]);
        let mean = f64::from(luminance([r, g, b].map(|v| v as f32))) / solid_angle;
        sun.add(features, mean.ln(), 1.0);
        if mean > SUNNY {
            let row = [1.0, f64::from(centre[2])];
            red.add(&row, (r / g).ln(), 1.0);
            blue.add(&row, (b / g).ln(), 1.0);
        }
    }
    println!(
        "// {} panoramas of the training set, exposures of {:?} stops",
        panoramas.len(),
        crate::sample::STOPS
    );
    println!("exponent: {},", exponent.solve("exponent")?);
    println!("sun: {},", sun.solve("sun")?);
    println!("red: {},", red.solve("red")?);
    println!("blue: {},", blue.solve("blue")?);
    Ok(())
}

/// Weighted least squares for N unknowns.
struct System<const N: usize> {
    rows: Vec<([f64; N], f64, f64)>,
}

impl<const N: usize> Default for System<N> {
    fn default() -> Self {
        Self { rows: Vec::new() }
    }
}

impl<const N: usize> System<N> {
    fn add(&mut self, row: &[f64; N], target: f64, weight: f64) {
        self.rows.push((*row, target, weight));
    }

    /// The unknowns, as Rust text; on stderr how much of the targets they explain.
    fn solve(&self, name: &str) -> Result<String, Failure> {
        let mut gram = [[0f64; N]; N];
        let mut right = [[0f64]; N];
        let total: f64 = self.rows.iter().map(|r| r.2).sum();
        for (row, target, weight) in &self.rows {
            for i in 0..N {
                right[i][0] += weight / total * row[i] * target;
                for j in 0..N {
                    gram[i][j] += weight / total * row[i] * row[j];
                }
            }
        }
        for (i, row) in gram.iter_mut().enumerate() {
            // a trace of ridge keeps features that hardly vary from running away
            row[i] += 1e-4;
        }
        let gram = gram.as_flattened_mut();
        cholesky::factor(gram, N).ok_or("the features depend on each other")?;
        cholesky::substitute(gram, N, &mut right);
        let solution = right.map(|[v]| v);
        let predict = |row: &[f64; N]| row.iter().zip(&solution).map(|(a, b)| a * b).sum::<f64>();
        let mean = self.rows.iter().map(|(_, t, w)| w * t).sum::<f64>() / total;
        let spread = |f: &dyn Fn(&[f64; N], f64) -> f64| {
            self.rows.iter().map(|(r, t, w)| w * f(r, *t).powi(2)).sum::<f64>() / total
        };
        let (all, left) = (spread(&|_, t| t - mean), spread(&|r, t| t - predict(r)));
        eprintln!("{name}: {} rows, deviation {:.3} of {:.3}", self.rows.len(), left.sqrt(), all.sqrt());
        Ok(format!("[{}]", solution.map(|v| format!("{v:.4}")).join(", ")))
    }
}
