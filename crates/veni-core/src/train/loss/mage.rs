//! MAGE: the multi-scale mean absolute gradient error of log radiance. MODEL (29).

use super::LossForm;
use super::rows;
use super::stencil::{
    Coarsen, Edge, Filter, LAPLACE, REFERENCE_VERTICAL, SCHARR_HORIZONTAL, SCHARR_VERTICAL, Stencil,
    StencilGrid,
};
use burn::tensor::{Device, Tensor};

/// The corrected loss for one image size, with its matrices ready.
///
/// At scale s the log error R = P − I is averaged over 2ˢ × 2ˢ pixels, then, with Scharr's derivatives,
///
/// ```text
/// MAGE_s = average over the sphere of ½(|∂_φ R| + |∂_θ R|),    MAGE = mean over s
/// ```
///
/// Columns wrap around; the rows at the poles, where the stencil does not fit, are left out. Weights are
/// those of the pixel centres and lie outside the absolute value, so that only errors of the gradient
/// count: a constant factor on the radiance costs nothing.
#[derive(Clone, Debug)]
pub struct Mage {
    scales: Vec<Scale>,
}

#[derive(Clone, Debug)]
struct Scale {
    filters: [Filter; 2],
    /// Row weights of mean 1 over the rows that remain, [1, H', 1].
    weights: Tensor<3>,
}

impl Mage {
    /// For RGB images of `height` × `width`.
    ///
    /// # Panics
    /// If `scales` is 0, or the image is smaller than three pixels at the coarsest of them.
    pub fn new(scales: usize, height: usize, width: usize, device: &Device) -> Self {
        assert!(scales > 0, "MAGE needs at least one scale");
        let scale = |s: usize| {
            let factor = 1 << s;
            let coarsen = Coarsen::Average;
            let horizontal_edge = Edge::Periodic;
            let grid = StencilGrid { size: [height, width], channels: 3, factor, coarsen, horizontal_edge };
            let filters = [SCHARR_HORIZONTAL, SCHARR_VERTICAL].map(|k| Filter::new(k, grid, device));
            let coarse = coarsen.count(height, factor);
            let inner =
                rows::solid_angle(coarse, device).narrow(1, 1, coarse - 2).reshape([1, coarse - 2, 1]);
            Scale { filters, weights: inner.clone() / inner.mean().unsqueeze() }
        };
        Self { scales: (0..scales).map(scale).collect() }
    }

    /// `[B, H, W, 3]` → `[1]`.
    pub fn loss(&self, prediction: Tensor<4>, target: Tensor<4>) -> Tensor<1> {
        let [batch, height, width, channels] = prediction.dims();
        let error = (prediction - target).reshape([batch, height, width * channels]);
        let mut sum: Option<Tensor<1>> = None;
        for scale in &self.scales {
            for filter in &scale.filters {
                let term = (filter.apply(error.clone()).abs() * scale.weights.clone()).mean();
                sum = Some(sum.map_or(term.clone(), |s| s + term));
            }
        }
        let terms = self.scales.len() * 2;
        sum.expect("at least one scale") / terms as f64
    }
}

/// Which derivative the reference's module compares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    /// A pair of first derivatives, of which the reference's second one is [`REFERENCE_VERTICAL`].
    Scharr,
    /// One second derivative.
    Laplace,
}

impl Operator {
    fn stencils(self) -> &'static [Stencil] {
        match self {
            Self::Scharr => &[SCHARR_HORIZONTAL, REFERENCE_VERTICAL],
            Self::Laplace => &[LAPLACE],
        }
    }
}

/// The reference implementation's module on single-channel planes `[M, rows, columns]` → `[1]`: mean absolute
/// difference of the filtered planes, averaged over the operator's stencils and the scales; each scale takes every second
/// row and column of the one before, nothing wraps. With `normalise` both inputs are first made free of
/// shift and scale, (x − median)/mean|x − median| over everything.
#[doc(hidden)]
pub fn reference_planes(
    prediction: Tensor<3>,
    target: Tensor<3>,
    operator: Operator,
    scales: usize,
    normalise: bool,
) -> Tensor<1> {
    let [_, height, width] = prediction.dims();
    let device = prediction.device();
    let (p, i) = if normalise {
        (shift_and_scale_free(prediction), shift_and_scale_free(target))
    } else {
        (prediction, target)
    };
    let error = p - i;
    let stencils = operator.stencils();
    let mut terms = Vec::new();
    for s in 0..scales {
        let grid = StencilGrid {
            size: [height, width],
            channels: 1,
            factor: 1 << s,
            coarsen: Coarsen::Stride,
            horizontal_edge: Edge::Valid,
        };
        for stencil in stencils {
            terms.push(Filter::new(stencil, grid, &device).apply(error.clone()).abs().mean());
        }
    }
    let count = terms.len();
    assert!(count > 0, "MAGE needs at least one scale");
    Tensor::cat(terms, 0).sum() / count as f64
}

/// The reference implementation's loss on images: their mask multiplied into both before filtering (so that its
/// gradient enters), rows and columns exchanged (so that their second stencil acts along the horizon). `[B, H, W, 3]` →
/// `[1]`.
pub fn reference(prediction: Tensor<4>, target: Tensor<4>, scales: usize) -> Tensor<1> {
    let [batch, height, width, channels] = prediction.dims();
    let mask = rows::reference(height, &prediction.device());
    let planes =
        |x: Tensor<4>| (x * mask.clone()).permute([0, 3, 2, 1]).reshape([batch * channels, width, height]);
    reference_planes(planes(prediction), planes(target), Operator::Scharr, scales, false)
}

/// (x − median)/mean|x − median|; of an even number of values the lower median, differentiable as the
/// element that it is.
fn shift_and_scale_free(x: Tensor<3>) -> Tensor<3> {
    let shape = x.dims();
    let count: usize = shape.iter().product();
    let flat = x.reshape([count]);
    let order = flat.clone().detach().argsort(0);
    let median = flat.clone().select(0, order.narrow(0, (count - 1) / 2, 1));
    let centred = flat - median;
    (centred.clone() / centred.abs().mean()).reshape(shape)
}

/// [`Mage`] in either form.
#[derive(Clone, Debug)]
pub(super) enum MageForm {
    Corrected(Mage),
    Reference { scales: usize },
}

impl MageForm {
    pub(super) fn new(form: LossForm, scales: usize, height: usize, width: usize, device: &Device) -> Self {
        match form {
            LossForm::Corrected => Self::Corrected(Mage::new(scales, height, width, device)),
            LossForm::Reference => Self::Reference { scales },
        }
    }

    pub(super) fn loss(&self, prediction: Tensor<4>, target: Tensor<4>) -> Tensor<1> {
        match self {
            Self::Corrected(mage) => mage.loss(prediction, target),
            Self::Reference { scales } => reference(prediction, target, *scales),
        }
    }
}
