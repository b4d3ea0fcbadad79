//! A disc on the pixels of a panorama by exact coverage: its energy is right at any resolution, at the poles and across the
//! seam. LIGHT (9), MODEL (72).

use std::f64::consts::PI;
use std::ops::Range;

use super::CompactLight;
use crate::sphere::Equirect;

/// Nodes and weights of Gauss–Legendre quadrature on [−1, 1], twelve points, one half of the symmetric rule.
const NODES: [(f64, f64); 6] = [
    (0.125_233_408_511_468_9, 0.249_147_045_813_402_78),
    (0.367_831_498_998_180_2, 0.233_492_536_538_354_8),
    (0.587_317_954_286_617_4, 0.203_167_426_723_065_92),
    (0.769_902_674_194_304_7, 0.160_078_328_543_346_22),
    (0.904_117_256_370_474_9, 0.106_939_325_995_318_43),
    (0.981_560_634_246_719_3, 0.047_175_336_386_511_83),
];

/// Radii below this are points, radians: 0.0002 arc seconds.
const POINT: f64 = 1e-9;

/// A circular disc on the sphere.
#[derive(Clone, Copy, Debug)]
pub struct Disc {
    /// Polar angle of the centre.
    polar: f64,
    /// Azimuth of the centre.
    azimuth: f64,
    radius: f64,
}

impl Disc {
    /// About a unit direction, of an angular radius in radians, at most π.
    pub fn new(direction: [f32; 3], radius: f32) -> Self {
        let [x, y, z] = direction.map(f64::from);
        Self { polar: x.hypot(y).atan2(z), azimuth: y.atan2(x), radius: f64::from(radius).clamp(0.0, PI) }
    }

    /// What part of the disc's solid angle lies in which pixel: row-major indices, perhaps one twice, and parts
    /// that sum to 1. A disc without extent lies in one pixel.
    pub fn parts(self, grid: Equirect) -> Vec<(usize, f64)> {
        let (mut parts, mut of_row) = (Vec::new(), Vec::new());
        for row in self.rows(grid, 0..grid.height) {
            self.row_parts(grid, row, &mut of_row);
            parts.extend(of_row.drain(..).map(|(column, part)| (row * grid.width + column, part)));
        }
        // the quadrature's last digits must not change the energy
        let total: f64 = parts.iter().map(|p| p.1).sum();
        parts.iter_mut().for_each(|part| part.1 /= total);
        parts
    }

    /// Those of `rows` that the disc may reach.
    pub(crate) fn rows(self, grid: Equirect, rows: Range<usize>) -> Range<usize> {
        let height = grid.height as f64;
        let row_of = |polar: f64| ((polar / PI * height).max(0.0) as usize).min(grid.height - 1);
        let extent = if self.radius < POINT { 0.0 } else { self.radius };
        let (first, last) = (row_of(self.polar - extent), row_of(self.polar + extent));
        first.max(rows.start)..(last + 1).min(rows.end).max(first.max(rows.start))
    }

    /// What part of the disc's solid angle lies in which column of one of its [`Disc::rows`], appended: columns, perhaps one twice.
    pub(crate) fn row_parts(self, grid: Equirect, row: usize, parts: &mut Vec<(usize, f64)>) {
        let (width, height) = (grid.width as f64, grid.height as f64);
        let centre = (PI - self.azimuth) / (2.0 * PI) * width;
        if self.radius < POINT {
            return parts.push((centre as usize % grid.width, 1.0));
        }
        let half = (0.5 * self.radius).sin();
        let disc = 4.0 * PI * half * half;
        let (top, bottom) = (PI * row as f64 / height, PI * (row + 1) as f64 / height);
        let half = self.widest(top, bottom) * width / (2.0 * PI);
        let (first, last) = ((centre - half).floor(), (centre + half).ceil());
        let inside = self.narrowest(top, bottom);
        let whole = grid.solid_angle(row);
        // the area left of the last edge that was looked at
        let mut known = (f64::NAN, 0.0);
        let offset = |edge: f64| (edge - centre) * 2.0 * PI / width;
        for left in first as isize..last as isize {
            let (from, to) = (offset(left as f64), offset(left as f64 + 1.0));
            let area = if from.abs().max(to.abs()) <= inside {
                whole
            } else {
                let before = if known.0 == from { known.1 } else { self.left_of(from, top, bottom) };
                known = (to, self.left_of(to, top, bottom));
                known.1 - before
            };
            if area > 0.0 {
                parts.push((left.rem_euclid(grid.width as isize) as usize, area / disc));
            }
        }
    }

