//! How a rendering is compared with a photograph, pixel by pixel. MODEL (56).

use super::Transfer;
use super::transfer::check_image;
use crate::{Error, Result};
use veni_image::tonemap::{REFERENCE_QUANTILE, quantile, srgb, srgb_derivative};
use veni_light::vector::dot;

/// What [`RenderedImage`](super::RenderedImage) minimises: R is the rendering, T the target, both linear radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RenderingLoss {
    /// The mean over visible pixels and channels of Huber's function of x = ln((R + ε)/(T + ε)): x²/2 up to |x| = `delta`,
    /// then straight, so that pixels which the model cannot explain (shadows, interreflections) pull with a bounded
    /// force. ε is `floor` times the mean of T: what is that dark does not count.
    RobustLog {
        /// Where the square ends, in units of natural log.
        delta: f32,
        /// ε over the mean of the target.
        floor: f32,
    },
    /// The reference implementation's figure (MODEL, Rendered images): 100 mean |ln R − ln T| over all pixels, where those that show nothing are
    /// equal.
    ReferenceLog,
    /// RENI++'s demonstration: `mse` mean (g(R) − g(T))² + `cosine` (1 − mean cos(g(R), g(T))) over all pixels, with g(x) the
    /// sRGB curve of x/q, not clamped, and q the 98 % quantile of T, in which pixels that show nothing are 1. The
    /// demonstration weighs them 100 and 1, and adds 0.001 mean z² over the latent's coordinates, which is the
    /// caller's.
    ReferenceDisplay {
        /// Weight of the squared display error.
        mse: f64,
        /// Weight of the angle between colours.
        cosine: f64,
    },
}

impl Default for RenderingLoss {
    /// Robust: quadratic up to a deviation of 10 %.
    fn default() -> Self {
        Self::RobustLog { delta: 0.1, floor: 1e-3 }
    }
}

impl RenderingLoss {
    /// RENI++'s demonstration with its own weights.
    #[doc(hidden)]
    pub fn demo() -> Self {
        Self::ReferenceDisplay { mse: 100.0, cosine: 1.0 }
    }
}

/// A loss for one target, ready to be asked pixel by pixel.
#[derive(Clone, Debug)]
pub(super) struct Comparison {
    loss: RenderingLoss,
    /// What the loss needs of each pixel: T + ε, ln T or T. NaN where the pixel does not count.
    target: Vec<[f32; 3]>,
    /// Per pixel and channel.
    share: f64,
    /// ε, or q.
    constant: f32,
}

impl Comparison {
    /// A target [H·W, 3] of linear radiance; pixels that are not finite do not count.
    pub(super) fn new(loss: RenderingLoss, transfer: &Transfer, target: &[[f32; 3]]) -> Result<Self> {
        check_image(transfer, "the target", target.len())?;
        let known = |p: &[f32; 3]| p.iter().all(|v| v.is_finite());
        let seen: Vec<usize> = transfer.visible().filter(|at| known(&target[*at])).collect();
        if seen.is_empty() {
            return Err(Error::invalid("no visible pixel of the target is finite: there is nothing to fit"));
        }
        let mut prepared = vec![[f32::NAN; 3]; target.len()];
        let everything = target.len() as f64;
        let (share, constant) = match loss {
            RenderingLoss::RobustLog { delta, floor } => {
                for (name, value) in [("delta", delta), ("floor", floor)] {
                    if !(value.is_finite() && value > 0.0) {
                        return Err(Error::invalid(format!(
                            "{name} {value} of the loss: it must be positive"
                        )));
                    }
                }
                let total: f64 = seen.iter().flat_map(|at| target[*at]).map(|v| f64::from(v.max(0.0))).sum();
                let epsilon = (f64::from(floor) * total / (3.0 * seen.len() as f64)) as f32;
                if !epsilon.is_normal() {
                    return Err(Error::invalid("the target is black wherever the surface is visible"));
                }
                seen.iter().for_each(|at| prepared[*at] = target[*at].map(|v| v.max(0.0) + epsilon));
                (1.0 / (3.0 * seen.len() as f64), epsilon)
            }
            RenderingLoss::ReferenceLog => {
                if let Some(at) = seen.iter().find(|at| target[**at].iter().any(|v| *v <= 0.0)) {
                    let width = transfer.size()[0];
                    return Err(Error::invalid(format!(
                        "pixel ({}, {}) of the target is {:?}: this loss takes its logarithm; mask it out",
                        at % width,
                        at / width,
                        target[*at]
                    )));
                }
                seen.iter().for_each(|at| prepared[*at] = target[*at].map(f32::ln));
                (100.0 / (3.0 * everything), 0.0)
            }
            RenderingLoss::ReferenceDisplay { .. } => {
                let mut whole = vec![[1.0; 3]; target.len()];
                seen.iter().for_each(|at| whole[*at] = target[*at]);
                let white = quantile(whole.as_flattened(), REFERENCE_QUANTILE);
                if !(white.is_normal() && white > 0.0) {
                    return Err(Error::invalid(format!(
                        "the target's 98 % quantile is {white}: it is black"
                    )));
                }
                seen.iter().for_each(|at| prepared[*at] = target[*at]);
                (1.0 / everything, white)
            }
        };
        Ok(Self { loss, target: prepared, share, constant })
    }

