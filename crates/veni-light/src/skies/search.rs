//! The least step of a draw that fulfils a request. MODEL (76).

use super::{SkyRequest, UP, temperature};
use crate::field::{Decoder, Field};
use crate::latent::{Draw, Latent, MEASURES, Prior, Row, irradiance, sine};
use crate::light::luminance;
use crate::light::sh::pull_back_irradiance;
use crate::random::Stream;
use crate::sphere::Equirect;
use crate::{Error, Result};

/// Where the light on a level surface is summed.
const GRID: (usize, usize) = (64, 32);
/// Most steps; two or three are enough where the request can be fulfilled.
const STEPS: usize = 12;
/// Temperatures and shares closer than this, natural logarithm, are as asked.
const NEAR: f64 = 2e-3;
/// Largest change of the logarithm of a temperature in one step: the derivative is not trusted further.
const STRIDE: f64 = 0.5;
/// Step of a central difference.
const DIFFERENCE: f64 = 1e-4;

/// Draws a code and moves it.
pub(super) fn search(
    request: &SkyRequest,
    decoder: &Decoder,
    prior: &Prior,
    rng: &mut Stream,
) -> Result<Latent> {
    let mut draw = prior.draw(rng);
    if let (Some(sun), Some(azimuth)) = (prior.sun(), request.sun.azimuth) {
        sun.head(azimuth, &mut draw);
    }
    let grid = Equirect::new(GRID.0, GRID.1);
    // where nothing depends on the field one step is exact
    let steps = if request.overcast.is_some() || request.temperature.is_some() { STEPS } else { 1 };
    for _ in 0..steps {
        let sun = prior.sun().map(|sun| sun.rows(&request.sun, &draw));
        let mut rows = sun.unwrap_or_default();
        let mut near = rows.iter().all(|row| row.by.abs() < NEAR);
        if steps > 1 {
            let state = State::new(decoder, prior, &draw, grid)?;
            let further = [state.overcast(request, prior, &draw), state.temperature(request, prior)];
            for row in further.into_iter().flatten() {
                near &= row.by.abs() < NEAR;
                rows.push(row);
            }
        }
        if near {
            break;
        }
        draw.shift(&rows);
    }
    let mut latent = prior.code(&draw);
    if let Some(overcast) = request.overcast {
        exactly(overcast, decoder, &mut latent, grid)?;
    }
    Ok(latent)
}

/// The light of a draw.
struct State {
    /// Of the vectors alone.
    field: Field,
    grid: Equirect,
    /// Irradiance of a level surface from the field.
    diffuse: [f64; 3],
    /// Measures of the sun, where there is one.
    sun: Option<[f64; MEASURES]>,
}

impl State {
    fn new(decoder: &Decoder, prior: &Prior, draw: &Draw, grid: Equirect) -> Result<Self> {
        let latent = prior.code(draw);
        let sun = prior.sun().filter(|_| latent.lights.sun().is_some()).map(|sun| sun.measures(draw));
        let field = plain(decoder, latent)?;
        let diffuse = level(&field, grid);
        if !diffuse.iter().all(|e| e.is_finite() && *e > 0.0) {
            return Err(Error::invalid("the sky that was drawn is not finite: the model is broken"));
        }
        Ok(Self { field, grid, diffuse, sun })
    }

    /// Irradiance of a level surface from a sun of these measures.
    fn direct(t: &[f64; MEASURES]) -> [f64; 3] {
        irradiance(t).map(|e| e * sine(t))
    }

    /// What moves the sun's share of the light to what is asked. The light of the field and the sun's elevation are taken as they
    /// are; where the other conditions move them, the next step follows.
    fn overcast(&self, request: &SkyRequest, prior: &Prior, draw: &Draw) -> Option<Row> {
        let (sun, t, asked) = (prior.sun()?, self.sun?, request.overcast?);
        let [diffuse, direct] = [self.diffuse, Self::direct(&t)].map(bright);
        let by = ((1.0 - asked) / asked * diffuse / direct).ln();
        let now = bright(irradiance(&t)).ln();
        Some(sun.luminance_to(now + by, draw))
    }

