//! The decoder written down in f64 as the paper has it, layer by layer, with nothing folded or reduced; and the
//! fast field against it.

use super::*;
use crate::latent::{Latent, Prior};
use crate::model::Model;

/// Plain access to a model's tensors.
pub(super) struct Plain<'a>(pub(super) &'a Model);

impl Plain<'_> {
    fn values(&self, name: &str) -> Vec<f64> {
        self.0.tensor(&format!("decoder.{name}")).unwrap().data.iter().map(|v| f64::from(*v)).collect()
    }

    fn linear(&self, name: &str, x: &[f64]) -> Vec<f64> {
        let (w, b) = (self.values(&format!("{name}.weight")), self.values(&format!("{name}.bias")));
        assert_eq!(w.len(), x.len() * b.len());
        (0..b.len()).map(|o| b[o] + (0..x.len()).map(|i| x[i] * w[i * b.len() + o]).sum::<f64>()).collect()
    }

    fn layer_norm(&self, name: &str, x: &[f64]) -> Vec<f64> {
        let (gamma, beta) = (self.values(&format!("{name}.gamma")), self.values(&format!("{name}.beta")));
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        let variance = x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / x.len() as f64;
        (0..x.len()).map(|i| gamma[i] * (x[i] - mean) / (variance + 1e-5).sqrt() + beta[i]).collect()
    }

    /// VN-linear, VN-ReLU and inner product on vectors of R², no closed form.
    fn invariants(&self, [x, y, z]: [f32; 3]) -> [f64; 3] {
        let scale = self.values("condition.scale")[0];
        let v = [scale * f64::from(x), scale * f64::from(y)];
        let (a, w, u) =
            (self.values("condition.linear"), self.values("condition.w"), self.values("condition.u"));
        let channel = |m: &[f64], e: usize| [0, 1].map(|k| v[k] * (a[0] * m[e] + a[1] * m[2 + e]));
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let [one, two] = [0, 1].map(|e| {
            let (q, k) = (channel(&w, e), channel(&u, e));
            if dot(q, k) >= 0.0 {
                return dot(v, q);
            }
            let divisor = match self.0.config().decoder.vn_relu {
                VnReluForm::Projection => dot(k, k),
                VnReluForm::Reference => dot(k, k).max(1e-6).sqrt(),
                VnReluForm::ReferenceNormGuard => dot(k, k).sqrt().max(1e-6),
            };
            dot(v, [0, 1].map(|i| q[i] - dot(q, k) / divisor * k[i]))
        });
        [one, two, f64::from(z)]
    }

    pub(super) fn log_radiance(&self, latent: &Latent, direction: [f32; 3]) -> [f64; 3] {
        self.log_radiance_with(latent, direction, |v, d, frequency| {
            let p = f64::from(v[0]) * f64::from(d[0]) + f64::from(v[1]) * f64::from(d[1]);
            std::f64::consts::TAU * p * frequency
        })
    }

    /// `angle` gives the radians of an inner product at a frequency, from a vector and a direction.
    fn log_radiance_with(
        &self,
        latent: &Latent,
        direction: [f32; 3],
        angle: impl Fn([f32; 3], [f32; 3], f64) -> f64,
    ) -> [f64; 3] {
        let d = direction.map(f64::from);
        let mut inputs: Vec<f64> =
            latent.vectors.iter().map(|v| f64::from(v[0]) * d[0] + f64::from(v[1]) * d[1]).collect();
        inputs.extend([d[2], d[0].hypot(d[1])]);
        let angles = |(i, p): (usize, &f64)| match latent.vectors.get(i) {
            Some(v) => [1.0, 4.0].map(|f| angle(*v, direction, f)),
            None => [1.0, 4.0].map(|f| std::f64::consts::TAU * p * f),
        };
        let angles: Vec<f64> = inputs.iter().enumerate().flat_map(angles).collect();
        let mut encoded: Vec<f64> = angles.iter().map(|a| a.sin()).collect();
        encoded.extend(angles.iter().map(|a| a.cos()));
        encoded.extend(&inputs);
        let condition: Vec<f64> = latent.vectors.iter().flat_map(|v| self.invariants(*v)).collect();
        let mut x = self.linear("input", &encoded);
        let plus = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + b).collect::<Vec<f64>>();
        for l in 0..self.0.config().decoder.layers {
            let name = |part: &str| format!("layers.{l}.{part}");
            let attention = self.linear(&name("out"), &self.linear(&name("value"), &condition));
            x = self.layer_norm(&name("norm1"), &plus(&attention, &x));
            let inner: Vec<f64> = self.linear(&name("ff1"), &x).iter().map(|v| v.max(0.0)).collect();
            x = self.layer_norm(&name("norm2"), &plus(&self.linear(&name("ff2"), &inner), &x));
        }
        let out = self.linear("output", &x);
        std::array::from_fn(|k| out[k] + f64::from(latent.log_exposure))
    }
}

