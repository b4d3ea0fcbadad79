//! How far expanded panoramas are from the truth.

use veni_core::expand::Expand;
use veni_core::expand::{Analysis, ExpandOptions};
use veni_core::panorama::{Panorama, TransferFunction, luminance};

use crate::Failure;
use crate::operators::{banterle, landis};
use crate::sample::{STOPS, Sample, read};

/// Added before logarithms: about what one step of 8-bit sRGB is worth near black.
const FLOOR: f32 = 1e-3;

/// Errors of one panorama.
#[derive(Clone, Copy, Debug)]
struct Errors {
    /// Root mean square of the error of ln radiance over the sphere.
    log: f64,
    /// The same where the truth is above white in some channel.
    clipped: f64,
    /// |ln(energy / true energy)| where the truth is above white.
    energy: f64,
    /// |ln(irradiance / true irradiance)| of a surface that faces up.
    irradiance: f64,
}

impl Errors {
    fn new(truth: &Panorama, guess: &Panorama) -> Self {
        let grid = truth.grid();
        let (mut all, mut clipped) = ([0f64; 2], [0f64; 2]);
        let (mut energy, mut irradiance) = ([0f64; 2], [0f64; 2]);
        for (k, (t, g)) in truth.pixels().iter().zip(guess.pixels()).enumerate() {
            let weight = grid.solid_angle(k / grid.width);
            let square: f64 =
                t.iter().zip(g).map(|(t, g)| f64::from(((g + FLOOR) / (t + FLOOR)).ln()).powi(2)).sum();
            let both = [g, t].map(|p| f64::from(luminance(*p)));
            let add = |to: &mut [f64; 2], by: [f64; 2]| to.iter_mut().zip(by).for_each(|(a, b)| *a += b);
            add(&mut all, [weight * square / 3.0, weight]);
            if t.iter().any(|v| *v > 1.0) {
                add(&mut clipped, [weight * square / 3.0, weight]);
                add(&mut energy, both.map(|y| y * weight));
            }
            let cosine = grid.polar(k / grid.width).cos().max(0.0);
            add(&mut irradiance, both.map(|y| y * weight * cosine));
        }
        let root = |[sum, weight]: [f64; 2]| (sum / weight.max(1e-12)).sqrt();
        let ratio = |[guess, truth]: [f64; 2]| if truth > 0.0 { (guess / truth).ln().abs() } else { 0.0 };
        Self { log: root(all), clipped: root(clipped), energy: ratio(energy), irradiance: ratio(irradiance) }
    }
}

/// A way from display values to radiance.
struct Method {
    name: String,
    run: Box<dyn Fn(&Sample) -> Panorama>,
}

impl Method {
    fn new(name: impl Into<String>, run: impl Fn(&Sample) -> Panorama + 'static) -> Self {
        Self { name: name.into(), run: Box::new(run) }
    }

    fn landis(brightest: f32) -> Self {
        Self::new(format!("Landis 2002, brightest {brightest}"), move |s| {
            landis(&s.ldr.linear(TransferFunction::Srgb), brightest)
        })
    }

    fn banterle(white: f32) -> Self {
        Self::new(format!("Banterle 2006, white {white}"), move |s| {
            banterle(&Analysis::new(&s.ldr, TransferFunction::Srgb), white)
        })
    }
}

pub(crate) fn run(folder: &str, train: Option<&str>) -> Result<(), Failure> {
    let mut methods = vec![Method::new("linearised", |s| s.ldr.linear(TransferFunction::Srgb))];
    if let Some(train) = train {
        let train = read(train)?;
        let whites = [1.5, 2.0, 3.0, 4.0, 8.0, 16.0];
        methods.push(best(whites.map(Method::landis).into(), &train));
        methods.push(best(whites.map(Method::banterle).into(), &train));
    }
    methods.push(Method::new("expanded without sun", |s| {
        let mut options = ExpandOptions::default();
        options.parameters.faintest = f64::INFINITY;
        s.ldr.expand(&options).panorama
    }));
    methods.push(Method::new("expanded", |s| s.ldr.expand(&ExpandOptions::default()).panorama));
    let panoramas = read(folder)?;
    println!(
        "| stops | | log RMSE | clipped log RMSE | energy, median | energy, mean | irradiance, median | irradiance, mean |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let mut every: Vec<Vec<Errors>> = methods.iter().map(|_| Vec::new()).collect();
    for stops in STOPS {
        let samples: Vec<_> = panoramas.iter().map(|(_, p)| Sample::new(p, stops)).collect();
        for (method, every) in methods.iter().zip(&mut every) {
            let errors: Vec<_> = samples.iter().map(|s| Errors::new(&s.truth, &(method.run)(s))).collect();
            row(&format!("{stops:+}"), &method.name, &errors);
            every.extend(errors);
        }
    }
    methods.iter().zip(&every).for_each(|(method, errors)| row("all", &method.name, errors));
    println!("\nWhere the truth is above white, |ln(energy / true energy)|, linearised → expanded:\n");
    println!("| panorama |{}", STOPS.map(|s| format!(" {s:+} |")).concat());
    println!("|---|{}", "---|".repeat(STOPS.len()));
    for (k, (name, _)) in panoramas.iter().enumerate() {
        let cell = |(s, _): (usize, &f32)| {
            let at = s * panoramas.len() + k;
            format!(" {:.2} → {:.2} |", every[0][at].energy, every[every.len() - 1][at].energy)
        };
        println!("| {name} |{}", STOPS.iter().enumerate().map(cell).collect::<String>());
    }
    Ok(())
}

/// The method with the smallest mean log RMSE where the truth is clipped.
fn best(methods: Vec<Method>, train: &[(String, Panorama)]) -> Method {
    let score = |method: &Method| {
        let errors = Sample::all(train).map(|s| Errors::new(&s.truth, &(method.run)(&s)).clipped);
        let (sum, count) = errors.fold((0.0, 0), |(sum, count), e| (sum + e, count + 1));
        sum / f64::from(count.max(1))
    };
    let mut scored: Vec<_> = methods.into_iter().map(|m| (score(&m), m)).collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    scored.swap_remove(0).1
}

fn row(stops: &str, name: &str, errors: &[Errors]) {
    let mean = |f: fn(&Errors) -> f64| errors.iter().map(f).sum::<f64>() / errors.len().max(1) as f64;
    let median = |f: fn(&Errors) -> f64| {
        let mut all: Vec<_> = errors.iter().map(f).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    println!(
        "| {stops} | {name} | {:.3} | {:.3} | {:.2} | {:.2} | {:.2} | {:.2} |",
        mean(|e| e.log),
        mean(|e| e.clipped),
        median(|e| e.energy),
        mean(|e| e.energy),
        median(|e| e.irradiance),
        mean(|e| e.irradiance)
    );
}
