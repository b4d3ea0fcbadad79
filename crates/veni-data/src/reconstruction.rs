//! How well a set of panoramas is reconstructed.

use std::ops::Range;

use serde::Serialize;

use crate::Result;
use crate::{Dataset, Item};
use veni_image::metrics::{self, Alignment, Scores};

/// Scores of a set of panoramas.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reconstruction {
    /// Name and scores of each panorama, in the set's order.
    pub images: Vec<(String, Scores)>,
    /// Their mean; all NaN for an empty set.
    pub mean: Scores,
}

impl Reconstruction {
    /// Compares decoded images (log radiance at exposure 0, 3·W·H values each) with the panoramas they stand
    /// for. The papers' protocol is [`Alignment::LogFactor`].
    ///
    /// # Panics
    /// If there is not one image of the set's size per panorama.
    pub fn compare(dataset: &Dataset, decoded: &[Vec<f32>], alignment: Alignment) -> Self {
        assert_eq!(dataset.len(), decoded.len(), "one decoded image per panorama");
        Self::of(rated(dataset, 0, decoded, alignment))
    }

    /// [`compare`](Self::compare) with images that `decode` makes of a range of the panoramas at a time, so that those of a
    /// large set are never all in memory. Ranges but the last are of [`PART`](Self::PART) panoramas.
    ///
    /// # Errors
    /// What `decode` says.
    ///
    /// # Panics
    /// If there is not one image of the set's size per panorama.
    pub fn by_parts(
        dataset: &Dataset,
        alignment: Alignment,
        mut decode: impl FnMut(Range<usize>) -> Result<Vec<Vec<f32>>>,
    ) -> Result<Self> {
        let mut images = Vec::with_capacity(dataset.len());
        for first in (0..dataset.len()).step_by(Self::PART) {
            let range = first..dataset.len().min(first + Self::PART);
            let decoded = decode(range.clone())?;
            assert_eq!(range.len(), decoded.len(), "one decoded image per panorama");
            images.extend(rated(dataset, first, &decoded, alignment));
        }
        Ok(Self::of(images))
    }

    /// Panoramas that [`by_parts`](Self::by_parts) decodes together.
    pub const PART: usize = 64;

    fn of(images: Vec<(String, Scores)>) -> Self {
        let mean = Scores::mean(images.iter().map(|(_, scores)| scores));
        Self { images, mean }
    }
}

/// Name and scores of the panoramas from `first` on.
fn rated(
    dataset: &Dataset,
    first: usize,
    decoded: &[Vec<f32>],
    alignment: Alignment,
) -> Vec<(String, Scores)> {
    let (width, height) = (dataset.grid().width, dataset.grid().height);
    let rate = |(item, decoded): (&Item, &Vec<f32>)| {
        (item.name(), metrics::scores(decoded, &item.log_radiance, height, width, alignment))
    };
    dataset.items()[first..].iter().zip(decoded).map(rate).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::sphere::Equirect;

    #[test]
    fn parts_are_rated_as_the_whole_is() {
        let grid = Equirect::new(32, 16);
        let value = |at: usize, v: usize| ((at * 31 + v) as f32 * 0.37).sin();
        let item = |at: usize| Item {
            path: at.to_string().into(),
            log_radiance: (0..3 * grid.len()).map(|v| value(at, v)).collect(),
            log_exposure: 0.0,
            lights: veni_light::light::Lights::default(),
            generated: false,
        };
        let set = Dataset::new(grid, (0..Reconstruction::PART + 6).map(item).collect());
        let decoded = |at: usize| (0..3 * grid.len()).map(|v| 0.9 * value(at, v) + 0.1).collect::<Vec<_>>();
        let all: Vec<_> = (0..set.len()).map(decoded).collect();
        let whole = Reconstruction::compare(&set, &all, Alignment::Exposure);
        let mut ranges = Vec::new();
        let parts = Reconstruction::by_parts(&set, Alignment::Exposure, |range| {
            ranges.push(range.clone());
            Ok(all[range].to_vec())
        });
        assert_eq!(parts.unwrap(), whole);
        assert_eq!(ranges, [0..64, 64..70]);
        // images of other panoramas are others
        let shifted = Reconstruction::by_parts(&set, Alignment::Exposure, |range| {
            Ok(range.map(|at| decoded((at + 1) % set.len())).collect())
        });
        assert_ne!(shifted.unwrap(), whole);
    }
}
