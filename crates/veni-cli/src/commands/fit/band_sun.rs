//! The sun of a light of which only harmonics are known.

use veni_fit::{Achieved, Best};
use veni_light::light::sh::Basis;
use veni_light::light::{CompactLight, LUMINANCE, Lights};
use veni_light::vector::unit;

/// Shares of the strongest sun that are tried: the rest of the first band is the sky's.
pub(super) const SHARES: [f64; 3] = [0.5, 0.75, 0.9];

/// Where the first band of a light points, and the irradiance of a sun there that would be all of the band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BandSun {
    direction: [f64; 3],
    most: [f64; 3],
}

impl BandSun {
    /// Of nine harmonics or more; None where they point below the horizon.
    pub(super) fn new(wanted: &[[f64; 3]]) -> Option<Self> {
        if wanted.len() < 9 {
            return None;
        }
        // a sun of irradiance E at u has the first band 3/(4π) E ⟨u, d⟩
        let mut row = [0.0; 4];
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| {
            Basis::new(1).evaluate(axis, &mut row);
            let band = (1..4).fold([0.0; 3], |sum, k| [0, 1, 2].map(|c| sum[c] + wanted[k][c] * row[k]));
            band.map(|v| v * 4.0 * std::f64::consts::PI / 3.0)
        });
        let bright = axes.map(|rgb| rgb.iter().zip(LUMINANCE).map(|(v, w)| v * f64::from(w)).sum::<f64>());
        let direction = unit(bright);
        let most = [0, 1, 2].map(|c| (0..3).map(|k| axes[k][c] * direction[k]).sum::<f64>().max(0.0));
        (direction[2] > 0.0 && most.iter().sum::<f64>() > 0.0).then_some(Self { direction, most })
    }

    /// Harmonics of a share of the sun, as many as are asked for.
    pub(super) fn harmonics(&self, share: f64, count: usize) -> Vec<[f64; 3]> {
        let mut row = vec![0.0; count];
        Basis::new(count.isqrt() - 1).evaluate(self.direction, &mut row);
        row.into_iter().map(|y| self.most.map(|e| share * e * y)).collect()
    }
}

/// Harmonics parted into those of a sun and the rest.
pub(super) struct SunAndRest {
    sun: BandSun,
    share: f64,
    own: Vec<[f64; 3]>,
    /// What is left without the sun.
    pub(super) rest: Vec<[f64; 3]>,
    /// √(Σ rest²/Σ all²): what an error of the rest is as one of all.
    pub(super) part: f64,
}

impl SunAndRest {
    /// With a share of the strongest sun.
    pub(super) fn new(sun: BandSun, share: f64, harmonics: &[[f64; 3]]) -> Self {
        let own = sun.harmonics(share, harmonics.len());
        let rest = harmonics.iter().zip(&own).map(|(all, sun)| [0, 1, 2].map(|c| all[c] - sun[c]));
        let rest: Vec<[f64; 3]> = rest.collect();
        let part = norm(&rest) / norm(harmonics);
        Self { sun, share, own, rest, part }
    }

    /// The sun into every latent that was fitted to the rest, at its exposure, and into what they have.
    pub(super) fn put_into(&self, best: &mut Best, achieved: &mut Achieved) {
        for latent in best.all.iter_mut().chain([&mut best.latent]) {
            let factor = self.share * f64::from(-latent.log_exposure).exp();
            let irradiance = self.sun.most.map(|e| (e * factor) as f32);
            let direction = self.sun.direction.map(|v| v as f32);
            let sun = CompactLight::new(direction, irradiance, CompactLight::SUN_RADIUS);
            latent.lights = Lights::new(Some(sun), []);
        }
        for (sum, sun) in achieved.harmonics.iter_mut().zip(&self.own) {
            *sum = [0, 1, 2].map(|c| sum[c] + sun[c]);
        }
        achieved.harmonics_error = achieved.harmonics_error.map(|error| error * self.part);
    }
}

fn norm(values: &[[f64; 3]]) -> f64 {
    values.as_flattened().iter().map(|v| v * v).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use veni_light::light::Sh;

    use super::*;

    #[test]
    fn a_sun_alone_is_found_with_all_of_its_light() {
        let sun = CompactLight::new([0.48, -0.64, 0.6], [3.0, 2.0, 1.0], 0.0);
        let harmonics = Sh::<2>::of_light(&sun);
        let found = BandSun::new(harmonics.coefficients()).unwrap();
        let near = |a: &[f64], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - f64::from(*b)).abs() < 1e-6);
        assert!(near(&found.direction, &sun.direction) && near(&found.most, &sun.irradiance), "{found:?}");
        let again = found.harmonics(1.0, 9);
        let pairs = again.as_flattened().iter().zip(harmonics.coefficients().as_flattened());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-6));
        let below = CompactLight { direction: [0.6, 0.0, -0.8], ..sun };
        assert_eq!(BandSun::new(Sh::<2>::of_light(&below).coefficients()), None);
    }
}