    /// Half of the disc's width in azimuth at a polar angle: sin²(h/2) = sin((r+δ)/2) sin((r−δ)/2) / (sin θ sin θ_c), δ = θ − θ_c.
    fn half_width(self, polar: f64) -> f64 {
        let (r, d) = (self.radius, polar - self.polar);
        let above = (0.5 * (r + d)).sin() * (0.5 * (r - d)).sin();
        let below = (polar.sin() * self.polar.sin()).max(f64::MIN_POSITIVE);
        2.0 * (above / below).clamp(0.0, 1.0).sqrt().asin()
    }

    /// The largest half width between two polar angles.
    fn widest(self, top: f64, bottom: f64) -> f64 {
        // where a meridian touches the circle
        let touch = (self.polar.cos() / self.radius.cos()).clamp(-1.0, 1.0).acos();
        let at = |polar: f64| self.half_width(polar.clamp(top, bottom));
        let near = at(self.polar - self.radius).max(at(self.polar + self.radius));
        at(top).max(at(bottom)).max(at(touch)).max(near).max(at(self.polar))
    }

    /// The half width that the disc has everywhere between two polar angles.
    fn narrowest(self, top: f64, bottom: f64) -> f64 {
        self.half_width(top).min(self.half_width(bottom))
    }

    /// Solid angle of the part of the disc between two polar angles and to the left of the meridian `offset` to the right of the
    /// centre's.
    fn left_of(self, offset: f64, top: f64, bottom: f64) -> f64 {
        let (low, high) = ((self.polar - self.radius).max(top), (self.polar + self.radius).min(bottom));
        if low >= high {
            return 0.0;
        }
        // where the width changes its form: the circle meets the meridian, and where it begins to go around a pole
        let mut cuts = [low, high, high, high, high, high];
        let (a, b) = (self.polar.cos(), self.polar.sin() * offset.cos());
        let (length, direction) = (a.hypot(b), b.atan2(a));
        let reach = (self.radius.cos() / length).clamp(-1.0, 1.0).acos();
        let around = [self.radius - self.polar, 2.0 * PI - self.radius - self.polar];
        for (cut, at) in
            cuts[1..].iter_mut().zip([direction - reach, direction + reach, around[0], around[1]])
        {
            *cut = at.clamp(low, high);
        }
        cuts.sort_unstable_by(f64::total_cmp);
        let width = |polar: f64| {
            let half = self.half_width(polar);
            (offset + half).clamp(0.0, 2.0 * half) * polar.sin()
        };
        cuts.windows(2).filter(|cut| cut[1] > cut[0]).map(|cut| integral(cut[0], cut[1], width)).sum()
    }
}

/// ∫ f over [a, b], where f may go like a square root at both ends: x = middle + half·sin(πs/2).
fn integral(a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let at = |s: f64| {
        let (sin, cos) = (0.5 * PI * s).sin_cos();
        f(middle + half * sin) * cos
    };
    let sum: f64 = NODES.iter().map(|(s, weight)| weight * (at(*s) + at(-s))).sum();
    0.5 * PI * half * sum
}

impl CompactLight {
    /// Adds the light to row-major pixels of `grid` as a disc of constant radiance with its irradiance and radius: the integral
    /// over the pixels grows by the irradiance, whatever the resolution.
    ///
    /// # Panics
    /// If there are not W·H pixels.
    pub fn add_to(&self, grid: Equirect, pixels: &mut [[f32; 3]]) {
        assert_eq!(pixels.len(), grid.len(), "pixels of a {} × {} grid", grid.width, grid.height);
        for (index, part) in Disc::new(self.direction, self.radius).parts(grid) {
            self.add_part(part / grid.solid_angle(index / grid.width), &mut pixels[index]);
        }
    }

    /// Adds the parts of the light, as a disc, that lie in `rows` of a panorama, which `pixels` are.
    pub(super) fn add_to_rows(&self, grid: Equirect, rows: Range<usize>, pixels: &mut [[f32; 3]]) {
        let disc = Disc::new(self.direction, self.radius);
        let mut parts = Vec::new();
        for row in disc.rows(grid, rows.clone()) {
            disc.row_parts(grid, row, &mut parts);
            let pixels = &mut pixels[(row - rows.start) * grid.width..][..grid.width];
            for (column, part) in parts.drain(..) {
                self.add_part(part / grid.solid_angle(row), &mut pixels[column]);
            }
        }
    }

