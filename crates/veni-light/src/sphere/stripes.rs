//! Where the encoder looks: stripes of meridians, equal-area heights. MODEL (12).

use std::f64::consts::PI;

use super::gather::{clamped, wrapped};
use super::{Equirect, Gather, reference};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Where the encoder looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StripeSampling {
    /// Meridians and heights at cell centres, wrapped seam: exactly equivariant under whole stripes.
    Exact,
    /// The reference implementation's grid (both ends doubled, unwrapped seam), for their weights.
    Reference,
}

/// T stripes of P samples each: the encoder's T tokens of P channels.
///
/// The sphere is cut into w meridians of h samples, h = √(T·P/2), w = 2h. Stripe p holds the w/T meridians
/// a = p·w/T …, and sample a'·h + b of a stripe is height b of its meridian a'. Azimuths increase with a,
/// starting at +y (π/2), heights with b, from −z to +z.
///
/// - [`StripeSampling::Exact`]: meridians at azimuth π/2 + 2π(a+½)/w, heights z = −1 + 2(b+½)/h, the centres of cells
///   of equal area. Images are looked up by these parameters, with wrapped columns and clamped rows: rolling an
///   image by a whole number of stripes permutes the stripes and changes no bit, provided that T divides its width.
/// - [`StripeSampling::Reference`]: the reference's grid ([`reference::line_directions`]), for their weights: first
///   and last meridian coincide, both poles are sampled, the seam is not wrapped.
#[derive(Clone, Debug, PartialEq)]
pub struct Stripes {
    stripes: usize,
    samples: usize,
    heights: usize,
    sampling: StripeSampling,
}

impl Stripes {
    /// T stripes of P samples.
    ///
    /// # Errors
    /// [`Error::Invalid`] unless T·P/2 is a square h² and T divides 2h.
    pub fn new(stripes: usize, samples: usize, sampling: StripeSampling) -> Result<Self> {
        let refuse = |why: String| {
            Err(Error::invalid(format!("{stripes} stripes of {samples} samples cannot be laid out: {why}")))
        };
        let Some(total) = stripes.checked_mul(samples).filter(|&n| n > 0 && n <= 1 << 24) else {
            return refuse("their product must be between 1 and 16,777,216".into());
        };
        let heights = (total / 2).isqrt();
        if 2 * heights * heights != total {
            return refuse(format!("half their product, {}, is not a square", total as f64 / 2.0));
        }
        if !(2 * heights).is_multiple_of(stripes) {
            return refuse(format!("{} meridians are not a multiple of {stripes}", 2 * heights));
        }
        Ok(Self { stripes, samples, heights, sampling })
    }

    /// T, the number of stripes.
    pub fn stripes(&self) -> usize {
        self.stripes
    }

    /// P, samples per stripe.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Unit native directions, [T, P] row-major.
    pub fn directions(&self) -> Vec<[f32; 3]> {
        if self.sampling == StripeSampling::Reference {
            let lines = reference::line_directions(self.stripes, self.samples);
            return lines.into_iter().map(reference::encoder_to_native).collect();
        }
        let mut out = Vec::with_capacity(self.stripes * self.samples);
        for a in 0..2 * self.heights {
            let (sin_p, cos_p) = (0.5 * PI + PI * (a as f64 + 0.5) / self.heights as f64).sin_cos();
            out.extend((0..self.heights).map(|b| {
                let z = self.height(b);
                let radius = (1.0 - z * z).sqrt();
                [(radius * cos_p) as f32, (radius * sin_p) as f32, z as f32]
            }));
        }
        out
    }

    /// The lookup table for images of `grid`; make it once, use it for every image.
    pub fn gather(&self, grid: Equirect) -> Gather {
        self.gather_rotated(grid, 0.0)
    }

    /// The lookup table that sees every image of `grid` rotated by `yaw` radians about +z, counter-clockwise seen
    /// from above: colours are those of the rotated panorama, directions stay.
    pub fn gather_rotated(&self, grid: Equirect, yaw: f64) -> Gather {
        let mut table = Gather::with_capacity(grid, self.stripes * self.samples);
        if self.sampling == StripeSampling::Reference {
            for e in reference::line_directions(self.stripes, self.samples) {
                let (columns, rows) = reference::pairs(reference::image_uv(rotated(e, yaw)), grid);
                table.push(columns, rows);
            }
            return table;
        }
        // Column index of meridian a: W/4 − W(a+½)/w − ½, as an exact fraction over 4w so that meridians a whole
        // number of pixels apart get the same bits.
        let (width, meridians) = (grid.width as i64, 2 * self.heights as i64);
        let shift = yaw / (2.0 * PI) * grid.width as f64;
        let rows: Vec<_> = (0..self.heights)
            .map(|b| clamped(self.height(b).acos() / PI * grid.height as f64 - 0.5, grid.height))
            .collect();
        for a in 0..meridians {
            let (over, under) = (width * (meridians - 4 * a - 2) - 2 * meridians, 4 * meridians);
            let whole = over.div_euclid(under).rem_euclid(width) as f64;
            let fraction = over.rem_euclid(under) as f64 / under as f64;
            let columns = if shift == 0.0 {
                let cell = whole as usize;
                super::gather::Pair::new(cell, (cell + 1) % grid.width, fraction)
            } else {
                wrapped(whole + (fraction + shift), grid.width)
            };
            rows.iter().for_each(|&row| table.push(columns, row));
        }
        table
    }

    /// The values of a row-major image at all samples, [T, P] row-major. The encoder wants log radiance
    /// (ln radiance). For many images of one size use [`Stripes::gather`].
    ///
    /// # Panics
    /// If the image does not have W·H pixels.
    pub fn sample(&self, image: &[[f32; 3]], grid: Equirect) -> Vec<[f32; 3]> {
        self.gather(grid).sample(image)
    }

    /// z of height b of the exact grid.
    fn height(&self, b: usize) -> f64 {
        (2 * b + 1) as f64 / self.heights as f64 - 1.0
    }
}

/// An encoder direction rotated by [[cos, sin, 0], [−sin, cos, 0], [0, 0, 1]]: what is seen rotates the other way.
/// A yaw of zero keeps every bit, signed zeros included.
fn rotated([x, y, z]: [f32; 3], yaw: f64) -> [f32; 3] {
    if yaw == 0.0 {
        return [x, y, z];
    }
    let (sin, cos) = (yaw as f32).sin_cos();
    // The reference implementation's product with a 3 × 3 matrix adds a zero from the third column, and any zero sum of
    // theirs is positive. At the poles the sign decides which column is read.
    [cos * x + sin * y + 0.0, cos * y - sin * x + 0.0, z]
}
