//! What is clipped in an LDR panorama: where, and in which regions.

use super::describe::{Region, describe};
use super::nearest::{Angles, NOWHERE, nearest_outside};
use super::regions::{OUTSIDE, label};
use super::{CLIPPED, channels};
use veni_image::{LdrPanorama, Panorama, TransferFunction};

/// An LDR panorama, linearised, and its clipped regions.
#[derive(Clone, Debug)]
pub struct Analysis {
    linear: Panorama,
    regions: Vec<Region>,
    labels: Vec<u32>,
    nearest: Vec<u32>,
    shape: Vec<f32>,
    clipped: f64,
}

impl Analysis {
    /// Finds the clipped regions and rebuilds partly clipped channels.
    pub fn new(ldr: &LdrPanorama, transfer: TransferFunction) -> Self {
        let grid = ldr.grid();
        // each channel was clipped for itself, in the primaries of the file
        let mut linear = ldr.linear_as_stored(transfer);
        let flags: Vec<[bool; 3]> = ldr.values().iter().map(|p| p.map(|v| v >= CLIPPED)).collect();
        let any: Vec<bool> = flags.iter().map(|f| f.contains(&true)).collect();
        let all: Vec<bool> = flags.iter().map(|f| !f.contains(&false)).collect();
        let clipped = (any.iter().enumerate().filter(|(_, clipped)| **clipped))
            .fold(0.0, |sum, (k, _)| sum + grid.solid_angle(k / grid.width))
            / (4.0 * std::f64::consts::PI);
        if !any.contains(&true) {
            ldr.to_rec709(&mut linear);
            return Self { linear, regions: vec![], labels: vec![], nearest: vec![], shape: vec![], clipped };
        }
        let angles = Angles::new(grid);
        channels::rebuild(&mut linear, &flags, &nearest_outside(&angles, &any));
        ldr.to_rec709(&mut linear);
        let (labels, count) = label(grid, &all);
        let nearest = nearest_outside(&angles, &all);
        let (regions, shape) = describe(&angles, &linear, &labels, count, &nearest);
        Self { linear, regions, labels, nearest, shape, clipped }
    }

    /// Linear radiance with partly clipped channels rebuilt; where all are clipped it is as stored, about 1.
    pub fn linear(&self) -> &Panorama {
        &self.linear
    }

    /// Regions that are clipped in all channels.
    pub fn regions(&self) -> &[Region] {
        &self.regions
    }

    /// Share of the sphere that is clipped in at least one channel, 0 to 1.
    pub fn clipped(&self) -> f64 {
        self.clipped
    }

    /// The pixels that are clipped in all channels: index, region, and x of the [module](super), so that the expand map
    /// is eᵖˣ.
    pub fn pixels(&self) -> impl Iterator<Item = (usize, usize, f32)> {
        let inside = self.labels.iter().enumerate().filter(|(_, label)| **label != OUTSIDE);
        inside.map(|(k, label)| (k, *label as usize, self.shape[k]))
    }

    /// The region that is taken to hold the sun: the one that reaches deepest of those above the horizon.
    pub fn sun_region(&self) -> Option<usize> {
        let above = self.regions.iter().enumerate().filter(|(_, region)| region.centre[2] > 0.0);
        above.max_by(|(_, a), (_, b)| a.radius.total_cmp(&b.radius)).map(|(k, _)| k)
    }

    /// The nearest pixel that has a channel left.
    pub(super) fn border(&self, pixel: usize) -> Option<usize> {
        Some(self.nearest[pixel]).filter(|n| *n != NOWHERE).map(|n| n as usize)
    }
}