    /// Adds the radiance of a part of the light, divided by a pixel's solid angle.
    #[inline]
    pub(super) fn add_part(&self, weight: f64, pixel: &mut [f32; 3]) {
        for (value, irradiance) in pixel.iter_mut().zip(self.irradiance) {
            *value = (f64::from(*value) + weight * f64::from(irradiance)) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direction(azimuth: f64, elevation: f64) -> [f32; 3] {
        let ((sa, ca), (se, ce)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
        [ce * ca, ce * sa, se].map(|v| v as f32)
    }

    /// Solid angle of the part of a disc in each pixel by counting: exact in the limit.
    fn counted(disc: Disc, grid: Equirect, n: usize) -> Vec<f64> {
        let fine = Equirect::new(grid.width * n, grid.height * n);
        let (st, ct) = disc.polar.sin_cos();
        let (sp, cp) = disc.azimuth.sin_cos();
        let mut out = vec![0.0; grid.len()];
        for row in 0..fine.height {
            let (s, c) = fine.polar(row).sin_cos();
            for column in 0..fine.width {
                let (sin, cos) = fine.azimuth(column).sin_cos();
                if s * cos * st * cp + s * sin * st * sp + c * ct >= disc.radius.cos() {
                    out[row / n * grid.width + column / n] += fine.solid_angle(row);
                }
            }
        }
        out
    }

    #[test]
    fn parts_are_the_areas_of_the_pixels_at_poles_seam_and_anywhere() {
        let grid = Equirect::new(24, 12);
        for (azimuth, elevation, radius) in [
            (20.0, 10.0, 20.0),
            (180.0, -35.0, 12.0),
            (-179.0, 3.0, 9.0),
            (70.0, 90.0, 25.0),
            (70.0, 83.0, 25.0),
            (-10.0, -88.0, 7.0),
            (-10.0, -60.0, 30.0),
            (45.0, 40.0, 75.0),
            (45.0, 40.0, 120.0),
        ] {
            let disc = Disc::new(direction(azimuth, elevation), (radius as f32).to_radians());
            let total = 2.0 * PI * (1.0 - disc.radius.cos());
            let mut found = vec![0.0; grid.len()];
            for (index, part) in disc.parts(grid) {
                found[index] += part * total;
            }
            let expected = counted(disc, grid, 60);
            let worst = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // counting errs by part of the boundary's cells
            assert!(worst < 4e-4, "{azimuth}°, {elevation}°, {radius}°: {worst}");
        }
    }

    #[test]
    fn energy_is_kept_at_any_resolution() {
        for width in [1, 8, 64, 511, 4096, 16384] {
            let grid = Equirect::new(width, width.div_ceil(2));
            for (azimuth, elevation) in [(10.0, 33.0), (180.0, 0.0), (0.0, 90.0), (12.0, 89.99), (5.0, -90.0)]
            {
                for radius in [0.0, 1e-8, 0.004_651, 0.2] {
                    let parts = Disc::new(direction(azimuth, elevation), radius).parts(grid);
                    let sum: f64 = parts.iter().map(|p| p.1).sum();
                    // row by row it is that of the disc itself
                    let disc = Disc::new(direction(azimuth, elevation), radius);
                    let mut rows = Vec::new();
                    disc.rows(grid, 0..grid.height).for_each(|row| disc.row_parts(grid, row, &mut rows));
                    let by_rows: f64 = rows.iter().map(|p| p.1).sum();
                    assert!(
                        (by_rows - 1.0).abs() < 1e-6,
                        "{width}, {azimuth}, {elevation}, {radius}: {by_rows}"
                    );
                    assert!(
                        (sum - 1.0).abs() < 1e-10 && parts.iter().all(|p| p.1 > 0.0),
                        "{width}, {elevation}, {radius}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_covered_pixel_has_the_radiance_of_the_disc() {
        let grid = Equirect::new(2048, 1024);
        let light = CompactLight::new(direction(180.0, 20.0), [2.0, 1.0, 0.5], 0.05);
        let mut pixels = vec![[0.0; 3]; grid.len()];
        light.add_to(grid, &mut pixels);
        let [x, y] = grid.pixel(light.direction);
        let centre = pixels[y as usize * 2048 + x as usize];
        for (a, b) in centre.into_iter().zip(light.radiance()) {
            assert!((a / b - 1.0).abs() < 1e-5, "{centre:?}");
        }
        // on both sides of the seam
        assert!(pixels[y as usize * 2048][0] > 0.0 && pixels[y as usize * 2048 + 2047][0] > 0.0);
    }
}
