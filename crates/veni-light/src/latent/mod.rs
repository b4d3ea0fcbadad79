//! The latent code: N vectors in R³ that rotate with the scene, its compact lights, and an exposure. MODEL (2), MODEL (71).
//!
//! Rotating a panorama by α about z rotates every vector, light and lobe by α about z; the x and y of a vector form its
//! equivariant part, z its invariant part. The paper's code is the vectors alone, of dimension D = 3N; a light and a
//! lobe take seven numbers each.

mod density;
mod draw;
mod file;
mod lobe;
mod prior;
#[cfg(feature = "gradients")]
mod step;
mod sun;

#[cfg(feature = "gradients")]
pub(crate) use draw::Draw;
pub(crate) use draw::MEASURES;
pub use file::MAX_LATENT_BYTES;
pub use lobe::Lobe;
pub use prior::Prior;
#[cfg(feature = "gradients")]
pub(crate) use step::Row;
pub use sun::SunPrior;
#[cfg(feature = "gradients")]
pub use sun::SunRequest;
#[cfg(feature = "gradients")]
pub(crate) use sun::{irradiance, sine};

use crate::compact::Lights;
use crate::random::Stream;
use crate::{Error, Result};

/// A code for one panorama, in the native frame (z up):
/// L(d) = e^s (exp(f(d; Z) + Σ lobes) + Σ lights), with the log exposure s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Latent {
    /// The N vectors [x, y, z].
    pub vectors: Vec<[f32; 3]>,
    /// The sun and other compact lights, which the vectors say nothing about. Their irradiance is that of the decoder's output:
    /// before the exposure.
    pub lights: Lights,
    /// Spherical Gaussians of log radiance, added to the network's output.
    pub lobes: Vec<Lobe>,
    /// Natural log of the factor between the decoder's output and radiance; added to log radiance. 0 leaves it.
    pub log_exposure: f32,
    /// Identity of the decoder it was made for ([`Model::hash`](crate::model::Model::hash)), if known.
    pub model: Option<String>,
    /// What it was made from, in words, if known.
    pub source: Option<String>,
}

impl Latent {
    /// A code at exposure 0, of unknown origin.
    pub fn new(vectors: Vec<[f32; 3]>) -> Self {
        Self { vectors, ..Self::default() }
    }

    /// D = 3N + 7M + 7K: coordinates of the N vectors, the M lights and the K lobes.
    pub fn dimension(&self) -> usize {
        3 * self.vectors.len() + 7 * (self.lights.len() + self.lobes.len())
    }

    /// A random code: vectors, exposure and, where the prior knows of suns, a sun drawn from `prior`. The same generator state gives the same bits
    /// on every machine.
    pub fn sample(prior: &Prior, rng: &mut Stream) -> Self {
        prior.sample(rng)
    }

    /// A random code named by a number: [`Latent::sample`] from the [`Stream`] of that seed.
    pub fn from_seed(prior: &Prior, seed: u64) -> Self {
        let source = Some(format!("seed {seed}"));
        Self { source, ..prior.sample(&mut Stream::from_seed(seed)) }
    }

    /// The code of the same scene rotated by `radians` about z, counter-clockwise seen from above.
    #[must_use]
    pub fn rotated(&self, radians: f64) -> Self {
        let (sin, cos) = radians.sin_cos();
        let rotate = |[x, y, z]: [f32; 3]| {
            let (x, y) = (f64::from(x), f64::from(y));
            [(x * cos - y * sin) as f32, (x * sin + y * cos) as f32, z]
        };
        Self {
            vectors: self.vectors.iter().copied().map(rotate).collect(),
            lights: self.lights.rotated(radians),
            lobes: self.lobes.iter().map(|lobe| lobe.rotated(radians)).collect(),
            ..self.clone()
        }
    }

