//! Where to look: the brightest pixel, and at every scale the cap that exceeds its surroundings most.

use std::f64::consts::PI;

use super::level::View;
use crate::luminance::luminance;
use crate::tasks;

/// Radii of the caps, degrees.
const RADII: [f64; 4] = [2.5, 5.0, 10.0, 20.0];

/// Directions of candidates: the brightest cell of `fine`, and per scale the cap of `coarse` with the greatest excess over the
/// mean of its ring.
pub(super) fn seeds(fine: View<'_>, coarse: View<'_>) -> Vec<[f64; 3]> {
    let mut seeds: Vec<_> = brightest(fine).into_iter().collect();
    let sums = Sums::new(coarse);
    let radii = RADII.map(f64::to_radians);
    let wide = radii.into_iter().filter(|radius| *radius >= 1.5 * coarse.level().cell_angle());
    for radius in wide {
        let rows = (0..coarse.level().height()).collect::<Vec<_>>();
        let best = tasks::map(rows.into_iter(), || (), |(), row| sums.best_of_row(coarse, row, radius));
        let best = best.into_iter().flatten().reduce(|a, b| if b.0 > a.0 { b } else { a });
        seeds.extend(best.map(|(_, index)| coarse.cell(index).direction));
    }
    seeds
}

/// The cell of the greatest luminance.
fn brightest(view: View<'_>) -> Option<[f64; 3]> {
    let rows = view.cells().chunks(view.level().width()).enumerate();
    let of_row = |(row, cells): (usize, &[[f32; 3]])| {
        let mut best = (0.0, 0);
        for (column, cell) in cells.iter().enumerate() {
            let y = luminance(*cell);
            if y > best.0 {
                best = (y, row * cells.len() + column);
            }
        }
        best
    };
    let best = tasks::map(rows, || (), |(), row| of_row(row));
    let best = best.into_iter().reduce(|a, b| if b.0 > a.0 { b } else { a })?;
    (best.0 > 0.0).then(|| view.cell(best.1).direction)
}

/// Per row the running sums of luminance over two rounds, so that a cap's part of a row is one difference.
struct Sums {
    /// Luminance, `[row, column]`, from 0 to 2W.
    running: Vec<f64>,
    width: usize,
}

impl Sums {
    fn new(view: View<'_>) -> Self {
        let width = view.level().width();
        let mut running = Vec::with_capacity(view.level().height() * (2 * width + 1));
        for row in view.cells().chunks(width) {
            let mut sum = 0.0;
            running.push(0.0);
            for cell in row.iter().chain(row) {
                sum += f64::from(luminance(*cell));
                running.push(sum);
            }
        }
        Self { running, width }
    }

    /// The cap about a cell of this row with the greatest excess: that, and its index.
    fn best_of_row(&self, view: View<'_>, row: usize, radius: f64) -> Option<(f64, usize)> {
        let level = view.level();
        // the columns of a cap are the same for every cell of the row, but for a shift
        let first = view.cell(row * self.width).direction;
        let spans = |radius: f64| {
            let rows = level.cap_rows(first, radius);
            rows.map(|r| {
                let (start, count) = level.cap_columns(r, first, radius);
                (
                    r * (2 * self.width + 1),
                    start.rem_euclid(self.width as isize) as usize,
                    count,
                    level.area(r),
                )
            })
            .filter(|span| span.2 > 0)
            .collect::<Vec<_>>()
        };
        let (inner, outer) = (spans(radius), spans(2.0 * radius));
        let area = |spans: &[(usize, usize, usize, f64)]| spans.iter().map(|s| s.3 * s.2 as f64).sum::<f64>();
        let (inner_area, outer_area) = (area(&inner), area(&outer));
        if inner_area <= 0.0 || outer_area <= inner_area * 1.01 || outer_area > 3.0 * PI {
            return None;
        }
        let share = inner_area / (outer_area - inner_area);
        let (cap, outer) = (self.sums(&inner), self.sums(&outer));
        let best = cap.iter().zip(&outer).map(|(cap, outer)| cap - share * (outer - cap));
        let best = best.zip(0..);
        let best = best.reduce(|a, b| if b.0 > a.0 { b } else { a })?;
        (best.0 > 0.0).then_some((best.0, row * self.width + best.1))
    }

    /// The sum over these spans, shifted by every column of a row: span by span, so that neighbouring columns read neighbouring
    /// numbers.
    fn sums(&self, spans: &[(usize, usize, usize, f64)]) -> Vec<f64> {
        let mut sums = vec![0.0; self.width];
        pulp::Arch::new().dispatch(|| {
            for &(at, start, count, area) in spans {
                let row = &self.running[at..=at + 2 * self.width];
                // beyond the last column it begins again at the first
                let (before, beyond) = sums.split_at_mut(self.width - start);
                add_differences(before, &row[start..], count, area);
                add_differences(beyond, row, count, area);
            }
        });
        sums
    }
}

/// Adds the sum of `count` cells from each place on, times `area`.
#[inline(always)]
fn add_differences(sums: &mut [f64], running: &[f64], count: usize, area: f64) {
    for ((sum, to), from) in sums.iter_mut().zip(&running[count..]).zip(running) {
        *sum += area * (to - from);
    }
}
