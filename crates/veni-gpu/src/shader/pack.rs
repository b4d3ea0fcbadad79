//! Weights and latents in the order that `layout.wgsl` describes.

use veni_light::field::Field;
use veni_light::latent::Lobe;
use veni_light::light::{Falloff, Lights};
use veni_light::model::Model;
use veni_light::{Error, Result};

use super::{MAX_LIGHTS, MAX_LOBES, Sizes};

/// The two buffers of a model.
#[derive(Clone, Debug)]
pub struct PackedModel {
    /// What the shaders are specialised on.
    pub sizes: Sizes,
    /// `veni_matrices`.
    pub matrices: MatrixWords,
    /// `veni_vectors`: f32, whole vec4s.
    pub vectors: Vec<f32>,
}

/// Matrices in single precision. [`MatrixWords::to_half`] gives them in half, where that loses nothing.
#[derive(Clone, Debug)]
pub struct MatrixWords(pub Vec<f32>);

impl MatrixWords {
    /// The bits of the same numbers as f16, if each of them is one: models are usually stored so. Otherwise nothing.
    pub fn to_half(&self) -> Option<Vec<u16>> {
        let half = |v: &f32| {
            let half = half::f16::from_f32(*v);
            (half.to_f32().to_bits() == v.to_bits()).then_some(half.to_bits())
        };
        self.0.iter().map(half).collect()
    }
}

/// Packs what does not depend on a latent.
///
/// # Panics
/// If [`Model::decoder`] refuses the network.
pub fn pack_model(model: &Model) -> PackedModel {
    let sizes = Sizes::from(model.config());
    let row = 4 * sizes.columns();
    // a `Model` holds every tensor of its schema in the schema's shape
    let tensor = |name: &str| model.tensors()[&format!("decoder.{name}")].data.as_slice();
    let mut matrices = Rows { row, data: Vec::with_capacity(row * sizes.matrix_rows()) };
    let m = sizes.latents + 2;
    // stored: sine of every input at both frequencies, the cosines, the inputs themselves; here input by input
    let input = tensor("input.weight");
    for j in 0..m {
        for k in [2 * j, 2 * j + 1, 2 * (m + j), 2 * (m + j) + 1, 4 * m + j] {
            matrices.push(&input[k * sizes.hidden..][..sizes.hidden]);
        }
    }
    matrices.skip(5 * (sizes.padded_inputs() - m));
    let mut vectors = Rows { row, data: Vec::with_capacity(row * sizes.vector_rows()) };
    for l in 0..sizes.layers {
        for part in ["ff1", "ff2"] {
            let weight = tensor(&format!("layers.{l}.{part}.weight"));
            weight.chunks_exact(sizes.hidden).for_each(|values| matrices.push(values));
            matrices.skip(row - sizes.hidden);
        }
        for part in ["norm1.gamma", "norm1.beta", "ff1.bias", "ff2.bias", "norm2.gamma"] {
            vectors.push(tensor(&format!("layers.{l}.{part}")));
        }
    }
    let output = tensor("output.weight");
    for channel in 0..3 {
        vectors.push(&output.iter().skip(channel).step_by(3).copied().collect::<Vec<_>>());
    }
    vectors.push(tensor("output.bias"));
    PackedModel { sizes, matrices: MatrixWords(matrices.data), vectors: vectors.data }
}

/// Appends the block of a conditioned latent to `veni_latents`: [`Sizes::latent_stride`] vec4s. `sizes` are those of the
/// model that conditioned it.
///
/// # Errors
/// [`Error::Unsupported`] if the code has more lights than [`MAX_LIGHTS`] or more lobes than [`MAX_LOBES`]: there is no room for them. A
/// host that draws the lights itself packs [`Field::without_lights`].
///
/// # Panics
/// If that model's hidden size is too small for `sizes`.
pub fn pack_latent(sizes: Sizes, field: &Field, out: &mut Vec<f32>) -> Result<()> {
    let folded = field.folded();
    for (count, most, what) in
        [(field.lights().len(), MAX_LIGHTS, "lights"), (folded.lobes.len(), MAX_LOBES, "lobes")]
    {
        if count > most {
            return Err(Error::unsupported(format!(
                "a code of {count} {what}: the shaders have room for {most}"
            )));
        }
    }
    let mut rows = Rows { row: 4 * sizes.columns(), data: std::mem::take(out) };
    rows.push(&folded.input_bias[..sizes.hidden]);
    folded.shifts.iter().for_each(|shift| rows.push(&shift[..sizes.hidden]));
    let mut data = rows.data;
    for [x, y] in folded.vectors {
        let ([hx, lx], [hy, ly]) = (split(*x), split(*y));
        data.extend([hx, hy, lx, ly]);
    }
    // the counts as data: see `veni_counts`
    let counts = [sizes.columns(), sizes.layers, sizes.latents + 2].map(|n| n as f32);
    data.push(folded.log_exposure);
    data.extend(counts);
    push_lights(field.lights(), &mut data);
    push_lobes(folded.lobes, &mut data);
    *out = data;
    Ok(())
}

