//! Connected regions of a mask on the sphere: eight neighbours, across the seam and over the poles.

use veni_light::sphere::Equirect;

/// The label of pixels outside the mask.
pub(super) const OUTSIDE: u32 = u32::MAX;

/// Labels 0, 1, … of the mask's regions in the order of their first pixel, [`OUTSIDE`] elsewhere; and how many.
pub(super) fn label(grid: Equirect, mask: &[bool]) -> (Vec<u32>, usize) {
    let Equirect { width, height } = grid;
    let mut parents: Vec<u32> = (0..grid.len() as u32).collect();
    for row in 0..height {
        for column in 0..width {
            let here = row * width + column;
            if !mask[here] {
                continue;
            }
            let mut join = |there: usize| {
                if mask[there] {
                    union(&mut parents, here as u32, there as u32);
                }
            };
            join(row * width + (column + 1) % width);
            if row == 0 || row == height - 1 {
                join(row * width + (column + width / 2) % width);
            }
            if row + 1 < height {
                for side in [width - 1, 0, 1] {
                    join((row + 1) * width + (column + side) % width);
                }
            }
        }
    }
    let mut names = vec![OUTSIDE; grid.len()];
    let mut labels = vec![OUTSIDE; grid.len()];
    let mut count = 0;
    for pixel in (0..grid.len()).filter(|p| mask[*p]) {
        let root = find(&mut parents, pixel as u32) as usize;
        if names[root] == OUTSIDE {
            names[root] = count;
            count += 1;
        }
        labels[pixel] = names[root];
    }
    (labels, count as usize)
}

/// The representative of a set, its path halved on the way.
fn find(parents: &mut [u32], mut at: u32) -> u32 {
    while parents[at as usize] != at {
        let above = parents[parents[at as usize] as usize];
        parents[at as usize] = above;
        at = above;
    }
    at
}

fn union(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(parents, a), find(parents, b));
    // the smaller index stays, so that labels do not depend on the order of unions
    parents[a.max(b) as usize] = a.min(b);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_cross_the_seam_and_the_poles() {
        let grid = Equirect::new(8, 4);
        let pixels = |at: &[(usize, usize)]| {
            let mut mask = vec![false; grid.len()];
            at.iter().for_each(|(column, row)| mask[row * 8 + column] = true);
            mask
        };
        for (at, count) in [
            (&[(0, 1), (7, 2)][..], 1),
            (&[(1, 0), (5, 0)], 1),
            (&[(1, 3), (5, 3)], 1),
            (&[(1, 1), (5, 1)], 2),
            (&[(2, 1), (3, 2), (6, 2)], 2),
            (&[], 0),
        ] {
            assert_eq!(label(grid, &pixels(at)).1, count, "{at:?}");
        }
        let (labels, _) = label(grid, &pixels(&[(2, 1), (3, 2), (6, 2)]));
        assert_eq!((labels[10], labels[19], labels[22], labels[0]), (0, 0, 1, OUTSIDE));
    }
}
