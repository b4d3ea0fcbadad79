//! Linear maps of vector features: Vector Neurons or SO(2).

use veni_light::model::VectorLayer;

use super::matrix::{Matrix, PackedRows, Product, Rows, padded};
use super::so2;
use super::weights::{Shape, Tensors};

/// A vector feature `[token, coordinate, channel]`, channels filled up to `width` with zeros.
#[derive(Clone, Copy, Debug)]
pub(super) struct Feature<'a> {
    pub(super) data: &'a [f32],
    pub(super) coordinates: usize,
    pub(super) channels: usize,
    pub(super) width: usize,
}

impl Feature<'_> {
    pub(super) fn tokens(&self) -> usize {
        self.data.len() / (self.coordinates * self.width)
    }
}

/// A feature as the matrix products of a layer read it. Several layers of the same input can share it.
#[derive(Clone, Debug, Default)]
pub(super) struct Prepared {
    /// Vector Neurons: a row per token and coordinate. SO(2): rows t_k,i x_i of coordinate x.
    pub(super) first: PackedRows,
    /// SO(2): the same of coordinate y.
    pub(super) second: PackedRows,
    /// SO(2): rows s_k,i.
    pub(super) invariant: PackedRows,
    terms: Vec<f32>,
}

impl Prepared {
    /// Packs `x` for layers of this kind.
    pub(super) fn prepare(&mut self, layer: VectorLayer, x: Feature<'_>) {
        let Feature { data, coordinates, channels, width } = x;
        let tokens = x.tokens();
        match layer {
            VectorLayer::Vn => {
                self.first.pack(Rows { data, stride: width, count: tokens * coordinates }, channels);
            }
            VectorLayer::So2 => {
                let inputs = (coordinates - 1) * channels;
                for (axis, packed) in [&mut self.first, &mut self.second].into_iter().enumerate() {
                    so2::equivariant_terms(x, axis, &mut self.terms);
                    packed.pack(Rows { data: &self.terms, stride: inputs, count: tokens }, inputs);
                }
                so2::invariant_terms(x, &mut self.terms);
                self.invariant.pack(Rows { data: &self.terms, stride: inputs, count: tokens }, inputs);
            }
        }
    }
}

/// One or several linear maps of the same input side by side: outputs of map p start at channel
/// p · [`padded`]`(outputs)`.
#[derive(Clone, Debug)]
pub(super) enum Linear {
    /// Y = X W for every coordinate.
    Vn(Matrix),
    /// The SO(2) layer: y = Σ We t x for x and y, w = b + Σ Wi s for the invariant coordinates.
    So2(So2),
}

/// Weights of an SO(2) layer.
#[derive(Clone, Debug)]
pub(super) struct So2 {
    pub(super) equivariant: Matrix,
    /// Columns coordinate-major.
    pub(super) invariant: Matrix,
    /// As the columns of `invariant`.
    pub(super) bias: Vec<f32>,
}

impl Linear {
    /// The maps of these names, all of one shape, times `scale`.
    pub(super) fn new(tensors: Tensors<'_>, names: &[String], shape: Shape, scale: f32) -> Self {
        let Shape { layer, inputs, outputs, from, .. } = shape;
        match layer {
            VectorLayer::Vn => {
                let pad = padded(outputs);
                let mut matrix = Matrix::default();
                matrix.reset(inputs, names.len() * pad);
                for (p, name) in names.iter().enumerate() {
                    let weight = tensors.get(&format!("{name}.weight")).chunks_exact(outputs);
                    weight.enumerate().for_each(|(k, row)| matrix.put(k, p * pad, &scaled(row, scale)));
                }
                Self::Vn(matrix)
            }
            VectorLayer::So2 => {
                let all: Vec<usize> = (0..from - 1).collect();
                Self::So2(So2::new(tensors, names, shape, scale, [&all, &all]))
            }
        }
    }

    /// The kind of layer.
    pub(super) fn layer(&self) -> VectorLayer {
        match self {
            Self::Vn(_) => VectorLayer::Vn,
            Self::So2(_) => VectorLayer::So2,
        }
    }

    /// Channels that go out, filled up.
    pub(super) fn width(&self) -> usize {
        match self {
            Self::Vn(weight) => weight.outputs(),
            Self::So2(so2) => so2.equivariant.outputs(),
        }
    }

    /// Applies the maps to what [`Prepared::prepare`] made of x. `y` is `[token, coordinate, width]`.
    pub(super) fn apply(&self, x: &Prepared, y: &mut [f32]) {
        match self {
            Self::Vn(weight) => {
                let (panels, stride) = (0..weight.panels(), weight.outputs());
                Product { x: &x.first, weight, panels, y, stride, add: false }.run();
            }
            Self::So2(so2) => so2.apply(x, y),
        }
    }
}

impl So2 {
    /// Only the rows of some k of t_k and of some k of s_k, in this order.
    pub(super) fn new(
        tensors: Tensors<'_>,
        names: &[String],
        shape: Shape,
        scale: f32,
        [vectors, numbers]: [&[usize]; 2],
    ) -> Self {
        let Shape { inputs, outputs, to, .. } = shape;
        let (pad, width, invariants) = (padded(outputs), names.len() * padded(outputs), to - 2);
        let (mut equivariant, mut invariant) = (Matrix::default(), Matrix::default());
        let mut bias = vec![0.0; invariants * width];
        equivariant.reset(vectors.len() * inputs, width);
        invariant.reset(numbers.len() * inputs, invariants * width);
        for (p, name) in names.iter().enumerate() {
            let tensor = |part: &str| tensors.get(&format!("{name}.{part}"));
            let rows =
                |ks: &[usize]| ks.iter().flat_map(|k| k * inputs..(k + 1) * inputs).collect::<Vec<_>>();
            for (k, row) in rows(vectors).into_iter().enumerate() {
                equivariant.put(
                    k,
                    p * pad,
                    &scaled(&tensor("equivariant")[row * outputs..][..outputs], scale),
                );
            }
            let columns = invariants * outputs;
            for (k, row) in rows(numbers).into_iter().enumerate() {
                let row = tensor("invariant")[row * columns..][..columns].chunks_exact(outputs);
                row.enumerate().for_each(|(j, row)| {
                    invariant.put(k, j * width + p * pad, &scaled(row, scale));
                });
            }
            for (j, row) in tensor("bias").chunks_exact(outputs).enumerate() {
                bias[j * width + p * pad..][..outputs].copy_from_slice(&scaled(row, scale));
            }
        }
        Self { equivariant, invariant, bias }
    }

    /// Applies the layer; see [`Linear::apply`].
    pub(super) fn apply(&self, x: &Prepared, y: &mut [f32]) {
        let weight = &self.equivariant;
        let width = weight.outputs();
        let stride = 2 * width + self.bias.len();
        for (axis, x) in [&x.first, &x.second].into_iter().enumerate() {
            let y = &mut y[axis * width..];
            Product { x, weight, panels: 0..weight.panels(), y, stride, add: false }.run();
        }
        self.apply_invariant(x, &mut y[2 * width..], stride);
    }

    /// The invariant half; token t starts at t · `stride` in `y`.
    pub(super) fn apply_invariant(&self, x: &Prepared, y: &mut [f32], stride: usize) {
        for token in y.chunks_mut(stride) {
            token[..self.bias.len()].copy_from_slice(&self.bias);
        }
        let weight = &self.invariant;
        Product { x: &x.invariant, weight, panels: 0..weight.panels(), y, stride, add: true }.run();
    }
}

fn scaled(row: &[f32], scale: f32) -> Vec<f32> {
    row.iter().map(|w| w * scale).collect()
}