    /// The code of the mirrored scene: azimuth φ becomes −φ, the columns of a panorama reversed.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self {
            vectors: self.vectors.iter().map(|[x, y, z]| [*x, -y, *z]).collect(),
            lights: self.lights.mirrored(),
            lobes: self.lobes.iter().map(|lobe| lobe.mirrored()).collect(),
            ..self.clone()
        }
    }

    /// (1 − t)·self + t·other, vector by vector, exposure too: the paper's interpolation. Lights move along the sphere and fade
    /// where only one of the two has them ([`Lights::between`]); the lobes of one fade as those of the other come.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the codes have different N or belong to different models.
    pub fn lerp(&self, other: &Self, t: f32) -> Result<Self> {
        self.blend(other, t, 1.0 - t, t)
    }

    /// Interpolation along the great circle of the 3N-dimensional codes: unlike [`Latent::lerp`] it passes
    /// through codes of typical length, which keeps contrast midway. Nearly parallel or zero codes are
    /// interpolated linearly. The exposure is interpolated linearly.
    ///
    /// # Errors
    /// As [`Latent::lerp`].
    pub fn slerp(&self, other: &Self, t: f32) -> Result<Self> {
        let dot = |a: &Self, b: &Self| -> f64 {
            let pairs = a.vectors.as_flattened().iter().zip(b.vectors.as_flattened());
            pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let cosine = dot(self, other) / (dot(self, self) * dot(other, other)).sqrt();
        let angle = cosine.clamp(-1.0, 1.0).acos();
        let t64 = f64::from(t);
        // opposite codes have no unique great circle, parallel ones none at all (NaN: a zero code)
        if !(1e-6..=std::f64::consts::PI - 1e-6).contains(&angle) {
            return self.lerp(other, t);
        }
        let (a, b) = (((1.0 - t64) * angle).sin() / angle.sin(), (t64 * angle).sin() / angle.sin());
        self.blend(other, t, a as f32, b as f32)
    }

    fn blend(&self, other: &Self, t: f32, a: f32, b: f32) -> Result<Self> {
        let (n, m) = (self.vectors.len(), other.vectors.len());
        if n != m {
            return Err(Error::invalid(format!("cannot interpolate codes of {n} and {m} vectors")));
        }
        if let (Some(one), Some(two)) = (&self.model, &other.model)
            && one != two
        {
            return Err(Error::invalid(format!(
                "cannot interpolate codes of different models ({one} and {two})"
            )));
        }
        let pairs = self.vectors.iter().zip(&other.vectors);
        Ok(Self {
            vectors: pairs.map(|(p, q)| std::array::from_fn(|k| a * p[k] + b * q[k])).collect(),
            lights: self.lights.between(&other.lights, t),
            lobes: fading(&self.lobes, 1.0 - t).chain(fading(&other.lobes, t)).collect(),
            log_exposure: (1.0 - t) * self.log_exposure + t * other.log_exposure,
            model: self.model.clone().or_else(|| other.model.clone()),
            source: None,
        })
    }

    /// Refuses a NaN or an infinity, and lights and lobes that are none.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first vector, light, lobe or exposure that is not finite; [`Error::TooLarge`] for more lights or
    /// lobes than [`limits`](crate::limits) allow.
    pub fn check_finite(&self) -> Result<()> {
        if let Some(i) = self.vectors.iter().position(|v| v.iter().any(|c| !c.is_finite())) {
            return Err(Error::invalid(format!("latent vector {i} is {:?}, not finite", self.vectors[i])));
        }
        if !self.log_exposure.is_finite() {
            return Err(Error::invalid(format!(
                "the latent's exposure is {}, not finite",
                self.log_exposure
            )));
        }
        self.lights.check()?;
        Lobe::check(&self.lobes)
    }
}

