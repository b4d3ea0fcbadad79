//! The Vector-Neuron ReLU on products of weights.

use pulp::{Simd, WithSimd};
use veni_light::model::VnReluForm;

use super::matrix::{Matrix, PANEL, padded};

/// A W and A U side by side, a panel of each in turn, so that q = x A W and k = x A U of the same channels come out
/// of one product next to each other.
#[derive(Clone, Debug)]
pub(super) struct Gate {
    pub(super) weights: Matrix,
    form: VnReluForm,
}

impl Gate {
    /// `expand` is A, `[inputs, hidden]`; `w` and `u` are `[hidden, hidden]`, all row-major.
    pub(super) fn fold(expand: &[f32], w: &[f32], u: &[f32], hidden: usize, form: VnReluForm) -> Self {
        let inputs = expand.len() / hidden;
        let mut weights = Matrix::default();
        weights.reset(inputs, 2 * padded(hidden));
        let [w, u] = [w, u].map(|factor| super::fold::product(expand, factor, inputs, hidden));
        for k in 0..inputs {
            for (place, product) in [&w, &u].into_iter().enumerate() {
                let row = product[k * hidden..][..hidden].chunks(PANEL);
                row.enumerate().for_each(|(p, row)| weights.put(k, (2 * p + place) * PANEL, row));
            }
        }
        Self { weights, form }
    }

    /// The ReLU of `products`, `[token, coordinate, panel, (q, k), PANEL]`, into as many panels of `out` from
    /// channel `at` on; `out` is `[token, stride]`, coordinates `width` apart.
    pub(super) fn apply(&self, products: &[f32], coordinates: usize, out: &mut [f32], place: Place) {
        super::simd::dispatch(Relu { products, coordinates, out, place, form: self.form });
    }
}

/// Where the ReLU's results go.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Distance of tokens.
    pub(super) stride: usize,
    /// Distance of coordinates.
    pub(super) width: usize,
    /// First channel.
    pub(super) at: usize,
    /// Channels, whole panels.
    pub(super) count: usize,
}

/// q − min(⟨q, k⟩, 0)/g · k, where g is |k|² ([`VnReluForm::Projection`]), √max(|k|², 1e-6)
/// ([`VnReluForm::Reference`]) or max(|k|, 1e-6) ([`VnReluForm::ReferenceNormGuard`]).
struct Relu<'a> {
    products: &'a [f32],
    coordinates: usize,
    out: &'a mut [f32],
    place: Place,
    form: VnReluForm,
}

impl WithSimd for Relu<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { products, coordinates, out, place, form } = self;
        let Place { stride, width, at, count } = place;
        let (least, root) = match form {
            // Only guards 0/0: it acts where |k| < 1e-15.
            VnReluForm::Projection => (1e-30, false),
            VnReluForm::Reference => (1e-6, true),
            VnReluForm::ReferenceNormGuard => (1e-12, true),
        };
        let least = simd.splat_f32s(least);
        let zero = simd.splat_f32s(0.0);
        let tokens = products.chunks_exact(coordinates * 2 * count).zip(out.chunks_exact_mut(stride));
        for (products, out) in tokens {
            for panel in 0..count / PANEL {
                for v in 0..PANEL / S::F32_LANES {
                    let pair = |c: usize| {
                        let pair = &products[2 * (c * count + panel * PANEL)..][..2 * PANEL];
                        let vectors = S::as_simd_f32s(pair).0;
                        (vectors[v], vectors[PANEL / S::F32_LANES + v])
                    };
                    let (mut along, mut square) = (zero, zero);
                    for c in 0..coordinates {
                        let (q, k) = pair(c);
                        along = simd.mul_add_e_f32s(q, k, along);
                        square = simd.mul_add_e_f32s(k, k, square);
                    }
                    let mut divisor = simd.max_f32s(square, least);
                    if root {
                        divisor = simd.sqrt_f32s(divisor);
                    }
                    let factor = simd.div_f32s(simd.max_f32s(simd.neg_f32s(along), zero), divisor);
                    for c in 0..coordinates {
                        let (q, k) = pair(c);
                        let out = &mut out[c * width + at + panel * PANEL..][..PANEL];
                        S::as_mut_simd_f32s(out).0[v] = simd.mul_add_e_f32s(k, factor, q);
                    }
                }
            }
        }
    }
}
