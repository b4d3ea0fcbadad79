//! Equivariant layers: the reference's keys and axis orders against ours.
//!
//! Every tensor of theirs is ours after a view and a permutation of axes: theirs is `[out, in]` with
//! coordinates last, ours `[in, out]` with channels last. Without burn, as [`case`](super::case).

use super::case::{Case, Data};
use super::model::VectorLayer;

/// One parameter: the reference's key and shape, that shape with axes split, the order of these in ours, our name.
pub(crate) struct Binding {
    pub(crate) key: String,
    pub(crate) shape: Vec<usize>,
    pub(crate) view: Vec<usize>,
    pub(crate) order: Vec<usize>,
    pub(crate) ours: String,
}

/// All parameters of a module, and the buffers that must be zero because ours has none.
#[derive(Default)]
pub(crate) struct Bindings {
    pub(crate) parameters: Vec<Binding>,
    pub(crate) zeros: Vec<(String, Vec<usize>)>,
}

/// Sizes of a linear map.
#[derive(Clone, Copy)]
pub(crate) struct Linear {
    pub(crate) layer: VectorLayer,
    pub(crate) input: usize,
    pub(crate) output: usize,
    pub(crate) invariants_in: usize,
    pub(crate) invariants_out: usize,
}

/// `key.part`, or `part` where `key` is empty.
fn join(key: &str, part: &str) -> String {
    if key.is_empty() { part.to_owned() } else { format!("{key}.{part}") }
}

impl Bindings {
    /// A parameter whose axes are split into `view` and then put in `order`.
    pub(crate) fn put(
        &mut self,
        key: String,
        shape: &[usize],
        view: &[usize],
        order: &[usize],
        ours: String,
    ) {
        let (shape, view, order) = (shape.to_vec(), view.to_vec(), order.to_vec());
        self.parameters.push(Binding { key, shape, view, order, ours });
    }

    /// A matrix, `[out, in]` there.
    pub(crate) fn matrix(&mut self, key: String, ours: String, input: usize, output: usize) {
        self.put(key, &[output, input], &[output, input], &[1, 0], ours);
    }

    /// A vector.
    pub(crate) fn vector(&mut self, key: String, ours: String, size: usize) {
        self.put(key, &[size], &[size], &[0], ours);
    }

    pub(crate) fn linear(&mut self, key: &str, ours: &str, sizes: Linear) {
        let Linear { layer, input: d, output: o, invariants_in, invariants_out: j } = sizes;
        let k = invariants_in + 1;
        match layer {
            VectorLayer::Vn => self.matrix(join(key, "weight"), join(ours, "weight"), d, o),
            VectorLayer::So2 => {
                let equivariant = join(key, "equivariant_weights");
                self.put(equivariant, &[o, k, d], &[o, k, d], &[1, 2, 0], join(ours, "equivariant"));
                let weight = join(key, "invariant_linear.1.weight");
                self.put(weight, &[o * j, d * k], &[o, j, d, k], &[3, 2, 1, 0], join(ours, "invariant"));
                let bias = join(key, "invariant_linear.1.bias");
                self.put(bias, &[o * j], &[o, j], &[1, 0], join(ours, "bias"));
            }
        }
    }

    pub(crate) fn relu(&mut self, key: &str, ours: &str, channels: usize) {
        for (theirs, mine) in [("W", "w"), ("U", "u")] {
            self.matrix(join(key, theirs), join(ours, mine), channels, channels);
        }
    }

    pub(crate) fn norm(&mut self, key: &str, ours: &str, channels: usize) {
        self.vector(join(key, "ln.gamma"), join(ours, "gamma"), channels);
        self.zeros.push((join(key, "ln.beta"), vec![channels]));
    }

    /// `inner` is heads times channels per head.
    pub(crate) fn attention(&mut self, key: &str, ours: &str, channels: usize, inner: usize, kind: Kind) {
        for (theirs, mine) in [("to_q", "query"), ("to_k", "key"), ("to_v", "value")] {
            self.linear(&join(key, theirs), &join(ours, mine), kind.linear(channels, inner));
        }
        self.linear(&join(key, "to_out"), &join(ours, "out"), kind.linear(inner, channels));
    }

    pub(crate) fn feed_forward(&mut self, key: &str, ours: &str, channels: usize, inner: usize, kind: Kind) {
        self.linear(&join(key, "0"), &join(ours, "expand"), kind.linear(channels, inner));
        let relu = if kind.layer == VectorLayer::So2 { "1.vn_relu" } else { "1" };
        self.relu(&join(key, relu), &join(ours, "relu"), inner);
        self.linear(&join(key, "2"), &join(ours, "contract"), kind.linear(inner, channels));
    }

    pub(crate) fn transformer(&mut self, key: &str, ours: &str, sizes: Transformer, kind: Kind) {
        let Transformer { depth, channels, attention, feed_forward } = sizes;
        for l in 0..depth {
            let (key, ours) = (join(key, &format!("layers.{l}")), join(ours, &format!("layers.{l}")));
            self.attention(&format!("{key}.0"), &format!("{ours}.attention"), channels, attention, kind);
            self.norm(&format!("{key}.1"), &format!("{ours}.norm1"), channels);
            self.feed_forward(
                &format!("{key}.2"),
                &format!("{ours}.feed_forward"),
                channels,
                feed_forward,
                kind,
            );
            self.norm(&format!("{key}.3"), &format!("{ours}.norm2"), channels);
        }
    }

    /// The case's weights by our names, in our order of axes; what ours lacks must be zero.
    pub(crate) fn weights(&self, case: &Case) -> Vec<(String, Data)> {
        let theirs = |key: &str, shape: &[usize]| {
            case.weight(key, shape).unwrap_or_else(|| panic!("the case has no weight `{key}`"))
        };
        for (key, shape) in &self.zeros {
            let zero = theirs(key, shape).values.iter().all(|&v| v == 0.0);
            assert!(zero, "`{key}` is not zero: our layer norm has no offset");
        }
        let weight = |b: &Binding| (b.ours.clone(), theirs(&b.key, &b.shape).permuted(&b.view, &b.order));
        self.parameters.iter().map(weight).collect()
    }
}

/// Kind of linear map, with the number of invariant coordinates an SO(2) one has.
#[derive(Clone, Copy)]
pub(crate) struct Kind {
    pub(crate) layer: VectorLayer,
    pub(crate) invariants: usize,
}

impl Kind {
    pub(crate) fn linear(self, input: usize, output: usize) -> Linear {
        let Self { layer, invariants } = self;
        Linear { layer, input, output, invariants_in: invariants, invariants_out: invariants }
    }
}

/// Sizes of a transformer; `attention` and `feed_forward` are inner channels.
#[derive(Clone, Copy)]
pub(crate) struct Transformer {
    pub(crate) depth: usize,
    pub(crate) channels: usize,
    pub(crate) attention: usize,
    pub(crate) feed_forward: usize,
}
