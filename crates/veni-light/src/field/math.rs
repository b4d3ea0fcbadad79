//! Elementary functions over SIMD lanes. Errors are measured in the tests below.

use pulp::Simd;

/// 1.5·2²³: adding it to a number below 2²² rounds to the nearest integer, which then sits in the low bits.
const ROUND: f32 = 12_582_912.0;

/// sin 2πu = u·Σ Sᵢ u²ⁱ and cos 2πu = 1 + u² Σ Cᵢ u²ⁱ on |u| ≤ 1/8.
/// (interpolated at Chebyshev nodes; the polynomials' own error is below 3e-9).
const SIN: [f32; 4] = [std::f32::consts::TAU, -41.341_663, 81.592_54, -75.401_61];
const COS: [f32; 4] = [-19.739_208, 64.939_37, -85.448_82, 59.424_107];

/// t − round(t), for |t| < 2²².
#[inline(always)]
pub(super) fn fraction<S: Simd>(simd: S, t: S::f32s) -> S::f32s {
    let round = simd.splat_f32s(ROUND);
    simd.sub_f32s(t, simd.sub_f32s(simd.add_f32s(t, round), round))
}

/// (sin 2πt, cos 2πt), for |t| < 2²⁰.
///
/// The argument is in turns, so that reducing it is exact: t = q/4 + u with an integer q and |u| ≤ 1/8.
#[inline(always)]
pub(super) fn sin_cos_turns<S: Simd>(simd: S, t: S::f32s) -> [S::f32s; 2] {
    let round = simd.splat_f32s(ROUND);
    let shifted = simd.mul_add_f32s(t, simd.splat_f32s(4.0), round);
    let quarters = simd.sub_f32s(shifted, round);
    let u = simd.mul_add_f32s(quarters, simd.splat_f32s(-0.25), t);
    let square = simd.mul_f32s(u, u);
    let sin = simd.mul_f32s(u, polynomial(simd, square, &SIN));
    let cos = simd.mul_add_f32s(square, polynomial(simd, square, &COS), simd.splat_f32s(1.0));
    // quarter turns: an odd q swaps sine and cosine, bit 1 of q (of q + 1) is the sign of the sine (cosine)
    let q = simd.transmute_u32s_f32s(shifted);
    let (one, two) = (simd.splat_u32s(1), simd.splat_u32s(2));
    let odd = simd.equal_u32s(simd.and_u32s(q, one), one);
    [
        signed(simd, simd.select_f32s(odd, cos, sin), simd.and_u32s(q, two)),
        signed(simd, simd.select_f32s(odd, sin, cos), simd.and_u32s(simd.add_u32s(q, one), two)),
    ]
}

// A helper instead of a closure here and below: a closure is compiled without the caller's SIMD features, and
// inlined too late to gain them.
/// `value`, negated where `bit1` is 2 (it is 0 or 2).
#[inline(always)]
fn signed<S: Simd>(simd: S, value: S::f32s, bit1: S::u32s) -> S::f32s {
    let sign = simd.wrapping_dyn_shl_u32s(bit1, simd.splat_u32s(30));
    simd.transmute_f32s_u32s(simd.xor_u32s(simd.transmute_u32s_f32s(value), sign))
}

/// eˣ, held between the smallest normal number and 3.0e38, so that finite input gives finite output.
#[inline(always)]
pub(super) fn exp<S: Simd>(simd: S, x: S::f32s) -> S::f32s {
    const COEFFICIENTS: [f32; 7] = [1.0, 1.0, 0.5, 1.666_640_5e-1, 4.166_634e-2, 8.375_968e-3, 1.394_216e-3];
    let x = simd.max_f32s(simd.splat_f32s(-87.33), simd.min_f32s(simd.splat_f32s(88.6), x));
    let round = simd.splat_f32s(ROUND);
    let shifted = simd.mul_add_f32s(x, simd.splat_f32s(std::f32::consts::LOG2_E), round);
    let n = simd.sub_f32s(shifted, round);
    // ln 2 in two parts, the first exact in products with n
    let r = simd.mul_add_f32s(n, simd.splat_f32s(-0.693_359_4), x);
    let r = simd.mul_add_f32s(n, simd.splat_f32s(2.121_944_4e-4), r);
    let mantissa = polynomial(simd, r, &COEFFICIENTS);
    // 2ⁿ by the exponent bits; n can be 128, one more than they hold, so it goes in two halves
    let bits = simd.transmute_u32s_f32s(shifted);
    let low = simd.splat_u32s(ROUND.to_bits());
    let n = simd.sub_u32s(bits, low);
    let half = simd.wrapping_dyn_shr_u32s(simd.add_u32s(n, simd.splat_u32s(256)), simd.splat_u32s(1));
    let half = simd.sub_u32s(half, simd.splat_u32s(128));
    simd.mul_f32s(simd.mul_f32s(mantissa, power(simd, half)), power(simd, simd.sub_u32s(n, half)))
}

