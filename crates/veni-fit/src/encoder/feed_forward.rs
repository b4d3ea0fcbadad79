//! The feed-forward block: expand, ReLU, contract.
//!
//! The ReLU multiplies the expansion x A by W and by U with nothing in between, so the products A W and A U are
//! computed when the model is read and A itself is not needed.

use veni_light::model::{VectorLayer, VnReluForm};

use super::gate::{Gate, Place};
use super::linear::{Feature, Linear, Prepared, So2};
use super::matrix::{PANEL, Product};
use super::weights::{Shape, Tensors};
use super::workspace::grown;

/// Panels of q and k at a time, so that both stay in the second-level cache.
const PANELS: usize = 4;

/// contract(ReLU(expand(X))).
#[derive(Clone, Debug)]
pub(super) struct FeedForward {
    gate: Gate,
    /// SO(2): what the plain ReLU of the invariant coordinates is taken of.
    invariant: Option<So2>,
    contract: Linear,
    /// Inner channels.
    hidden: usize,
}

/// Workspace for a block of tokens.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    prepared: Prepared,
    products: Vec<f32>,
    hidden: Vec<f32>,
}

impl FeedForward {
    pub(super) fn new(
        tensors: Tensors<'_>,
        name: &str,
        [expand, contract]: [Shape; 2],
        form: VnReluForm,
    ) -> Self {
        let part = |part: &str| format!("{name}.{part}");
        let hidden = expand.outputs;
        let (first, invariant) = match expand.layer {
            VectorLayer::Vn => (tensors.get(&part("expand.weight")), None),
            VectorLayer::So2 => {
                let Linear::So2(so2) = Linear::new(tensors, &[part("expand")], expand, 1.0) else {
                    unreachable!("the layer is SO(2)")
                };
                (tensors.get(&part("expand.equivariant")), Some(so2))
            }
        };
        let (w, u) = (tensors.get(&part("relu.w")), tensors.get(&part("relu.u")));
        Self {
            gate: Gate::fold(first, w, u, hidden, form),
            invariant,
            contract: Linear::new(tensors, &[part("contract")], contract, 1.0),
            hidden,
        }
    }

    /// Applies the block to a feature; `y` is of its size.
    pub(super) fn apply(&self, x: Feature<'_>, y: &mut [f32], workspace: &mut Workspace) {
        let (tokens, coordinates) = (x.tokens(), x.coordinates);
        let layer = self.contract.layer();
        workspace.prepared.prepare(layer, x);
        let width = self.gate.weights.outputs() / 2;
        let stride = coordinates * width;
        let hidden = grown(&mut workspace.hidden, tokens * stride);
        let gated = if layer == VectorLayer::So2 { 2 } else { coordinates };
        let all = width / PANEL;
        for from in (0..all).step_by(PANELS) {
            let count = PANELS.min(all - from);
            let row = 2 * count * PANEL;
            let products = grown(&mut workspace.products, tokens * gated * row);
            let weight = &self.gate.weights;
            let panels = || 2 * from..2 * (from + count);
            match layer {
                VectorLayer::Vn => {
                    let x = &workspace.prepared.first;
                    Product { x, weight, panels: panels(), y: products, stride: row, add: false }.run();
                }
                VectorLayer::So2 => {
                    let axes = [&workspace.prepared.first, &workspace.prepared.second];
                    for (axis, x) in axes.into_iter().enumerate() {
                        let y = &mut products[axis * row..];
                        Product { x, weight, panels: panels(), y, stride: 2 * row, add: false }.run();
                    }
                }
            }
            let place = Place { stride, width, at: from * PANEL, count: count * PANEL };
            self.gate.apply(products, gated, hidden, place);
        }
        if let Some(so2) = &self.invariant {
            so2.apply_invariant(&workspace.prepared, &mut hidden[2 * width..], stride);
            for token in hidden.chunks_exact_mut(stride) {
                token[2 * width..].iter_mut().for_each(|v| *v = v.max(0.0));
            }
        }
        let hidden = Feature { data: hidden, coordinates, channels: self.hidden, width };
        workspace.prepared.prepare(layer, hidden);
        self.contract.apply(&workspace.prepared, y);
    }
}