    /// What moves the temperature to what is asked: the derivative of its logarithm, through the field and the sun.
    fn temperature(&self, request: &SkyRequest, prior: &Prior) -> Option<Row> {
        let asked = request.temperature?;
        let direct = self.sun.map_or([0.0; 3], |t| Self::direct(&t));
        let total = [0, 1, 2].map(|c| self.diffuse[c] + direct[c]);
        let (by, by_channel) = towards(asked, total)?;
        let gradient = pull_back_irradiance(&self.field, self.grid, &[(UP, by_channel)]);
        let mut row = Row { by, ..prior.row(&gradient.vectors) };
        if let (Some(sun), Some(t)) = (prior.sun(), self.sun) {
            let sun = sun.measure_row(by_measures(&t, by_channel));
            row.g.iter_mut().zip(&sun.g).for_each(|(a, b)| *a += b);
            row.sun = sun.sun;
        }
        Some(row)
    }
}

/// By how much the logarithm of the temperature is to change, and its derivatives with respect to the channels of the light. Of light
/// that is too red or too blue for a temperature, the same of its tint, ln B/R, towards white.
fn towards(asked: f64, total: [f64; 3]) -> Option<(f64, [f64; 3])> {
    let tint = |[r, _, b]: [f64; 3]| Some((b / r).ln());
    let log = |rgb: [f64; 3]| temperature(rgb).map(f64::ln);
    let (measure, wanted): (&dyn Fn([f64; 3]) -> Option<f64>, f64) =
        if log(total).is_some() { (&log, asked.ln()) } else { (&tint, 0.0) };
    let by = (wanted - measure(total)?).clamp(-STRIDE, STRIDE);
    let mut derivatives = [0.0; 3];
    for c in 0..3 {
        let at = |factor: f64| {
            let mut moved = total;
            moved[c] *= factor;
            measure(moved)
        };
        derivatives[c] = (at(1.0 + DIFFERENCE)? - at(1.0 - DIFFERENCE)?) / (2.0 * DIFFERENCE * total[c]);
    }
    Some((by, derivatives))
}

/// ∂/∂t of Σ d E for the derivatives d with respect to the irradiance of a level surface.
fn by_measures(t: &[f64; MEASURES], by_channel: [f64; 3]) -> [f64; MEASURES] {
    std::array::from_fn(|k| {
        let at = |step: f64| {
            let mut moved = *t;
            moved[k] += step;
            State::direct(&moved).iter().zip(by_channel).map(|(e, d)| e * d).sum::<f64>()
        };
        (at(DIFFERENCE) - at(-DIFFERENCE)) / (2.0 * DIFFERENCE)
    })
}

/// Scales the sun, by next to nothing, so that its share is what is asked to rounding.
fn exactly(overcast: f64, decoder: &Decoder, latent: &mut Latent, grid: Equirect) -> Result<()> {
    let Some(sun) = latent.lights.sun() else { return Ok(()) };
    let direct = f64::from(luminance(sun.irradiance_on(UP)));
    let diffuse = bright(level(&plain(decoder, latent.clone())?, grid));
    let factor = (1.0 - overcast) / overcast * diffuse / direct;
    latent.lights = latent.lights.scaled(factor as f32);
    Ok(())
}

/// The field of the vectors alone, before the exposure.
fn plain(decoder: &Decoder, latent: Latent) -> Result<Field> {
    decoder.condition(&Latent::new(latent.vectors))
}

/// Irradiance of a level surface.
fn level(field: &Field, grid: Equirect) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (index, (radiance, direction)) in field.bake(grid).iter().zip(grid.directions()).enumerate() {
        let weight = grid.solid_angle(index / grid.width) * f64::from(direction[2].max(0.0));
        sum = [0, 1, 2].map(|c| sum[c] + weight * f64::from(radiance[c]));
    }
    sum
}

fn bright(rgb: [f64; 3]) -> f64 {
    f64::from(luminance(rgb.map(|v| v as f32)))
}
