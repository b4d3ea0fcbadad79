//! What is known without looking: the mean sky of the training panoramas, and the one of them that looks most like a photograph.
//! MODEL (78, 79).

use super::Evaluation;
use super::camera::{Camera, Photograph};
use crate::{Error, Result};
use veni_data::parallel::parallel;
use veni_data::{Dataset, Item};
use veni_image::{Panorama, luminance};
use veni_light::sphere::Equirect;

/// Ways in which each training panorama is looked at.
const TURNS: usize = 12;

/// The training panoramas of an evaluation.
///
/// # Errors
/// [`Error::Invalid`] if there are none, or one of them is evaluated on.
pub(super) fn training<'a>(run: &Evaluation<'a>, protocol: &str) -> Result<&'a Dataset> {
    let train = run.train.filter(|train| !train.is_empty()).ok_or_else(|| {
        Error::invalid(format!(
            "{protocol} compares with what is known from training panoramas: name a folder of some"
        ))
    })?;
    // one file may have several names
    let place = |item: &Item| item.path.canonicalize().unwrap_or_else(|_| item.path.clone());
    let evaluated: Vec<_> = run.data.items().iter().map(place).collect();
    if let Some(both) = train.items().iter().find(|item| evaluated.contains(&place(item))) {
        return Err(Error::invalid(format!(
            "{}: is among the training panoramas and among those that are judged, and would be found as its own nearest; name other training panoramas",
            both.path.display()
        )));
    }
    Ok(train)
}

/// Log radiance that depends on the elevation alone: the mean of radiance over the panoramas, each with mean luminance 1, and over
/// every azimuth.
pub(super) fn mean_sky(train: &Dataset) -> Vec<f32> {
    let grid = train.grid();
    let mut rows = vec![[0.0f64; 3]; grid.height];
    for item in train.items() {
        let pixels = radiance(item);
        let level = |p: usize| grid.solid_angle(p / grid.width) * f64::from(luminance(pixels[p]));
        let mean = (0..grid.len()).map(level).sum::<f64>() / (4.0 * std::f64::consts::PI);
        for (p, pixel) in pixels.iter().enumerate() {
            let row = &mut rows[p / grid.width];
            *row = [0, 1, 2].map(|c| row[c] + f64::from(pixel[c]) / mean);
        }
    }
    let count = (train.len() * grid.width) as f64;
    rows.iter().flat_map(|row| row.map(|v| (v / count).ln() as f32).repeat(grid.width)).collect()
}

/// Training panoramas, each as a camera sees it one way.
#[derive(Debug)]
pub(super) struct Seen<'a> {
    train: &'a Dataset,
    photographs: Vec<Photograph>,
}

/// A training panorama, turned.
#[derive(Debug)]
pub(super) struct Nearest {
    pub(super) name: String,
    /// Where the camera looks in it, radians.
    pub(super) azimuth: f64,
    /// Log radiance, turned so that this is +x.
    pub(super) log_radiance: Vec<f32>,
    /// The luminance that is white in its photograph.
    pub(super) white: f32,
}

impl<'a> Seen<'a> {
    pub(super) fn new(train: &'a Dataset, camera: &Camera) -> Result<Self> {
        let each = parallel(train.len(), |at| {
            let panorama = Panorama::new(train.grid(), radiance(&train.items()[at]));
            Ok((0..TURNS).map(|k| camera.take(panorama.rotated(-azimuth(k)).pixels())).collect::<Vec<_>>())
        })?;
        Ok(Self { train, photographs: each.concat() })
    }

    /// The one whose photograph has the display values nearest to those of `photograph`.
    pub(super) fn nearest(&self, photograph: &Photograph) -> Nearest {
        let distance = |at: &usize| self.photographs[*at].distance(photograph);
        let distances: Vec<_> = (0..self.photographs.len()).map(|at| (distance(&at), at)).collect();
        let at = distances.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |(_, at)| at);
        let (item, azimuth) = (&self.train.items()[at / TURNS], azimuth(at % TURNS));
        Nearest {
            name: item.name(),
            azimuth,
            log_radiance: turned(self.train.grid(), &item.log_radiance, azimuth),
            white: self.photographs[at].white,
        }
    }
}

fn azimuth(turn: usize) -> f64 {
    std::f64::consts::TAU * turn as f64 / TURNS as f64
}