/// Lobes `factor` times as high; none of height 0.
fn fading(lobes: &[Lobe], factor: f32) -> impl Iterator<Item = Lobe> {
    lobes.iter().filter(move |_| factor != 0.0).map(move |lobe| lobe.scaled(factor))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The coordinates of `Prior::standard(9)`'s codes of seeds 1, 2 and 3.
    const PINNED: [[[f32; 3]; 9]; 3] = [
        [
            [-0.17473207, -0.7518938, -0.031933554],
            [0.4698427, -1.365711, -0.15126169],
            [-1.0178055, 0.99098897, 0.19108936],
            [-0.13323231, -1.1893013, -1.7358459],
            [0.690806, 0.38085473, -0.9269812],
            [-0.5757365, 2.6549923, 0.18852231],
            [-0.46457803, -0.27382678, 1.0400348],
            [-0.37062138, -1.7501386, 0.922409],
            [-2.132417, -0.26871115, -0.91620755],
        ],
        [
            [1.017332, 0.129203, 1.9479527],
            [0.36459488, 0.4504213, -1.198671],
            [-1.0941412, 0.6920759, 0.15888096],
            [-0.6193441, -0.5119221, -0.6307983],
            [-0.61100006, 0.97704434, -0.24163933],
            [0.40241626, 0.6903589, -1.3562727],
            [0.44439584, 0.836982, 0.761324],
            [-0.27091485, 0.043291073, -1.181914],
            [0.52906406, -0.89976656, 0.7929145],
        ],
        [
            [0.20790577, -0.70790917, -0.60803443],
            [-0.24744377, -0.5814308, 2.32588],
            [0.38966978, 1.2572368, -0.8775781],
            [-0.6541297, -0.6216347, 1.0403427],
            [-0.83770806, -0.98712564, 0.44946232],
            [-0.52217364, 1.5595835, 1.5022086],
            [0.6974095, -0.6037927, -1.7374446],
            [-1.3276627, 0.6143118, 0.48546195],
            [1.3853998, 1.7751528, -1.7005589],
        ],
    ];

    fn random(n: usize, seed: u64) -> Latent {
        Latent::from_seed(&Prior::standard(n), seed)
    }

    #[test]
    fn rotations_add_up_and_mirroring_reverses_them() {
        let latent = random(9, 1);
        let close = |a: &Latent, b: &Latent| {
            let pairs = a.vectors.as_flattened().iter().zip(b.vectors.as_flattened());
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) < 1e-6
        };
        assert!(close(&latent.rotated(0.3).rotated(0.5), &latent.rotated(0.8)));
        assert!(close(&latent.rotated(0.7).mirrored(), &latent.mirrored().rotated(-0.7)));
        assert!(!close(&latent.rotated(0.7).mirrored(), &latent.mirrored().rotated(0.7)));
        assert_eq!(latent.mirrored().mirrored(), latent);
    }

    #[test]
    fn interpolation_hits_its_ends_and_refuses_strangers() {
        let (mut a, mut b) = (random(9, 1), random(9, 2));
        (a.log_exposure, b.log_exposure) = (1.0, 3.0);
        assert_eq!(a.lerp(&b, 0.0).unwrap().vectors, a.vectors);
        assert_eq!(a.lerp(&b, 1.0).unwrap().vectors, b.vectors);
        assert_eq!(a.lerp(&b, 0.5).unwrap().log_exposure, 2.0);
        let length = |l: &Latent| l.vectors.as_flattened().iter().map(|v| v * v).sum::<f32>().sqrt();
        let (lerp, slerp) = (a.lerp(&b, 0.5).unwrap(), a.slerp(&b, 0.5).unwrap());
        assert!(length(&slerp) > 1.1 * length(&lerp));
        assert_eq!(
            Latent::new(vec![[0.0; 3]; 9]).slerp(&a, 0.5).unwrap().vectors[0][0],
            0.5 * a.vectors[0][0]
        );
        assert!(a.lerp(&random(8, 1), 0.5).is_err());
        (a.model, b.model) = (Some("one".into()), Some("two".into()));
        assert!(a.lerp(&b, 0.5).unwrap_err().to_string().contains("different models"));
    }

    #[test]
    fn non_finite_codes_are_found() {
        let mut latent = random(9, 1);
        latent.check_finite().unwrap();
        latent.vectors[4][2] = f32::NAN;
        assert!(latent.check_finite().unwrap_err().to_string().contains("vector 4"));
        latent.vectors[4][2] = 0.0;
        latent.log_exposure = f32::INFINITY;
        assert!(latent.check_finite().is_err());
    }

    /// A seed names a sky: files and pictures quote it.
    #[test]
    fn a_seed_gives_the_same_bits_for_ever() {
        for (seed, expected) in (1..).zip(PINNED) {
            let latent = random(9, seed);
            assert_eq!(latent.vectors, expected, "seed {seed}");
            assert_eq!(latent.log_exposure, 0.0);
        }
    }
}