fn plain(model: &Model, latent: &Latent, directions: &[[f32; 3]]) -> Vec<[f32; 3]> {
    directions.iter().map(|d| Plain(model).log_radiance(latent, *d).map(|v| v as f32)).collect()
}

fn fast(model: &Model, latent: &Latent, directions: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut out = vec![[0.0; 3]; directions.len()];
    model.decoder().unwrap().condition(latent).unwrap().log_radiance_batch(directions, &mut out);
    out
}

fn scaled(n: usize, factor: f32) -> Latent {
    let mut latent = Latent::from_seed(&Prior::standard(n), 3);
    for v in &mut latent.vectors {
        *v = [v[0] * factor, v[1] * factor, v[2]];
    }
    latent.log_exposure = -0.7;
    latent
}

#[test]
fn paper_sizes_agree_with_f64() {
    let directions = directions(40);
    for n in [1, 9, 49, 100] {
        let (model, latent) = (filler(n), scaled(n, 1.0));
        let d = distance(&fast(&model, &latent, &directions), &plain(&model, &latent, &directions));
        assert!(d < 4e-6, "N = {n}: {d:e}");
    }
}

#[test]
fn any_size_and_every_relu_form_agrees_with_f64() {
    let directions = directions(50);
    for (n, hidden) in [(1, 3), (2, 8), (22, 13), (23, 40), (47, 130)] {
        for form in [VnReluForm::Projection, VnReluForm::Reference, VnReluForm::ReferenceNormGuard] {
            for factor in [1.0, 1e-4] {
                let (model, latent) = (odd(n, hidden, form), scaled(n, factor));
                let d = distance(&fast(&model, &latent, &directions), &plain(&model, &latent, &directions));
                assert!(d < 1e-5, "N = {n}, h = {hidden}, {form:?}: {d:e}");
            }
        }
    }
}

/// Inner products of hundreds mean sines of thousands of radians. Reduced exactly they cost no accuracy; in plain
/// f32 arithmetic, which the second half imitates, even with a perfect sine, they do.
#[test]
fn large_latents_keep_their_phase() {
    let directions = directions(200);
    for (factor, times) in [(30.0, 0.0), (300.0, 4.0), (3000.0, 40.0)] {
        // invariants and raw inputs grow with the latent and would drown the phases: scale them down, so that
        // the sines and cosines have the say that they have at usual sizes
        let mut tensors = filler(9).tensors().clone();
        tensors.get_mut("decoder.condition.scale").unwrap().data[0] /= factor;
        let input = &mut tensors.get_mut("decoder.input.weight").unwrap().data;
        input[4 * 11 * 128..].iter_mut().for_each(|w| *w /= factor);
        let model = Model::new(filler(9).config().clone(), tensors, Default::default()).unwrap();
        let latent = scaled(9, factor);
        let truth = plain(&model, &latent, &directions);
        let d = distance(&fast(&model, &latent, &directions), &truth);
        assert!(d < 1e-5, "×{factor}: {d:e}");
        let naive = |d: &[f32; 3]| {
            let angle = |v: [f32; 3], d: [f32; 3], frequency: f64| {
                f64::from(std::f32::consts::TAU * (v[0] * d[0] + v[1] * d[1]) * frequency as f32)
            };
            Plain(&model).log_radiance_with(&latent, *d, angle).map(|v| v as f32)
        };
        let naive = distance(&directions.iter().map(naive).collect::<Vec<_>>(), &truth);
        assert!(naive > times * d, "×{factor}: plain f32 is as good, {naive:e} against {d:e}");
    }
}