/// 2ⁿ of a two's complement n from −126 to 127.
#[inline(always)]
fn power<S: Simd>(simd: S, n: S::u32s) -> S::f32s {
    let biased = simd.add_u32s(n, simd.splat_u32s(127));
    simd.transmute_f32s_u32s(simd.wrapping_dyn_shl_u32s(biased, simd.splat_u32s(23)))
}

/// Σ cᵢ xⁱ by Horner's rule.
#[inline(always)]
fn polynomial<S: Simd, const N: usize>(simd: S, x: S::f32s, coefficients: &[f32; N]) -> S::f32s {
    let mut sum = simd.splat_f32s(coefficients[N - 1]);
    for c in coefficients[..N - 1].iter().rev() {
        sum = simd.mul_add_f32s(sum, x, simd.splat_f32s(*c));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::{Arch, WithSimd};

    struct Map<'a>(&'a [f32], u8);

    impl WithSimd for Map<'_> {
        type Output = Vec<[f32; 2]>;

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
            let (heads, tail) = S::as_simd_f32s(self.0);
            assert!(tail.is_empty(), "give whole vectors");
            let mut out = Vec::new();
            for x in heads {
                let [a, b] = match self.1 {
                    0 => sin_cos_turns(simd, *x),
                    1 => [exp(simd, *x); 2],
                    _ => [fraction(simd, *x); 2],
                };
                let lanes = |v: S::f32s| bytemuck::cast_slice::<S::f32s, f32>(&[v]).to_vec();
                out.extend(lanes(a).into_iter().zip(lanes(b)).map(|(a, b)| [a, b]));
            }
            out
        }
    }

    fn map(x: &[f32], function: u8) -> Vec<[f32; 2]> {
        Arch::new().dispatch(Map(x, function))
    }

    /// A grid and its neighbourhoods of quarter turns, where reduction and signs can go wrong.
    fn turns() -> Vec<f32> {
        let mut all: Vec<f32> = (-40_000..40_000).map(|i| i as f32 / 9_999.0).collect();
        for q in -64..64 {
            let mut at = q as f32 / 8.0;
            for _ in 0..4 {
                at = at.next_down();
            }
            for _ in 0..8 {
                all.push(at);
                at = at.next_up();
            }
        }
        all.extend((0..1000).map(|i| 1e5 + i as f32 * 0.77));
        all.extend([0.0, -0.0, 1e-30, -1e-38]);
        all.resize(all.len().next_multiple_of(64), 0.5);
        all
    }

    #[test]
    fn sine_and_cosine_are_within_one_ulp_of_one() {
        let turns = turns();
        let mut worst = 0.0f64;
        for (t, [sin, cos]) in turns.iter().zip(map(&turns, 0)) {
            let (s, c) = (std::f64::consts::TAU * (f64::from(*t) - f64::from(*t).round())).sin_cos();
            worst = worst.max((f64::from(sin) - s).abs()).max((f64::from(cos) - c).abs());
        }
        assert!(worst < 9e-8, "{worst:e}");
    }

    #[test]
    fn exponential_is_within_two_ulp() {
        let mut x: Vec<f32> = (-87_000..88_500).map(|i| i as f32 / 1000.0 + 1e-5).collect();
        x.resize(x.len().next_multiple_of(64), 0.0);
        let mut worst = 0.0f64;
        for (x, [y, _]) in x.iter().zip(map(&x, 1)) {
            let truth = f64::from(*x).exp();
            worst = worst.max(((f64::from(y) - truth) / truth).abs());
        }
        assert!(worst < 2.0 * f64::from(f32::EPSILON), "{worst:e}");
    }

    #[test]
    fn exponential_stays_finite_and_passes_nan() {
        let mut x = vec![0.0; 64];
        x[..6].copy_from_slice(&[1e30, f32::INFINITY, 89.0, -1e30, f32::NEG_INFINITY, f32::NAN]);
        let y = map(&x, 1);
        assert!(y[..3].iter().all(|[y, _]| *y > 2.9e38 && y.is_finite()), "{:?}", &y[..3]);
        assert!(y[3..5].iter().all(|[y, _]| *y > 0.0 && *y < 2e-38), "{:?}", &y[3..5]);
        assert!(y[5][0].is_nan());
        assert_eq!(y[6][0], 1.0);
    }

    #[test]
    fn fraction_is_exact() {
        let turns = turns();
        for (t, [f, _]) in turns.iter().zip(map(&turns, 2)) {
            assert_eq!(f64::from(f), f64::from(*t) - f64::from(*t).round_ties_even());
        }
    }
}