/// Two vec4s of each light that a direction can meet, and zeros for the others.
fn push_lights(lights: &Lights, data: &mut Vec<f32>) {
    let end = data.len() + 8 * MAX_LIGHTS;
    let met = lights.iter().filter_map(|light| Some((light.direction, light.profile()?)));
    let rows: Vec<_> = met
        .map(|([x, y, z], profile)| {
            let [r, g, b] = profile.peak.map(|v| v.min(f32::MAX));
            [x, y, z, extent(profile.falloff), r, g, b, 0.0]
        })
        .collect();
    push_rows(&rows, end, data);
}

fn push_lobes(lobes: &[Lobe], data: &mut Vec<f32>) {
    let end = data.len() + 8 * MAX_LOBES;
    let row = |lobe: &Lobe| {
        let ([x, y, z], [r, g, b]) = (lobe.direction, lobe.amplitude);
        [x, y, z, -0.5 * lobe.sharpness, r, g, b, 0.0]
    };
    push_rows(&lobes.iter().map(row).collect::<Vec<_>>(), end, data);
}

/// Rows with their number in the last component of the first, and zeros up to `end`.
fn push_rows(rows: &[[f32; 8]], end: usize, data: &mut Vec<f32>) {
    let first = data.len();
    data.extend_from_slice(rows.as_flattened());
    data.resize(end, 0.0);
    data[first + 7] = rows.len() as f32;
}

/// How a light falls off as one number: the squared chord of a disc, −κ/2 of a glow.
pub(super) fn extent(falloff: Falloff) -> f32 {
    match falloff {
        Falloff::Disc(square) => square,
        Falloff::Glow(kappa) => (-0.5 * kappa) as f32,
    }
}

/// `v` as a number of 12 significant bits and the rest: products of the first with its like are exact.
fn split(v: f32) -> [f32; 2] {
    let high = f32::from_bits(v.to_bits() & 0xffff_f000);
    [high, v - high]
}

struct Rows {
    row: usize,
    data: Vec<f32>,
}

impl Rows {
    /// One row, filled up with zeros.
    fn push(&mut self, values: &[f32]) {
        let end = self.data.len() + self.row;
        self.data.extend_from_slice(values);
        self.data.resize(end, 0.0);
    }

    fn skip(&mut self, rows: usize) {
        self.data.resize(self.data.len() + rows * self.row, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use veni_light::latent::{Latent, Prior};
    use veni_light::model::{DecoderConfig, ModelConfig};

    use super::*;

    #[test]
    fn lengths_are_those_of_the_layout() {
        for (n, hidden, layers) in [(9, 128, 6), (1, 5, 1), (10, 24, 3)] {
            let decoder = DecoderConfig { hidden, layers, heads: 1, ..DecoderConfig::default() };
            let model = Model::filler(&ModelConfig { decoder, ..ModelConfig::decode_only(n) }, 1).unwrap();
            let packed = pack_model(&model);
            let sizes = packed.sizes;
            assert_eq!(packed.matrices.0.len(), 4 * sizes.columns() * sizes.matrix_rows());
            assert_eq!(packed.vectors.len(), 4 * sizes.columns() * sizes.vector_rows());
            let latent = Latent::from_seed(&Prior::standard(n), 3);
            let mut block = vec![7.0];
            pack_latent(sizes, &model.decoder().unwrap().condition(&latent).unwrap(), &mut block).unwrap();
            assert_eq!(block.len(), 1 + 4 * sizes.latent_stride());
        }
    }

    #[test]
    fn half_precision_is_used_only_where_it_loses_nothing() {
        assert_eq!(MatrixWords(vec![1.0, -0.5, 0.0, -0.0]).to_half().unwrap()[1], 0xb800);
        assert!(MatrixWords(vec![1.0, 0.1]).to_half().is_none());
        assert!(MatrixWords(vec![1e6]).to_half().is_none());
    }

    #[test]
    fn splitting_loses_nothing_and_makes_products_exact() {
        for v in [1.0f32, -3.25e-3, 65_535.996, 0.1, 1.0e-12, std::f32::consts::PI] {
            let [high, low] = split(v);
            assert_eq!(high + low, v);
            assert_eq!(f64::from(high) * f64::from(high), f64::from(high * high));
        }
    }
}
