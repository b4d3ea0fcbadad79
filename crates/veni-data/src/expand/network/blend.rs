//! Where a network's radiance is used: what is clipped, and nowhere else. MODEL (63).

use super::super::CLIPPED;
use super::{Estimate, KEPT, NetworkScale};
use crate::{Error, Result};
use veni_image::tonemap::quantile;
use veni_image::{LdrPanorama, Panorama};

/// Linear values below this are noise of 8-bit coding, and tell no scale.
const NOISE: f32 = 0.01;

/// Share of the sphere that is clipped in at least one channel.
pub(super) fn clipped(ldr: &LdrPanorama) -> f64 {
    let grid = ldr.grid();
    let inside = ldr.values().iter().enumerate().filter(|(_, p)| p.iter().any(|v| *v >= CLIPPED));
    inside.fold(0.0, |sum, (k, _)| sum + grid.solid_angle(k / grid.width)) / (4.0 * std::f64::consts::PI)
}

/// The linearised panorama with what is clipped taken from `estimate`, which has the same size.
pub(super) fn blend(
    ldr: &LdrPanorama,
    mut linear: Panorama,
    estimate: &Panorama,
    name: &str,
    scale: NetworkScale,
) -> Result<(Panorama, Estimate)> {
    let factor = match scale {
        NetworkScale::White => 1.0,
        NetworkScale::Match => matching(ldr, &linear, estimate, name)?,
    };
    let (mut negative, mut used, mut clipped, mut below) = (0usize, 0usize, 0usize, 0usize);
    let stored = ldr.values().as_flattened();
    let estimated = estimate.pixels().as_flattened();
    for ((value, &v), &n) in linear.pixels_mut().as_flattened_mut().iter_mut().zip(stored).zip(estimated) {
        let a = ((v - KEPT) / (CLIPPED - KEPT)).clamp(0.0, 1.0);
        if a == 0.0 {
            continue;
        }
        used += 1;
        negative += usize::from(n < 0.0);
        let n = factor * n;
        if v >= CLIPPED {
            clipped += 1;
            below += usize::from(n < *value);
        }
        *value += a * (n - *value).max(0.0);
    }
    if negative > 0 {
        return Err(Error::invalid(format!(
            "{negative} of the {used} values that {name} gave where the image is clipped are negative, which no radiance is"
        )));
    }
    if linear.pixels().as_flattened().iter().any(|v| !v.is_finite()) {
        return Err(Error::invalid(format!(
            "what {name} gave is infinite after its scale was matched by {factor}"
        )));
    }
    Ok((linear, Estimate { factor, below: below as f64 / clipped.max(1) as f64 }))
}

/// The factor that brings the estimate to the recorded values, in the median over pixels that are far from clipping.
fn matching(ldr: &LdrPanorama, linear: &Panorama, estimate: &Panorama, name: &str) -> Result<f32> {
    let kept = ldr.values().iter().zip(linear.pixels()).zip(estimate.pixels());
    let kept = kept.filter(|((v, _), _)| v.iter().all(|v| *v <= KEPT));
    let pairs = kept.flat_map(|((_, l), n)| l.iter().zip(n));
    let ratios: Vec<f32> =
        pairs.filter(|(l, n)| **l > NOISE && **n > 0.0).map(|(l, n)| l.ln() - n.ln()).collect();
    if ratios.is_empty() {
        return Err(Error::invalid(format!(
            "no pixel that is neither clipped nor black tells the scale of what {name} gave"
        )));
    }
    let factor = quantile(&ratios, 0.5).exp();
    if !factor.is_normal() {
        return Err(Error::invalid(format!("what {name} gave would have to be multiplied by {factor}")));
    }
    Ok(factor)
}
