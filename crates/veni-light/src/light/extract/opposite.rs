//! What of a light's surroundings is its own.

use super::level::Cell;
use super::measure::Measured;
use crate::sphere::Equirect;
use crate::vector::{angle, dot};

/// Bounds what is taken about a core by what there is on the other side of it, so that the middle of what is taken is the core:
/// surfaces are then lit from where shadows fall. What one side has more, the horizon's glow or a lit cloud, is left in the map.
pub(super) struct Opposite<'a> {
    grid: Equirect,
    pixels: &'a [[f32; 3]],
    measured: &'a Measured,
    core: [f64; 3],
    /// Nearer to the core than this all is taken: within a pixel or two, sides mean nothing.
    rim: f64,
}

impl<'a> Opposite<'a> {
    pub(super) fn new(
        grid: Equirect,
        pixels: &'a [[f32; 3]],
        measured: &'a Measured,
        core: [f64; 3],
        rim: f64,
    ) -> Self {
        Self { grid, pixels, measured, core, rim }
    }

    /// What stays in the map of a cell of which `rest` would stay by itself.
    pub(super) fn rest(&self, cell: &Cell, rest: [f32; 3]) -> [f32; 3] {
        if angle(cell.direction, self.core) <= self.rim || cell.radiance == rest {
            return rest;
        }
        let along = 2.0 * dot(cell.direction, self.core);
        let mirrored = [0, 1, 2].map(|k| along * self.core[k] - cell.direction[k]);
        if angle(mirrored, self.measured.centre) > self.measured.scale {
            return cell.radiance;
        }
        let most = self.most_about(mirrored);
        [0, 1, 2].map(|c| {
            let opposite = (most[c] - self.measured.background[c]).max(0.0);
            rest[c].max(cell.radiance[c] - opposite)
        })
    }

    /// The largest values of the pixel there and the eight about it: the rim of a disc falls upon pixels as it will.
    fn most_about(&self, direction: [f64; 3]) -> [f32; 3] {
        let Equirect { width, height } = self.grid;
        let [column, row] = self.grid.pixel(direction.map(|c| c as f32)).map(|v| v as usize);
        let mut most = [0f32; 3];
        for row in row.saturating_sub(1)..=(row + 1).min(height - 1) {
            for step in [width - 1, 0, 1] {
                let pixel = self.pixels[row * width + (column + step) % width];
                most = [0, 1, 2].map(|c| most[c].max(pixel[c]));
            }
        }
        most
    }
}

#[cfg(test)]
mod tests {
    use crate::compact::{CompactLight, Lights};
    use crate::light::{EnvironmentMap, Light};
    use crate::luminance::luminance;
    use crate::sphere::Equirect;
    use crate::vector::{angle, normalised};

    /// Irradiance of a surface by the sum over all pixels.
    fn irradiance(grid: Equirect, pixels: &[[f32; 3]], normal: [f32; 3]) -> f64 {
        let cosines = grid.directions().into_iter().map(|d| (0..3).map(|k| d[k] * normal[k]).sum::<f32>());
        let rows = cosines.zip(pixels).enumerate();
        rows.map(|(k, (cos, p))| grid.solid_angle(k / grid.width) * f64::from(cos.max(0.0) * p[1])).sum()
    }

    /// A sun in front of the edge of a bright cloud: 40 % of what stands out is on one side.
    #[test]
    fn an_aureole_on_one_side_stays_in_the_map() {
        let grid = Equirect::new(512, 256);
        let direction = [0.8, 0.48, 0.36];
        let sun = CompactLight::new(direction, [3.0; 3], CompactLight::SUN_RADIUS);
        let mut pixels: Vec<[f32; 3]> = grid
            .directions()
            .into_iter()
            .map(|d| {
                let off = angle(d.map(f64::from), direction.map(f64::from)).to_degrees();
                let left = d[1] * direction[0] > d[0] * direction[1];
                [0.1 + if left { 60.0 * (-off / 6.0).exp() as f32 } else { 0.0 }; 3]
            })
            .collect();
        Lights::new(Some(sun), []).add_to_rows(grid, 0..grid.height, &mut pixels);
        let light = Light::of(EnvironmentMap::new(grid, &pixels).unwrap());
        let found = light.sun().unwrap();
        let off = angle(found.direction.map(f64::from), direction.map(f64::from)).to_degrees();
        // a quarter of a pixel
        assert!(off < 0.18, "{off}°");
        // what was taken for the sun has its middle there
        let mut moment = [0.0; 3];
        for (k, d) in grid.directions().into_iter().enumerate() {
            let away = angle(d.map(f64::from), direction.map(f64::from)).to_degrees();
            let taken = luminance(pixels[k]) - luminance(light.residual().pixels()[k]);
            if away < 3.0 {
                let weight = grid.solid_angle(k / grid.width) * f64::from(taken);
                moment = [0, 1, 2].map(|c| moment[c] + weight * f64::from(d[c]));
            }
        }
        let off = angle(normalised(moment).unwrap(), direction.map(f64::from)).to_degrees();
        assert!(off < 0.18, "{off}°");
        // and surfaces are lit as by the map
        let facing = irradiance(grid, &pixels, direction);
        for normal in [direction, [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, -0.6, 0.8], [0.6, -0.8, 0.0]] {
            let truth = irradiance(grid, &pixels, normal);
            let off = (f64::from(light.irradiance(normal)[1]) - truth).abs() / facing;
            assert!(off < 0.005, "{normal:?}: {off}");
        }
    }
}
