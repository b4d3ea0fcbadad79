//! What the numbers of a file mean: from what is stored to linear radiance with Rec. 709 primaries, in one place for all formats.
//!
//! Every reader fills a [`Meaning`] with what the tags of its file say ([`METADATA`](super::METADATA) lists them); nothing else
//! changes a value.

use std::sync::Arc;

use rayon::prelude::*;

use crate::colour::{Matrix, Primaries, convert};
use crate::tonemap::srgb_to_linear;
use crate::{Error, Result};

/// Luminance of the white of a display's range where high dynamic range is coded in cd/m² (ITU-R BT.2408-7, 2.2).
const GRAPHICS_WHITE: f32 = 203.0;
/// The HLG signal of that white (ITU-R BT.2408-7, 2.2).
const HLG_WHITE: f32 = 0.75;

/// From a stored value to a linear one.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) enum Curve {
    /// As stored.
    Linear,
    /// IEC 61966-2-1; negative values mirrored, values above 1 by the same formula.
    #[default]
    Srgb,
    /// vᵞ, negative values mirrored.
    Power(f32),
    /// SMPTE ST 2084; 203 cd/m² become 1.
    Pq,
    /// Scene light of ARIB STD-B67 (ITU-R BT.2100); a signal of 0.75 becomes 1.
    Hlg,
    /// Of an ICC profile: one table per channel over [0, 1].
    Table(Arc<[Vec<f32>; 3]>),
}

/// What the numbers of a file mean: curve, then factors, then primaries.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Meaning {
    pub(crate) curve: Curve,
    /// Multiplies linear red, green and blue of the file.
    pub(crate) factors: Option<[f32; 3]>,
    /// To Rec. 709, unless they are that.
    pub(crate) matrix: Option<Matrix>,
    /// What the file says besides, in sentences.
    pub(crate) notes: Vec<String>,
}

impl Curve {
    /// One value of channel `channel`.
    pub(crate) fn linear(&self, channel: usize, value: f32) -> f32 {
        match self {
            Self::Linear => value,
            Self::Srgb if value >= 0.0 => srgb_to_linear(value),
            Self::Srgb => -srgb_to_linear(-value),
            Self::Power(gamma) => value.abs().powf(*gamma).copysign(value),
            Self::Pq => pq(value),
            Self::Hlg => hlg(value) / hlg(HLG_WHITE),
            Self::Table(tables) => lookup(&tables[channel], value),
        }
    }

    /// Whether its largest value is far above the white of a display.
    pub(crate) fn is_high(&self) -> bool {
        matches!(self, Self::Pq | Self::Hlg)
    }
}

impl Meaning {
    /// Of a format whose values are linear Rec. 709 unless it says otherwise.
    pub(crate) fn linear() -> Self {
        Self { curve: Curve::Linear, ..Self::default() }
    }

    /// Other primaries.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the `tag` that says so if they span no colour space.
    pub(crate) fn primaries(&mut self, primaries: Primaries, tag: &str) -> Result<()> {
        self.matrix = primaries.colorimetric().map_err(|e| Error::invalid(format!("{tag}: {e}")))?;
        Ok(())
    }

    /// Adds a sentence.
    pub(crate) fn note(&mut self, sentence: impl Into<String>) {
        self.notes.push(sentence.into());
    }

    /// Stored values to linear Rec. 709, in place.
    pub(crate) fn apply(&self, pixels: &mut [[f32; 3]]) {
        self.linearise(&self.curve, pixels);
        self.to_rec709(pixels);
    }

    /// The first half: linear in the primaries of the file.
    pub(crate) fn linearise(&self, curve: &Curve, pixels: &mut [[f32; 3]]) {
        let factors = self.factors.unwrap_or([1.0; 3]);
        if *curve == Curve::Linear && factors == [1.0; 3] {
            return;
        }
        pixels.par_iter_mut().with_min_len(1 << 12).for_each(|pixel| {
            for (channel, value) in pixel.iter_mut().enumerate() {
                *value = curve.linear(channel, *value) * factors[channel];
            }
        });
    }

    /// The second half.
    pub(crate) fn to_rec709(&self, pixels: &mut [[f32; 3]]) {
        if let Some(matrix) = &self.matrix {
            pixels.par_iter_mut().with_min_len(1 << 12).for_each(|pixel| *pixel = convert(matrix, *pixel));
        }
    }
}

/// ST 2084, equation 4.1, in units of [`GRAPHICS_WHITE`].
fn pq(value: f32) -> f32 {
    const M1: f64 = 2610.0 / 16384.0;
    const M2: f64 = 2523.0 / 4096.0 * 128.0;
    const C1: f64 = 3424.0 / 4096.0;
    const C2: f64 = 2413.0 / 4096.0 * 32.0;
    const C3: f64 = 2392.0 / 4096.0 * 32.0;
    let power = f64::from(value.clamp(0.0, 1.0)).powf(1.0 / M2);
    let luminance = ((power - C1).max(0.0) / (C2 - C3 * power)).powf(1.0 / M1);
    (luminance * 10_000.0 / f64::from(GRAPHICS_WHITE)) as f32
}

/// The inverse of the camera's curve in BT.2100, table 5: scene light from 0 to 1.
fn hlg(value: f32) -> f32 {
    const A: f64 = 0.178_832_77;
    const B: f64 = 1.0 - 4.0 * A;
    let c = 0.5 - A * (4.0 * A).ln();
    let signal = f64::from(value.max(0.0));
    let light = if signal <= 0.5 { signal * signal / 3.0 } else { (((signal - c) / A).exp() + B) / 12.0 };
    light as f32
}

/// Linear between the entries.
fn lookup(table: &[f32], value: f32) -> f32 {
    let at = value.clamp(0.0, 1.0) * (table.len() - 1) as f32;
    let low = (at as usize).min(table.len() - 1);
    let high = (low + 1).min(table.len() - 1);
    table[low] + (at - low as f32) * (table[high] - table[low])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_meet_the_values_of_their_standards() {
        // BT.2408: 58 % of PQ is 203 cd/m², 100 % is 10,000; 75 % of HLG is the same white, 50 % is 1/12 of its peak
        assert!((pq(0.580_689) - 1.0).abs() < 1e-4, "{}", pq(0.580_689));
        assert!((pq(1.0) - 10_000.0 / 203.0).abs() < 1e-3 && pq(0.0) == 0.0);
        assert!((Curve::Hlg.linear(0, 0.75) - 1.0).abs() < 1e-6);
        assert!((hlg(0.5) - 1.0 / 12.0).abs() < 1e-6 && (hlg(1.0) - 1.0).abs() < 1e-5);
        assert_eq!(Curve::Srgb.linear(0, -0.5), -srgb_to_linear(0.5));
        assert_eq!(Curve::Power(2.0).linear(0, -3.0), -9.0);
    }
}