/// Log radiance turned so that what was at this azimuth is at +x.
pub(super) fn turned(grid: Equirect, log_radiance: &[f32], azimuth: f64) -> Vec<f32> {
    let panorama = Panorama::from_log(grid, log_radiance.as_chunks().0).rotated(-azimuth);
    panorama.into_pixels().into_iter().flatten().map(f32::ln).collect()
}

fn radiance(item: &Item) -> Vec<[f32; 3]> {
    item.log_radiance.as_chunks::<3>().0.iter().map(|p| p.map(f32::exp)).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const GRID: Equirect = Equirect { width: 64, height: 32 };

    fn dataset(skies: &[&dyn Fn([f32; 3]) -> [f32; 3]]) -> Dataset {
        let item = |(k, sky): (usize, &&dyn Fn([f32; 3]) -> [f32; 3])| {
            Item::new(Path::new(&format!("{k}.exr")), &Panorama::from_fn(GRID, sky), GRID)
        };
        Dataset::new(GRID, skies.iter().enumerate().map(item).collect())
    }

    #[test]
    fn the_mean_sky_is_the_mean_over_azimuths_of_equally_bright_panoramas() {
        // grey, and twice as bright on one side as on the other, at any exposure
        let grey = |_: [f32; 3]| [5.0; 3];
        let split = |d: [f32; 3]| if d[1] > 0.0 { [0.4, 0.2, 0.1] } else { [0.2, 0.2, 0.3] };
        let sky = mean_sky(&dataset(&[&grey, &split]));
        // (0.3, 0.2, 0.2) has luminance 0.2126 0.3 + 0.7152 0.2 + 0.0722 0.2
        let level = 0.2126 * 0.3 + 0.7152 * 0.2 + 0.0722 * 0.2;
        let expected = [0.3, 0.2, 0.2].map(|v: f64| (0.5 * (1.0 + v / level)).ln());
        for pixel in sky.as_chunks::<3>().0 {
            for (found, expected) in pixel.iter().zip(expected) {
                assert!((f64::from(*found) - expected).abs() < 1e-4, "{pixel:?} instead of {expected}");
            }
        }
    }

    #[test]
    fn the_nearest_is_found_however_it_is_turned() {
        let stripes = |d: [f32; 3]| [0.6 + 0.5 * (3.0 * d[1].atan2(d[0])).sin(), 0.5, 0.4 + 0.3 * d[2]];
        let lamp = |d: [f32; 3]| if d[0] > 0.9 { [4.0, 3.0, 2.0] } else { [0.3; 3] };
        let (train, camera) = (dataset(&[&stripes, &lamp]), Camera::new(GRID));
        let seen = Seen::new(&train, &camera).unwrap();
        // the lamp at an azimuth of 90°, seen from the front, by a camera of another exposure
        let other = Panorama::from_fn(GRID, |d| lamp([d[1], -d[0], d[2]]).map(|v| 3.0 * v))
            .rotated(-std::f64::consts::FRAC_PI_2);
        let found = seen.nearest(&camera.take(other.pixels()));
        assert_eq!((found.name.as_str(), found.azimuth), ("1", 0.0));
        let elsewhere =
            camera.take(Panorama::from_fn(GRID, lamp).rotated(-0.5 * std::f64::consts::PI).pixels());
        assert!((seen.nearest(&elsewhere).azimuth - 0.5 * std::f64::consts::PI).abs() < 1e-9);
        let first = seen.nearest(&camera.take(Panorama::from_fn(GRID, stripes).pixels()));
        assert_eq!(first.name, "0");
        let [ahead, left] =
            [0.0, 0.5 * std::f64::consts::PI].map(|a| turned(GRID, &train.items()[1].log_radiance, a));
        let at = |image: &[f32], d| {
            let [x, y] = GRID.pixel(d).map(|v| v as usize);
            image[3 * (y * 64 + x)]
        };
        assert!(at(&ahead, [1.0, 0.0, 0.1]) > at(&left, [1.0, 0.0, 0.1]) + 1.0);
        assert!(
            (at(&left, [0.0, -1.0, 0.1]) - at(&ahead, [1.0, 0.0, 0.1])).abs() < 1e-4,
            "turned by its azimuth"
        );
    }
}
