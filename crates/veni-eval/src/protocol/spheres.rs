//! `spheres`: three balls under the decoded light and the true one, as single-image light estimation is judged (Phongthawee et al.
//! 2024, after Wang et al. 2022).
//!
//! A diffuse, a matte silver (GGX, α = 0.16, a perfect conductor) and a mirror ball before a camera that looks along +x from far
//! away. *si-RMSE*: root mean square error at the best factor, in units of the true render's 99.9th percentile. *RMSE*: after each
//! render's percentiles 0.1 and 99.9 went to 0 and 1. *Angle*: mean angle between RGB vectors, degrees.

use super::quality::reconstruct;
use super::{Evaluation, Report, reconstruction};
use crate::Result;
use crate::codec::Codec;
use crate::table::{Cell, Table};
use veni_data::Part;
use veni_data::parallel::parallel;
use veni_image::tonemap::quantile;
use veni_light::sphere::Equirect;
use veni_light::vector::{self, dot, length};

/// Pixels along the diameter of a ball.
const SIZE: usize = 48;
/// GGX α of the matte ball.
const ALPHA: f64 = 0.16;
/// Percentiles that a normalised render spans.
const PERCENTILES: [f64; 2] = [0.001, 0.999];
/// The balls.
const BALLS: [&str; 3] = ["diffuse", "matte", "mirror"];
/// Titles of each ball's columns.
pub(super) const COLUMNS: [&str; 9] =
    ["Diffuse, si-RMSE", "RMSE", "°", "Matte, si-RMSE", "RMSE ", "° ", "Mirror, si-RMSE", "RMSE  ", "°  "];

/// The mean over panoramas.
pub(super) fn mean(errors: &[[Errors; 3]]) -> [Errors; 3] {
    std::array::from_fn(|ball| {
        std::array::from_fn(|k| errors.iter().map(|e| e[ball][k]).sum::<f64>() / errors.len() as f64)
    })
}

/// Errors of one ball: scale-invariant, normalised, angular.
pub(super) type Errors = [f64; 3];

