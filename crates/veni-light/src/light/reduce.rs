//! Fewer pixels, the same light: mean radiance over the solid angle of 2 × 2 pixels.

use std::sync::Arc;

use super::EnvironmentMap;
use crate::sphere::Equirect;

/// A map, or a smaller one of the same light.
#[derive(Clone, Debug)]
pub(super) struct Reduced<'a> {
    map: EnvironmentMap<'a>,
    /// Shared by clones.
    halved: Option<Arc<(Equirect, Vec<[f32; 3]>)>>,
}

impl<'a> Reduced<'a> {
    /// The map halved as often as it can be without falling below `width` columns; odd sides end it.
    pub(super) fn to_width(map: EnvironmentMap<'a>, width: usize) -> Self {
        Self::below(map, width, [f32::INFINITY; 3])
    }

    /// The same of the map's radiance up to a ceiling; a map that is not halved keeps what is above.
    pub(super) fn below(map: EnvironmentMap<'a>, width: usize, ceiling: [f32; 3]) -> Self {
        let mut halved: Option<(Equirect, Vec<[f32; 3]>)> = None;
        loop {
            let (grid, pixels) =
                halved.as_ref().map_or((map.grid(), map.pixels()), |(grid, pixels)| (*grid, pixels));
            if grid.width / 2 < width || grid.width % 2 == 1 || grid.height % 2 == 1 {
                return Self { map, halved: halved.map(Arc::new) };
            }
            halved = Some(half(grid, pixels, ceiling));
        }
    }

    pub(super) fn map(&self) -> EnvironmentMap<'_> {
        match self.halved.as_deref() {
            Some((grid, pixels)) => EnvironmentMap::trusted(*grid, pixels),
            None => self.map,
        }
    }
}

fn half(grid: Equirect, pixels: &[[f32; 3]], ceiling: [f32; 3]) -> (Equirect, Vec<[f32; 3]>) {
    let small = Equirect::new(grid.width / 2, grid.height / 2);
    let mut out = Vec::with_capacity(small.len());
    for (j, rows) in pixels.chunks_exact(2 * grid.width).enumerate() {
        let (top, bottom) = (grid.solid_angle(2 * j), grid.solid_angle(2 * j + 1));
        let [u, v] = [top, bottom].map(|w| (0.5 * w / (top + bottom)) as f32);
        let (upper, lower) = rows.split_at(grid.width);
        let pairs = upper.as_chunks::<2>().0.iter().zip(lower.as_chunks::<2>().0);
        out.extend(pairs.map(|([a, b], [c, d])| {
            [0, 1, 2].map(|k| {
                let [a, b, c, d] = [a, b, c, d].map(|p| p[k].min(ceiling[k]));
                u * (a + b) + v * (c + d)
            })
        }));
    }
    (small, out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smaller_map_holds_the_same_light() {
        let grid = Equirect::new(64, 32);
        let pixels: Vec<[f32; 3]> = (0..grid.len()).map(|k| [(k % 7) as f32, (k / 64) as f32, 1.0]).collect();
        let map = EnvironmentMap::new(grid, &pixels).unwrap();
        let reduced = Reduced::to_width(map, 9);
        assert_eq!(reduced.map().grid(), Equirect::new(16, 8));
        for (a, b) in map.integral().into_iter().zip(reduced.map().integral()) {
            assert!((a - b).abs() < 1e-5 * a, "{a} became {b}");
        }
        assert_eq!(Reduced::to_width(map, 33).map().grid(), grid);
    }
}
