//! LDR, expanded and true panoramas side by side.

use std::path::Path;

use veni_core::expand::Expand;
use veni_core::expand::ExpandOptions;
use veni_core::panorama::tonemap::srgb;
use veni_core::panorama::{Panorama, Transfer};
use veni_core::sphere::Equirect;

use crate::Failure;
use crate::sample::{Sample, read_file};

const CELL: Equirect = Equirect { width: 192, height: 96 };
const GAP: usize = 4;
/// How much darker the highlights are shown.
const DARKER: f32 = -4.0;

/// One row per panorama, exposed for middle grey: as stored | linearised | expanded | truth, the last three 4 stops darker.
pub(crate) fn run(out: &str, inputs: &[&str]) -> Result<(), Failure> {
    let side = |cells: usize, size: usize| cells * (size + GAP) - GAP;
    let (width, height) = (side(4, CELL.width), side(inputs.len(), CELL.height));
    let mut image =
        image::RgbImage::from_pixel(u32::try_from(width)?, u32::try_from(height)?, image::Rgb([24; 3]));
    for (row, input) in inputs.iter().enumerate() {
        let (name, panorama) = read_file(Path::new(input))?;
        let sample = Sample::new(&panorama, 0.0);
        let linear = sample.ldr.linear(Transfer::Srgb);
        let expanded = sample.ldr.expand(&ExpandOptions::default());
        eprintln!("{name}: {:.1} % clipped, {:?}", 100.0 * expanded.clipped, expanded.sun);
        let cells: [(&Panorama, f32); 4] =
            [(&linear, 0.0), (&linear, DARKER), (&expanded.panorama, DARKER), (&sample.truth, DARKER)];
        for (column, (panorama, stops)) in cells.into_iter().enumerate() {
            let small = panorama.resample(CELL);
            for (k, pixel) in small.pixels().iter().enumerate() {
                let shown = pixel.map(|v| (srgb(v * stops.exp2()).clamp(0.0, 1.0) * 255.0 + 0.5) as u8);
                let x = column * (CELL.width + GAP) + k % CELL.width;
                let y = row * (CELL.height + GAP) + k / CELL.width;
                image.put_pixel(u32::try_from(x)?, u32::try_from(y)?, image::Rgb(shown));
            }
        }
    }
    Ok(image.save(out)?)
}