/// Table 1: each codec, means over the panoramas; table 2: each panorama.
///
/// # Errors
/// As coding and decoding fail.
pub fn run(run: &Evaluation<'_>) -> Result<Report> {
    let titles = |first: &[&'static str]| [first, &COLUMNS].concat();
    let mut all = Table::new("spheres", "Three balls under decoded light", &titles(&["System", "Pass", "D"]));
    let mut each =
        Table::new("spheres-images", "Three balls under each light", &titles(&["Panorama", "System"]));
    let balls = Balls::new(run.data.grid());
    for subject in run.subjects {
        let codecs = run.codecs(subject);
        codecs.iter().try_for_each(|codec| add(run, &balls, &**codec, &mut all, &mut each))?;
    }
    run.others.iter().try_for_each(|codec| add(run, &balls, *codec, &mut all, &mut each))?;
    all.note(format!(
        "Means over the panoramas; {} balls of {SIZE} pixels, camera along +x; less is better.",
        BALLS.join(", ")
    ));
    all.note(run.optimised_note());
    Ok(Report { tables: vec![all], details: vec![each], ..Report::default() })
}

/// The codes of a share of the panoramas.
///
/// # Errors
/// As coding and writing fail.
pub fn keep(run: &Evaluation<'_>, part: Part) -> Result<()> {
    reconstruction::keep(run, part)
}

fn add(
    run: &Evaluation<'_>,
    balls: &Balls,
    codec: &dyn Codec,
    all: &mut Table,
    each: &mut Table,
) -> Result<()> {
    let items = run.data.items();
    let images = reconstruct(run, codec)?.images;
    let errors = parallel(items.len(), |at| {
        Ok(balls.errors(&balls.render(&images[at]), &balls.render(items[at].log_radiance.fetched())))
    })?;
    let label = format!("{}, {}", codec.system(), codec.pass());
    for (item, errors) in items.iter().zip(&errors) {
        each.push([vec![Cell::text(item.name()), Cell::text(&label)], cells(errors)].concat());
    }
    let first =
        vec![Cell::text(codec.system()), Cell::text(codec.pass()), Cell::Number(codec.dimension() as f64, 0)];
    all.push([first, cells(&mean(&errors))].concat());
    Ok(())
}

pub(super) fn cells(errors: &[Errors; 3]) -> Vec<Cell> {
    errors
        .iter()
        .flat_map(|[invariant, normalised, angle]| {
            [Cell::Number(*invariant, 3), Cell::Number(*normalised, 3), Cell::Number(*angle, 2)]
        })
        .collect()
}

/// The balls' pixels, and the directions that light them.
pub(super) struct Balls {
    grid: Equirect,
    directions: Vec<[f64; 3]>,
    solid_angles: Vec<f64>,
    normals: Vec<[f64; 3]>,
}

/// Towards the camera.
const VIEW: [f64; 3] = [-1.0, 0.0, 0.0];

impl Balls {
    pub(super) fn new(grid: Equirect) -> Self {
        let at = |k: usize| (2 * k + 1) as f64 / SIZE as f64 - 1.0;
        let normal = |k: usize| {
            let (right, up) = (at(k % SIZE), -at(k / SIZE));
            let rest = 1.0 - right * right - up * up;
            // looking along +x with z up, −y is on the right
            (rest > 0.0).then(|| [-rest.sqrt(), -right, up])
        };
        Self {
            grid,
            directions: grid.directions().into_iter().map(|d| d.map(f64::from)).collect(),
            solid_angles: (0..grid.height).map(|row| grid.solid_angle(row)).collect(),
            normals: (0..SIZE * SIZE).filter_map(normal).collect(),
        }
    }

    /// Radiance of every pixel of the three balls under light given as log radiance.
    pub(super) fn render(&self, log_radiance: &[f32]) -> [Vec<[f64; 3]>; 3] {
        let light: Vec<[f64; 3]> =
            log_radiance.as_chunks().0.iter().map(|p| p.map(|v| f64::from(v).exp())).collect();
        let sum = |weight: &dyn Fn([f64; 3]) -> f64| {
            let mut sum = [0.0; 3];
            for (k, (direction, radiance)) in self.directions.iter().zip(&light).enumerate() {
                let weight = weight(*direction);
                if weight > 0.0 {
                    let weight = weight * self.solid_angles[k / self.grid.width];
                    sum = [0, 1, 2].map(|c| sum[c] + weight * radiance[c]);
                }
            }
            sum
        };
        let diffuse = |n: [f64; 3]| sum(&|d| dot(n, d).max(0.0) / std::f64::consts::PI);
        let matte = |n: [f64; 3]| sum(&|d| conductor(n, d));
        let mirror = |n: [f64; 3]| {
            let cosine = dot(n, VIEW);
            let direction = [0, 1, 2].map(|k| (2.0 * cosine * n[k] - VIEW[k]) as f32);
            let [column, row] = self.grid.pixel(direction).map(|v| v as usize);
            light[row.min(self.grid.height - 1) * self.grid.width + column]
        };
        let all = |ball: &dyn Fn([f64; 3]) -> [f64; 3]| self.normals.iter().map(|n| ball(*n)).collect();
        [all(&diffuse), all(&matte), all(&mirror)]
    }

    pub(super) fn errors(&self, found: &[Vec<[f64; 3]>; 3], truth: &[Vec<[f64; 3]>; 3]) -> [Errors; 3] {
        std::array::from_fn(|ball| errors(&found[ball], &truth[ball]))
    }
}

/// Light of direction `d` towards the camera per radiance and solid angle, from a perfect conductor of normal `n`: D G/(4 n·v), with
/// the height-correlated Smith term (Heitz 2014).
fn conductor(n: [f64; 3], d: [f64; 3]) -> f64 {
    let (l, v) = (dot(n, d), dot(n, VIEW));
    if l <= 0.0 || v <= 0.0 {
        return 0.0;
    }
    let half = vector::add(d, VIEW);
    let h = dot(n, half) / length(half);
    let square = ALPHA * ALPHA;
    let t = h * h * (square - 1.0) + 1.0;
    let distribution = square / (std::f64::consts::PI * t * t);
    let smith = |a: f64, b: f64| a * (square + (1.0 - square) * b * b).sqrt();
    // G/(4 n·l n·v) times n·l
    distribution * 0.5 * l / (smith(l, v) + smith(v, l))
}

fn errors(found: &[[f64; 3]], truth: &[[f64; 3]]) -> Errors {
    let (p, t) = (found.as_flattened(), truth.as_flattened());
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let factor = product(p, t) / product(p, p);
    let spans = [p, t].map(|values| {
        let values: Vec<f32> = values.iter().map(|v| *v as f32).collect();
        PERCENTILES.map(|at| f64::from(quantile(&values, at)))
    });
    let rms = |of: &dyn Fn(f64, f64) -> f64| {
        (p.iter().zip(t).map(|(p, t)| of(*p, *t).powi(2)).sum::<f64>() / p.len() as f64).sqrt()
    };
    let normal =
        |v: f64, [low, high]: [f64; 2]| ((v - low) / (high - low).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    let angle = |a: &[f64; 3], b: &[f64; 3]| {
        let cosine = dot(*a, *b) / (dot(*a, *a) * dot(*b, *b)).sqrt();
        cosine.clamp(-1.0, 1.0).acos().to_degrees()
    };
    let angles = found.iter().zip(truth).map(|(a, b)| angle(a, b)).sum::<f64>() / found.len() as f64;
    [
        rms(&|p, t| factor * p - t) / spans[1][1].max(f64::MIN_POSITIVE),
        rms(&|p, t| normal(p, spans[0]) - normal(t, spans[1])),
        angles,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Equirect = Equirect { width: 128, height: 64 };

    fn balls() -> Balls {
        Balls::new(GRID)
    }

    /// Grey light of radiance 1, and a bright patch where a function says so.
    fn light(patch: impl Fn([f32; 3]) -> bool, radiance: [f32; 3]) -> Vec<f32> {
        let log = |d| if patch(d) { radiance } else { [1.0; 3] }.map(f32::ln);
        GRID.directions().into_iter().flat_map(log).collect()
    }

    #[test]
    fn even_light_is_reflected_whole() {
        let rendered = balls().render(&light(|_| false, [1.0; 3]));
        let mean =
            |ball: usize| rendered[ball].iter().map(|p| p[0]).sum::<f64>() / rendered[ball].len() as f64;
        assert!((mean(0) - 1.0).abs() < 0.002, "{}", mean(0));
        assert!((mean(2) - 1.0).abs() < 1e-6, "{}", mean(2));
        // single scattering keeps all but a little of it
        assert!((0.93..1.0).contains(&mean(1)), "{}", mean(1));
    }

    #[test]
    fn light_is_where_it_comes_from() {
        // from the left of the camera, +y, and from behind the camera
        let balls = balls();
        let left = balls.render(&light(|d| d[1] > 0.9, [50.0; 3]));
        for (ball, rendered) in left.iter().enumerate() {
            let brightest =
                (0..rendered.len()).max_by(|a, b| rendered[*a][0].total_cmp(&rendered[*b][0])).unwrap();
            assert!(balls.normals[brightest][1] > 0.5, "{ball}: {:?}", balls.normals[brightest]);
        }
        let behind = balls.render(&light(|d| d[0] < -0.98, [50.0; 3]));
        let towards = |at: &usize| balls.normals[*at][0];
        let middle = (0..balls.normals.len()).min_by(|a, b| towards(a).total_cmp(&towards(b))).unwrap();
        let lit = behind.each_ref().map(|rendered| rendered[middle][0]);
        assert!(lit.iter().all(|radiance| *radiance > 2.0), "the camera's side is lit: {lit:?}");
    }

    #[test]
    fn errors_are_blind_to_exposure_and_see_the_rest() {
        let balls = balls();
        let truth = balls.render(&light(|d| d[1] > 0.9, [50.0; 3]));
        let bright: Vec<f32> = light(|d| d[1] > 0.9, [50.0; 3]).iter().map(|v| v + 1.0).collect();
        for errors in balls.errors(&balls.render(&bright), &truth) {
            assert!(errors.iter().all(|e| *e < 1e-3), "{errors:?}");
        }
        let elsewhere = balls.render(&light(|d| d[1] < -0.9, [50.0; 3]));
        let red = balls.render(&light(|d| d[1] > 0.9, [50.0, 5.0, 5.0]));
        for (moved, warm) in balls.errors(&elsewhere, &truth).iter().zip(balls.errors(&red, &truth)) {
            assert!(moved[0] > 0.05 && moved[1] > 0.1, "{moved:?}");
            assert!(warm[2] > 2.0 && moved[2] < 1.0, "{warm:?}");
        }
    }
}
