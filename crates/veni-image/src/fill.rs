//! What is unknown, from its surroundings (push-pull: Gortler et al., "The Lumigraph", SIGGRAPH 1996).

use crate::panorama::Panorama;

/// Less of a pixel, and it counts as unknown.
const HALF: f32 = 0.5;

/// A panorama of half the size: radiance × known summed over four pixels, and known.
struct Level {
    width: usize,
    height: usize,
    sums: Vec<[f32; 4]>,
}

impl Level {
    fn half(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut sums = vec![[0f32; 4]; width * height];
        for (at, sum) in self.sums.iter().enumerate() {
            let (x, y) = (at % self.width, at / self.width);
            let into = &mut sums[y / 2 * width + x / 2];
            into.iter_mut().zip(sum).for_each(|(a, b)| *a += b);
        }
        // known as a whole is no more than known
        for sum in &mut sums {
            let weight = sum[3].max(1.0);
            *sum = sum.map(|v| v / weight);
        }
        Self { width, height, sums }
    }

    /// Adds what is missing from the level above, whose pixels are all known.
    fn complete(&mut self, above: &Self) {
        for (at, sum) in self.sums.iter_mut().enumerate() {
            let (x, y) = (at % self.width, at / self.width);
            let (missing, coarse) = (1.0 - sum[3], above.sums[y / 2 * above.width + x / 2]);
            sum.iter_mut().zip(coarse).for_each(|(a, b)| *a += missing * b);
        }
    }
}

impl Panorama {
    /// Gives every pixel of which less than half is known the radiance of what is known around it and of itself, as far as that goes.
    /// Returns the share that was [unknown](Panorama::unknown); nothing is changed where nothing is known at all.
    pub fn fill(&mut self) -> f64 {
        let share = self.unknown();
        let Some(known) = self.known.take() else { return share };
        let finite = |pixel: &[f32; 3]| pixel.iter().all(|v| v.is_finite());
        let sum = |(pixel, known): (&[f32; 3], &f32)| {
            let [r, g, b] = *pixel;
            if *known > 0.0 && finite(pixel) { [r * known, g * known, b * known, *known] } else { [0.0; 4] }
        };
        let sums = self.pixels.iter().zip(&known).map(sum).collect();
        let mut levels = vec![Level { width: self.grid.width, height: self.grid.height, sums }];
        while let Some(last) = levels.last().filter(|level| level.sums.len() > 1) {
            levels.push(last.half());
        }
        let Some(mut above) = levels.pop() else { return share };
        let whole = above.sums[0];
        if whole[3] <= 0.0 {
            self.known = Some(known);
            return share;
        }
        above.sums[0] = whole.map(|v| v / whole[3]);
        while let Some(mut level) = levels.pop() {
            level.complete(&above);
            above = level;
        }
        for ((pixel, known), [r, g, b, _]) in self.pixels.iter_mut().zip(&known).zip(&above.sums) {
            if *known < HALF {
                *pixel = [*r, *g, *b];
            }
        }
        share
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_light::sphere::Equirect;

    #[test]
    fn holes_take_the_radiance_around_them_and_nothing_else_changes() {
        let grid = Equirect::new(32, 16);
        let truth = Panorama::from_fn(grid, |[_, _, z]| [3.0 + z, 2.0 + z, 1.5 + z]);
        let mut holed = truth.clone();
        let hole = |at: usize| (5..8).contains(&(at / 32)) && (10..14).contains(&(at % 32));
        let known: Vec<f32> = (0..512).map(|at| if hole(at) { 0.0 } else { 1.0 }).collect();
        (0..512).filter(|at| hole(*at)).for_each(|at| holed.pixels[at] = [0.0; 3]);
        holed.known = Some(known);
        assert_eq!(holed.fill(), 12.0 / 512.0);
        assert!(holed.known().is_none());
        for (at, (a, b)) in holed.pixels().iter().zip(truth.pixels()).enumerate() {
            let off = a.iter().zip(b).fold(0f32, |m, (a, b)| m.max((a - b).abs()));
            assert!(if hole(at) { off < 0.6 } else { off == 0.0 }, "{at}: {a:?} for {b:?}");
        }
        let mut blind = Panorama { known: Some(vec![0.0; 512]), ..truth.clone() };
        assert_eq!((blind.fill(), blind.unknown()), (1.0, 1.0));
        assert_eq!(blind.pixels(), truth.pixels());
    }
}