    /// A pixel's part of the loss, and the gradient with respect to its value.
    pub(super) fn pixel(&self, at: usize, value: [f32; 3]) -> (f64, [f32; 3]) {
        let target = self.target[at];
        if target[0].is_nan() {
            return (0.0, [0.0; 3]);
        }
        let (share, constant) = (self.share, f64::from(self.constant));
        let [r, t] = [value, target].map(|v| v.map(f64::from));
        let mut total = 0.0;
        let gradient = match self.loss {
            RenderingLoss::RobustLog { delta, .. } => [0, 1, 2].map(|c| {
                let (shifted, delta) = (r[c].max(0.0) + constant, f64::from(delta));
                let x = (shifted / t[c]).ln();
                total += share * if x.abs() <= delta { 0.5 * x * x } else { delta * (x.abs() - 0.5 * delta) };
                share * x.clamp(-delta, delta) / shifted
            }),
            RenderingLoss::ReferenceLog => [0, 1, 2].map(|c| {
                let x = r[c].ln() - t[c];
                total += share * x.abs();
                // the subgradient of |x| at 0 is 0
                if x == 0.0 { 0.0 } else { share * x.signum() / r[c] }
            }),
            RenderingLoss::ReferenceDisplay { mse, cosine } => {
                let (parts, gradient) = display(r, t, constant);
                total += share * (mse * parts[0] + cosine * parts[1]);
                [0, 1, 2].map(|c| share * (mse * gradient[0][c] + cosine * gradient[1][c]))
            }
        };
        (total, gradient.map(|v| v as f32))
    }

    /// Mean (g(R) − g(T))² and 1 − mean cos(g(R), g(T)) of [`RenderingLoss::ReferenceDisplay`].
    pub(super) fn display_terms(&self, image: &[[f32; 3]]) -> Option<[f64; 2]> {
        matches!(self.loss, RenderingLoss::ReferenceDisplay { .. }).then(|| {
            let pairs = image.iter().zip(&self.target).filter(|(_, t)| !t[0].is_nan());
            pairs.fold([0.0; 2], |sum, (r, t)| {
                let (parts, _) = display(r.map(f64::from), t.map(f64::from), f64::from(self.constant));
                [sum[0] + self.share * parts[0], sum[1] + self.share * parts[1]]
            })
        })
    }
}

/// The two parts of the display loss of one pixel, and their gradients.
fn display(r: [f64; 3], t: [f64; 3], white: f64) -> ([f64; 2], [[f64; 3]; 2]) {
    let shown = |v: [f64; 3]| v.map(|v| f64::from(srgb((v / white) as f32)));
    let (a, b) = (shown(r), shown(t));
    let derivative = r.map(|v| srgb_derivative(v / white) / white);
    let difference = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let square = dot(difference, difference) / 3.0;
    let squares = [0, 1, 2].map(|c| 2.0 / 3.0 * difference[c] * derivative[c]);
    let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
    let norms = (aa * bb).sqrt();
    // PyTorch's cosine similarity: the product of norms is at least 1e-8
    let (cosine, angle) = if norms > 1e-8 {
        let cosine = ab / norms;
        (cosine, [0, 1, 2].map(|c| (cosine * a[c] / aa - b[c] / norms) * derivative[c]))
    } else {
        (ab / 1e-8, [0, 1, 2].map(|c| -b[c] / 1e-8 * derivative[c]))
    };
    ([square, 1.0 - cosine], [squares, angle])
}
