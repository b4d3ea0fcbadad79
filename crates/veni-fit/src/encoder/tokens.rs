//! From the samples of a stripe to a token.
//!
//! Directions are the same for all images of a grid, so what depends on them alone is computed once
//! ([`ProjectIn::fold`]), and only what the colours meet is computed for an image: for an SO(2) layer 3/5 of the
//! products, for Vector Neurons half of them.

use veni_light::model::VectorLayer;

use super::linear::{Prepared, So2};
use super::matrix::{Matrix, PackedRows, Product, Rows};
use super::weights::{LATENT_COORDINATES, SAMPLE_COORDINATES, Shape, Tensors};

/// The linear map from P samples to channels, in a part of the directions and a part of the colours.
#[derive(Clone, Debug)]
pub(super) struct ProjectIn {
    samples: usize,
    weights: Weights,
}

#[derive(Clone, Debug)]
enum Weights {
    /// Directions and colours are coordinates of their own, with the same weights.
    Vn(Matrix),
    So2 {
        /// t = (1, z), s = (z, |x|), and the bias.
        directions: So2,
        /// t = s = (r, g, b).
        colours: So2,
    },
}

/// Workspace for a block of tokens.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    terms: Vec<f32>,
    packed: PackedRows,
}

impl ProjectIn {
    pub(super) fn new(tensors: Tensors<'_>, name: &str, shape: Shape) -> Self {
        let names = [name.to_owned()];
        let weights = match shape.layer {
            VectorLayer::Vn => {
                Weights::Vn(Matrix::new(tensors.get(&format!("{name}.weight")), shape.outputs))
            }
            VectorLayer::So2 => Weights::So2 {
                directions: So2::new(tensors, &names, shape, 1.0, [&[0, 1], &[0, 4]]),
                colours: So2::new(tensors, &names, shape, 1.0, [&[2, 3, 4], &[1, 2, 3]]),
            },
        };
        Self { samples: shape.inputs, weights }
    }

    /// The part of the directions, `[token, coordinate, channel]`, from `[token, sample]`. Every token has
    /// `coordinates`.
    pub(super) fn fold(&self, directions: &[[f32; 3]], coordinates: usize) -> Vec<f32> {
        let tokens = directions.len() / self.samples;
        let mut workspace = Workspace::default();
        match &self.weights {
            Weights::Vn(weight) => {
                let mut out = vec![0.0; tokens * coordinates * weight.outputs()];
                for axis in 0..LATENT_COORDINATES {
                    self.columns(directions, axis, weight, coordinates, axis, &mut out, &mut workspace);
                }
                out
            }
            Weights::So2 { directions: so2, .. } => {
                let mut out = vec![0.0; tokens * coordinates * so2.equivariant.outputs()];
                let inputs = 2 * self.samples;
                let mut prepared = Prepared::default();
                for (axis, packed) in [&mut prepared.first, &mut prepared.second].into_iter().enumerate() {
                    workspace.terms(directions, self.samples, |d, out| {
                        out.extend(d.iter().map(|d| d[axis]));
                        out.extend(d.iter().map(|d| d[2] * d[axis]));
                    });
                    packed.pack(Rows { data: &workspace.terms, stride: inputs, count: tokens }, inputs);
                }
                workspace.terms(directions, self.samples, |d, out| {
                    out.extend(d.iter().map(|d| d[2]));
                    out.extend(d.iter().map(|d| (d[0] * d[0] + d[1] * d[1]).sqrt()));
                });
                prepared
                    .invariant
                    .pack(Rows { data: &workspace.terms, stride: inputs, count: tokens }, inputs);
                so2.apply(&prepared, &mut out);
                out
            }
        }
    }

    /// Adds the part of the colours to `y`, which holds the part of the directions of the same tokens.
    pub(super) fn add(
        &self,
        directions: &[[f32; 3]],
        colours: &[[f32; 3]],
        coordinates: usize,
        y: &mut [f32],
        workspace: &mut Workspace,
    ) {
        match &self.weights {
            Weights::Vn(weight) => {
                for colour in 0..SAMPLE_COORDINATES - LATENT_COORDINATES {
                    let coordinate = LATENT_COORDINATES + colour;
                    self.columns(colours, colour, weight, coordinates, coordinate, y, workspace);
                }
            }
            Weights::So2 { colours: so2, .. } => {
                let (weight, count) = (&so2.equivariant, colours.len() / self.samples);
                let (width, inputs) = (weight.outputs(), 3 * self.samples);
                let stride = coordinates * width;
                for axis in 0..2 {
                    workspace.terms.clear();
                    let stripes = colours.chunks_exact(self.samples);
                    for (colours, d) in stripes.zip(directions.chunks_exact(self.samples)) {
                        for k in 0..3 {
                            workspace.terms.extend(colours.iter().zip(d).map(|(c, d)| c[k] * d[axis]));
                        }
                    }
                    workspace.packed.pack(Rows { data: &workspace.terms, stride: inputs, count }, inputs);
                    let (x, panels, y) = (&workspace.packed, 0..weight.panels(), &mut y[axis * width..]);
                    Product { x, weight, panels, y, stride, add: true }.run();
                }
                workspace.terms(colours, self.samples, |colours, out| {
                    for k in 0..3 {
                        out.extend(colours.iter().map(|c| c[k]));
                    }
                });
                workspace.packed.pack(Rows { data: &workspace.terms, stride: inputs, count }, inputs);
                let (x, weight, y) = (&workspace.packed, &so2.invariant, &mut y[2 * width..]);
                Product { x, weight, panels: 0..weight.panels(), y, stride, add: true }.run();
            }
        }
    }

    /// Vector Neurons: component `from` of every sample to coordinate `to` of every token.
    #[allow(clippy::too_many_arguments, reason = "two places and what lies between them")]
    fn columns(
        &self,
        samples: &[[f32; 3]],
        from: usize,
        weight: &Matrix,
        coordinates: usize,
        to: usize,
        y: &mut [f32],
        workspace: &mut Workspace,
    ) {
        let (count, width) = (samples.len() / self.samples, weight.outputs());
        workspace.terms(samples, self.samples, |samples, out| out.extend(samples.iter().map(|s| s[from])));
        workspace.packed.pack(Rows { data: &workspace.terms, stride: self.samples, count }, self.samples);
        let (x, panels, y) = (&workspace.packed, 0..weight.panels(), &mut y[to * width..]);
        Product { x, weight, panels, y, stride: coordinates * width, add: false }.run();
    }
}

impl Workspace {
    /// Fills `terms` stripe by stripe.
    fn terms(&mut self, samples: &[[f32; 3]], each: usize, row: impl Fn(&[[f32; 3]], &mut Vec<f32>)) {
        self.terms.clear();
        for stripe in samples.chunks_exact(each) {
            row(stripe, &mut self.terms);
        }
    }
}
