//! Half precision (IEEE 754 binary16) to and from f32: all that a model file asks of it, without a library for it.

/// The value of a half's bits; exact.
pub(super) fn to_f32(bits: u16) -> f32 {
    let (sign, magnitude) = (u32::from(bits & 0x8000) << 16, u32::from(bits & 0x7fff));
    let value = match magnitude {
        // zero and subnormals count in steps of 2⁻²⁴
        ..0x0400 => (magnitude as f32 * f32::from_bits(0x3380_0000)).to_bits(),
        // the exponent's offset is 15 there, 127 here
        0x0400..0x7c00 => (magnitude << 13) + ((127 - 15) << 23),
        // infinity, and what is not a number
        _ => 0x7f80_0000 | (magnitude & 0x03ff) << 13,
    };
    f32::from_bits(sign | value)
}

/// The bits of the nearest half, to even at a tie; beyond the range infinity.
pub(super) fn from_f32(value: f32) -> u16 {
    let sign = (value.to_bits() >> 16 & 0x8000) as u16;
    let magnitude = value.abs();
    let bits = magnitude.to_bits();
    sign | match bits {
        // A subnormal half: added to 0.5, whose last bit is worth 2⁻²⁴, f32 itself rounds to even.
        ..0x3880_0000 => ((magnitude + 0.5).to_bits() - 0.5_f32.to_bits()) as u16,
        // 13 bits go. Half of their worth is added, less one where the last bit that stays is even; a carry into the
        // exponent is right, up to infinity.
        0x3880_0000..0x4780_0000 => ((bits - ((127 - 15) << 23) + 0x0fff + (bits >> 13 & 1)) >> 13) as u16,
        0x4780_0000..=0x7f80_0000 => 0x7c00,
        _ => 0x7e00,
    }
}

#[cfg(test)]
mod tests {
    use half::f16;

    use super::*;

    #[test]
    fn every_half_is_read_and_written_as_it_is() {
        for bits in 0..=u16::MAX {
            let value = to_f32(bits);
            if value.is_nan() {
                assert!(f16::from_bits(bits).is_nan() && to_f32(from_f32(value)).is_nan());
                continue;
            }
            assert_eq!(value.to_bits(), f16::from_bits(bits).to_f32().to_bits(), "{bits:04x}");
            assert_eq!(from_f32(value), bits);
        }
    }

    #[test]
    fn rounding_is_that_of_the_library() {
        // around every half: its bits in f32, the middle to the next, and the neighbours of both
        for bits in 0..0x7c00_u16 {
            let (low, high) = (to_f32(bits), to_f32(bits + 1));
            let middle = if high.is_finite() { 0.5 * (low + high) } else { 65520.0 };
            for value in [low, middle] {
                for near in [value, value.next_down(), value.next_up(), -value, -value.next_up()] {
                    assert_eq!(from_f32(near), f16::from_f32(near).to_bits(), "{near:e}");
                }
            }
        }
        for value in [f32::MIN_POSITIVE, 1e-45, 65536.0, 1e9, f32::MAX, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(from_f32(value), f16::from_f32(value).to_bits(), "{value:e}");
        }
    }
}
