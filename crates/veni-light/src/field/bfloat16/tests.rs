//! The kernels against sums in f64 of what was rounded, and what rounding changes.
//!
//! A processor without bfloat16 has nothing to test but that it says so.

use crate::random::Stream;
use half::bf16;

use super::{Bfloat16, LANES, Pairs, Row, Wide, WidePairs};
use crate::field::block::VECTORS;
use crate::field::mlp::PANEL;

/// Directions of a block.
const BLOCK: usize = VECTORS * LANES;

/// None, and a word about it, where the processor multiplies no bfloat16.
fn token() -> Option<Bfloat16> {
    let token = Bfloat16::detect();
    if token.is_none() {
        eprintln!("skipped: this processor multiplies no bfloat16");
    }
    token
}

fn rows(count: usize, rng: &mut Stream) -> Vec<Row> {
    (0..count).map(|_| [[0.0; LANES]; VECTORS].map(|v| v.map(|_| 2.0 * rng.signed() as f32))).collect()
}

fn rounded(v: f32) -> f64 {
    f64::from(bf16::from_f32(v).to_f32())
}

/// The sum of the products, as it is and with rounded factors, and the sum of their sizes.
fn sums(factors: impl Iterator<Item = (f32, f32)>) -> [f64; 3] {
    factors.fold([0.0; 3], |[plain, coarse, size], (a, b)| {
        let product = f64::from(a) * f64::from(b);
        [plain + product, coarse + rounded(a) * rounded(b), size + product.abs()]
    })
}

/// How far results are from the sums of rounded and of plain factors, as shares of what adding up in f32 may cost.
#[derive(Default)]
struct Apart {
    coarse: f64,
    plain: f64,
}

impl Apart {
    fn see(&mut self, found: f32, offset: f64, [plain, coarse, size]: [f64; 3]) {
        let allowed = 1e-6 * (size + offset.abs());
        let apart = |expected: f64| (f64::from(found) - expected - offset).abs() / allowed;
        self.coarse = self.coarse.max(apart(coarse));
        self.plain = self.plain.max(apart(plain));
    }

    fn agree(&self, what: &str) {
        assert!(self.coarse < 1.0, "{what}: {} of what is allowed", self.coarse);
        // the break: were the factors not rounded, or the reference's, this would be seen
        assert!(self.plain > 20.0, "{what}: only {} from sums of unrounded factors", self.plain);
    }
}

#[test]
fn rounding_is_that_of_the_library() {
    // around every bfloat16: its bits in f32, the middle to the next, and the neighbours of both
    for upper in (0..1 << 16).map(|upper: u32| upper << 16) {
        for bits in [upper, upper + 1, upper + 0x7fff, upper + 0x8000, upper + 0x8001, upper + 0xffff] {
            let value = f32::from_bits(bits);
            assert_eq!(super::rounded(value), u32::from(bf16::from_f32(value).to_bits()), "{bits:08x}");
        }
    }
}

#[test]
fn products_are_sums_of_rounded_factors() {
    let Some(token) = token() else { return };
    let mut rng = Stream::from_seed(1);
    // one pair, an odd input, a whole part, a little more, several parts
    for (inputs, outputs) in [(1, 8), (5, 16), (128, 128), (129, 8), (500, 24)] {
        let matrix: Vec<[f32; PANEL]> =
            (0..inputs * outputs / PANEL).map(|_| [0.0; PANEL].map(|_| rng.signed() as f32)).collect();
        let bias: Vec<[f32; PANEL]> =
            (0..outputs / PANEL).map(|_| [0.0; PANEL].map(|_| rng.signed() as f32)).collect();
        let (x, before) = (rows(inputs, &mut rng), rows(outputs, &mut rng));
        let pairs = Pairs::new(token, inputs, &matrix);
        for (add, relu) in [(false, false), (true, false), (false, true), (true, true)] {
            let mut y = before.clone();
            let panels = y.as_chunks_mut::<PANEL>().0;
            match (add, relu) {
                (false, false) => pairs.product::<false, false>(&bias, &x, panels),
                (true, false) => pairs.product::<true, false>(&bias, &x, panels),
                (false, true) => pairs.product::<false, true>(&bias, &x, panels),
                (true, true) => pairs.product::<true, true>(&bias, &x, panels),
            }
            let mut apart = Apart::default();
            for (o, (row, before)) in y.iter().zip(&before).enumerate() {
                for (lane, found) in row.as_flattened().iter().enumerate() {
                    let weights = matrix[o / PANEL * inputs..][..inputs].iter().map(|w| w[o % PANEL]);
                    let found_sums = sums(weights.zip(x.iter().map(|x| x.as_flattened()[lane])));
                    let old = if add { f64::from(before.as_flattened()[lane]) } else { 0.0 };
                    let offset = f64::from(bias[o / PANEL][o % PANEL]) + old;
                    if relu && found_sums[1] + offset < 1e-4 {
                        assert!(*found < 2e-4, "ReLU left {found}");
                    } else {
                        apart.see(*found, offset, found_sums);
                    }
                }
            }
            apart.agree(&format!("{inputs} inputs, {outputs} outputs, add {add}, relu {relu}"));
        }
    }
}

#[test]
fn outer_products_are_sums_of_rounded_factors() {
    let Some(token) = token() else { return };
    let mut rng = Stream::from_seed(2);
    // less than a tile of inputs, tiles and some more, several parts; outputs that fill a panel and that do not
    for (inputs, outputs) in [(3, 32), (21, 40), (128, 128), (301, 32)] {
        let (x, g) = (rows(inputs, &mut rng), rows(outputs, &mut rng));
        let panels = outputs.div_ceil(2 * LANES);
        let mut transposed: Vec<WidePairs> = vec![[[0; LANES]; 2]; panels * BLOCK / 2];
        token.transpose(&g, &mut transposed);
        let mut found: Vec<Wide> = vec![[[0.75; LANES]; 2]; panels * inputs];
        token.add(&x, &transposed, &mut found);
        let mut apart = Apart::default();
        for (o, g) in g.iter().enumerate() {
            for (i, x) in x.iter().enumerate() {
                let found = found[o / (2 * LANES) * inputs + i].as_flattened()[o % (2 * LANES)];
                let factors = x.as_flattened().iter().copied().zip(g.as_flattened().iter().copied());
                apart.see(found, 0.75, sums(factors));
            }
        }
        apart.agree(&format!("{inputs} inputs, {outputs} outputs"));
    }
}

#[test]
fn detection_agrees_with_the_system() {
    // what the kernel of the system lists is found by other code than ours
    let Ok(listed) = std::fs::read_to_string("/proc/cpuinfo") else { return };
    if cfg!(all(target_arch = "x86_64", feature = "training")) {
        assert_eq!(Bfloat16::detect().is_some(), listed.contains("avx512_bf16"));
    } else {
        assert!(Bfloat16::detect().is_none());
    }
}
