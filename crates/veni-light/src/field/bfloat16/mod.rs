//! Matrix products of training in bfloat16: mixed precision where the processor has it.
//!
//! bfloat16 is f32 without its last 16 bits: the same range, eight significant bits. Both factors of every product are
//! rounded to it, to nearest and ties to even; sums, and everything that is not a matrix product (encoding, norms, ReLU,
//! losses, the weights that are trained), stay in f32. x86 processors with AVX512-BF16 (Zen 4, Cooper Lake, Sapphire
//! Rapids and later) multiply and add pairs at twice the rate of f32.
//!
//! What is handed to the kernels are pairs of neighbours in one 32-bit word, the first in its lower half: neighbouring
//! inputs for W x, neighbouring directions for the sums x gᵀ.

#[cfg_attr(not(all(target_arch = "x86_64", feature = "training")), path = "none.rs")]
#[cfg_attr(all(target_arch = "x86_64", feature = "training"), path = "x86.rs")]
mod kernels;
#[cfg(test)]
mod tests;

use super::mlp::PANEL;

/// Lanes of a vector, and vectors of a row, of the processors in question.
const LANES: usize = 16;
/// A feature of a block.
type Row = [[f32; LANES]; super::block::VECTORS];
/// Outputs of a panel of the sums x gᵀ.
type Wide = [[f32; LANES]; 2];
/// Pairs of directions of such a panel, transposed.
type WidePairs = [[u32; LANES]; 2];

/// Proof that this processor multiplies in bfloat16.
#[derive(Clone, Copy, Debug)]
pub struct Bfloat16(());

impl Bfloat16 {
    /// None where the processor does not.
    pub fn detect() -> Option<Self> {
        kernels::detected().then_some(Self(()))
    }

    /// Turns the rows of a block's gradient round for [`Bfloat16::add`]: panel by panel, in each pair of directions by
    /// pair. What `out` holds beyond the last row stays.
    pub(super) fn transpose(self, rows: &[Row], out: &mut [WidePairs]) {
        kernels::transpose(self, rows, out);
    }

    /// Adds x gᵀ of a block to `sums`, which lie panel by panel, in each input by input.
    pub(super) fn add(self, x: &[Row], gradient: &[WidePairs], sums: &mut [Wide]) {
        kernels::add(self, x, gradient, sums);
    }
}

/// A matrix in panels as [`Matrix`](super::mlp::Matrix), its inputs in pairs; an odd last one is paired with 0.
#[derive(Debug)]
pub(super) struct Pairs {
    token: Bfloat16,
    /// Per panel.
    pairs: usize,
    words: Vec<[u32; PANEL]>,
}

impl Pairs {
    /// Of panels of `inputs` rows each, one after the other.
    pub(super) fn new(token: Bfloat16, inputs: usize, rows: &[[f32; PANEL]]) -> Self {
        let words = rows.chunks_exact(inputs).flat_map(|panel| {
            panel.chunks(2).map(|rows| {
                let second = rows.get(1).copied().unwrap_or_default();
                std::array::from_fn(|o| pair(rows[0][o], second[o]))
            })
        });
        Self { token, pairs: inputs.div_ceil(2), words: words.collect() }
    }

    pub(super) fn token(&self) -> Bfloat16 {
        self.token
    }

    /// As [`product`](super::block::product).
    pub(super) fn product<const ADD: bool, const RELU: bool>(
        &self,
        bias: &[[f32; PANEL]],
        x: &[Row],
        y: &mut [[Row; PANEL]],
    ) {
        kernels::product::<ADD, RELU>(self, bias, x, y);
    }
}

/// Both rounded, the first in the lower half.
fn pair(first: f32, second: f32) -> u32 {
    let [first, second] = [first, second].map(rounded);
    first | second << 16
}

/// The upper half of the nearest number whose lower half is 0, to even at a tie.
fn rounded(value: f32) -> u32 {
    let bits = value.to_bits();
    match value.is_nan() {
        // a carry would make infinity or −0 of it
        true => bits >> 16 | 0x40,
        false => (bits + 0x7fff + (bits >> 16 & 1)) >> 16,
    }
}
