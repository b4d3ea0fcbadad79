//! Panoramas of limited range: PNG, JPEG, WebP and AVIF, as the display values that are stored.

use super::meaning::{Curve, Meaning};
use crate::panorama::{Panorama, unknown_share};
use crate::tonemap::srgb_to_linear;
use veni_light::sphere::Equirect;

/// A panorama of limited dynamic range: display values in [0, 1], as an 8- or 16-bit file has them, row-major.
/// They become radiance by [`LdrPanorama::linear`], or with what is clipped rebuilt by
/// veni-data.
#[derive(Clone, Debug, PartialEq)]
pub struct LdrPanorama {
    pub(super) grid: Equirect,
    pub(crate) values: Vec<[f32; 3]>,
    /// How much of every pixel is known, 0 to 1, where the file hides any.
    pub(crate) known: Option<Vec<f32>>,
    /// What the values mean.
    pub(super) meaning: Meaning,
}

/// How display values become linear ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum TransferFunction {
    /// As the file says; where it says nothing, by the sRGB curve (IEC 61966-2-1). The default.
    #[default]
    Srgb,
    /// A power, whatever the file says: v^γ.
    Gamma(f32),
}

impl TransferFunction {
    /// One display value in [0, 1] to a linear one in [0, 1].
    pub fn linear(self, value: f32) -> f32 {
        match self {
            Self::Srgb => srgb_to_linear(value),
            Self::Gamma(gamma) => value.powf(gamma),
        }
    }
}

impl LdrPanorama {
    /// A panorama from row-major display values, clamped to [0, 1].
    ///
    /// # Panics
    /// If there are not exactly W·H pixels.
    pub fn new(grid: Equirect, values: Vec<[f32; 3]>) -> Self {
        let Equirect { width, height } = grid;
        assert_eq!(values.len(), grid.len(), "a {width} × {height} panorama got {} pixels", values.len());
        let values = values.into_iter().map(|p| p.map(|v| v.clamp(0.0, 1.0))).collect();
        Self { grid, values, known: None, meaning: Meaning::default() }
    }

    /// The pixel grid.
    pub fn grid(&self) -> Equirect {
        self.grid
    }

    /// Display values in [0, 1], row-major.
    pub fn values(&self) -> &[[f32; 3]] {
        &self.values
    }

    /// Share of the pixels (0 to 1) of which less than half is known: transparent, or outside of the part that the file holds.
    pub fn unknown(&self) -> f64 {
        unknown_share(self.known.as_deref())
    }

    /// How much of every pixel is known, 0 to 1; `None` if all of all.
    pub fn known(&self) -> Option<&[f32]> {
        self.known.as_deref()
    }

    /// What the file says that is not applied, or is worth knowing; sentences without the file's name.
    pub fn notes(&self) -> &[String] {
        &self.meaning.notes
    }

    /// Whether the values are coded by the sRGB curve with Rec. 709 primaries.
    pub fn is_srgb(&self) -> bool {
        self.meaning.curve == Curve::Srgb && self.meaning.matrix.is_none()
    }

    /// What the values are, in words: curve and primaries.
    pub fn coding(&self) -> String {
        let curve = match &self.meaning.curve {
            Curve::Linear => "linear".to_owned(),
            Curve::Srgb => "sRGB curve".to_owned(),
            Curve::Power(gamma) => format!("power of {gamma:.3}"),
            Curve::Pq => "PQ".to_owned(),
            Curve::Hlg => "HLG".to_owned(),
            Curve::Table(_) => "curve of an ICC profile".to_owned(),
        };
        let primaries = if self.meaning.matrix.is_some() {
            "other primaries than Rec. 709"
        } else {
            "Rec. 709 primaries"
        };
        format!("{curve}, {primaries}")
    }

    /// The least linear value that `value` of any channel becomes.
    pub(crate) fn linear_value(&self, value: f32) -> f32 {
        (0..3).map(|channel| self.meaning.curve.linear(channel, value)).fold(f32::INFINITY, f32::min)
    }

    /// Plain linearisation, as the file says: white is radiance 1, and so is everything that was brighter.
    pub fn linear(&self, transfer: TransferFunction) -> Panorama {
        let mut panorama = self.linear_as_stored(transfer);
        self.to_rec709(&mut panorama);
        panorama
    }

    /// [`LdrPanorama::linear`] in the primaries of the file, in which each channel was clipped for itself.
    pub fn linear_as_stored(&self, transfer: TransferFunction) -> Panorama {
        let mut panorama = Panorama::new(self.grid, self.values.clone());
        let curve = match transfer {
            TransferFunction::Srgb => &self.meaning.curve,
            TransferFunction::Gamma(gamma) => &Curve::Power(gamma),
        };
        self.meaning.linearise(curve, panorama.pixels_mut());
        panorama.known.clone_from(&self.known);
        panorama.notes.clone_from(&self.meaning.notes);
        panorama
    }

    /// From the primaries of the file to Rec. 709.
    pub fn to_rec709(&self, panorama: &mut Panorama) {
        self.meaning.to_rec709(panorama.pixels_mut());
    }
}
