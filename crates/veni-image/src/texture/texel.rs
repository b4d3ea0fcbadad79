//! Radiance in four or eight bytes.

use half::f16;

use crate::{Error, Result};

/// How a texel is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelFormat {
    /// Three mantissas of 9 bits and a shared exponent, 4 bytes; up to 65408, without sign.
    E5B9G9R9,
    /// Floats of 11, 11 and 10 bits, 4 bytes; up to 64512, without sign.
    R11G11B10,
    /// Four halves, alpha 1; up to 65504.
    Rgba16F,
}

impl TexelFormat {
    /// Bytes of a texel.
    pub fn bytes(self) -> usize {
        if self == Self::Rgba16F { 8 } else { 4 }
    }

    /// The largest value of every channel.
    pub fn largest(self) -> f32 {
        match self {
            Self::E5B9G9R9 => 65408.0,
            Self::R11G11B10 => 64512.0,
            Self::Rgba16F => 65504.0,
        }
    }

    /// Texels as little-endian bytes.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a value that is negative, not finite, or beyond [`TexelFormat::largest`].
    pub fn encode(self, texels: &[[f32; 3]]) -> Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(texels.len() * self.bytes());
        for (k, texel) in texels.iter().enumerate() {
            if !texel.iter().all(|v| (0.0..=self.largest()).contains(v)) {
                return Err(Error::invalid(format!(
                    "texel {k} is {texel:?}: {self:?} holds 0 to {}",
                    self.largest()
                )));
            }
            match self {
                Self::E5B9G9R9 => bytes.extend(e5b9g9r9(*texel).to_le_bytes()),
                Self::R11G11B10 => bytes.extend(r11g11b10(*texel).to_le_bytes()),
                Self::Rgba16F => {
                    for v in [texel[0], texel[1], texel[2], 1.0] {
                        bytes.extend(f16::from_f32(v).to_le_bytes());
                    }
                }
            }
        }
        Ok(bytes)
    }
}

/// The exponent that lets the largest of three mantissas use all nine bits, then each rounded to it.
fn e5b9g9r9(texel: [f32; 3]) -> u32 {
    let largest = texel.into_iter().fold(0f32, f32::max);
    // 2^−15 is the least exponent
    let mut exponent = if largest > 0.0 { (largest.log2().floor() as i32).max(-16) + 1 } else { -15 };
    if (largest / (exponent as f32 - 9.0).exp2()).round() > 511.0 {
        exponent += 1;
    }
    let scale = (9.0 - exponent as f32).exp2();
    let [r, g, b] = texel.map(|v| ((v * scale).round() as u32).min(511));
    ((exponent + 15) as u32) << 27 | b << 18 | g << 9 | r
}

/// Floats with five bits of exponent, as half has them, and six or five of mantissa, rounded to the nearest.
fn r11g11b10([r, g, b]: [f32; 3]) -> u32 {
    let float = |v: f32, bits: u32| {
        let drop = 10 - bits;
        // half's order of bits is the order of values: rounding carries into the exponent as it should
        let half = u32::from(f16::from_f32(v).to_bits());
        ((half + (1 << (drop - 1))) >> drop).min((31 << bits) - 1)
    };
    float(b, 5) << 22 | float(g, 6) << 11 | float(r, 6)
}

/// A texel of [`TexelFormat::E5B9G9R9`].
#[cfg(test)]
pub(crate) fn decode_e5b9g9r9(bits: u32) -> [f32; 3] {
    let scale = ((bits >> 27) as f32 - 15.0 - 9.0).exp2();
    [0, 9, 18].map(|shift| ((bits >> shift) & 511) as f32 * scale)
}

/// A texel of [`TexelFormat::R11G11B10`].
#[cfg(test)]
pub(crate) fn decode_r11g11b10(bits: u32) -> [f32; 3] {
    let half = |v: u32, bits: u32| f16::from_bits((v << (10 - bits)) as u16).to_f32();
    [half(bits & 2047, 6), half(bits >> 11 & 2047, 6), half(bits >> 22, 5)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_survive_to_the_formats_precision() {
        let values = (-60..64).map(|k| (k as f32 / 4.0).exp2()).chain([65024.0, 1.0, 0.999, 511.4, 0.3]);
        for v in values {
            let texel = [v, 0.5 * v, 0.26 * v];
            let largest = v.max(2f32.powi(-15));
            for (a, b) in decode_e5b9g9r9(e5b9g9r9(texel)).into_iter().zip(texel) {
                assert!((a - b).abs() <= largest / 511.0, "{b} became {a}");
            }
            if v < 64000.0 {
                for ((a, b), bits) in decode_r11g11b10(r11g11b10(texel)).into_iter().zip(texel).zip([6, 6, 5])
                {
                    let step = b.max(2f32.powi(-14)) / (1 << bits) as f32;
                    assert!((a - b).abs() <= 0.51 * step, "{b} became {a} in {bits} bits");
                }
            }
        }
        assert_eq!(decode_e5b9g9r9(e5b9g9r9([0.0; 3])), [0.0; 3]);
        assert_eq!(decode_e5b9g9r9(e5b9g9r9([65408.0; 3])), [65408.0; 3]);
        assert_eq!(decode_r11g11b10(r11g11b10([64512.0, 0.0, 64512.0])), [64512.0, 0.0, 64512.0]);
        // what a graphics API's documentation gives for white
        assert_eq!(r11g11b10([1.0; 3]), 0x781e_03c0);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        for format in [TexelFormat::E5B9G9R9, TexelFormat::R11G11B10, TexelFormat::Rgba16F] {
            for bad in [-1.0, f32::NAN, f32::INFINITY, 66000.0] {
                assert!(format.encode(&[[1.0, bad, 1.0]]).unwrap_err().to_string().contains("texel 0"));
            }
            assert_eq!(format.encode(&[[1.0; 3]; 5]).unwrap().len(), 5 * format.bytes());
        }
    }
}
