//! LDR, expanded and true panoramas side by side.

use std::path::Path;

use veni_core::expand::Expand;
use veni_core::expand::ExpandOptions;
use veni_core::panorama::tonemap::srgb;
use veni_core::panorama::{Panorama, TransferFunction};
use veni_core::sphere::Equirect;
use veni_image::Sheet;
use veni_light::output::Overwrite;

use crate::Failure;
use crate::sample::{Sample, read_file};

const CELL: Equirect = Equirect { width: 192, height: 96 };
/// How much darker the highlights are shown.
const DARKER: f32 = -4.0;

/// One row per panorama, exposed for middle grey: as stored | linearised | expanded | truth, the last three 4 stops darker.
pub(crate) fn run(out: &str, inputs: &[&str]) -> Result<(), Failure> {
    let mut sheet = Sheet::new(4, inputs.len(), CELL.width, CELL.height);
    for (row, input) in inputs.iter().enumerate() {
        let (name, panorama) = read_file(Path::new(input))?;
        let sample = Sample::new(&panorama, 0.0);
        let linear = sample.ldr.linear(TransferFunction::Srgb);
        let expanded = sample.ldr.expand(&ExpandOptions::default());
        eprintln!("{name}: {:.1} % clipped, {:?}", 100.0 * expanded.clipped, expanded.sun);
        let cells: [(&Panorama, f32); 4] =
            [(&linear, 0.0), (&linear, DARKER), (&expanded.panorama, DARKER), (&sample.truth, DARKER)];
        for (column, (panorama, stops)) in cells.into_iter().enumerate() {
            let small = panorama.resample(CELL);
            let byte = |v: f32| (srgb(v * stops.exp2()).clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
            sheet.place(column, row, small.pixels().iter().map(|pixel| pixel.map(byte)));
        }
    }
    Ok(sheet.write(Path::new(out), Overwrite::Replace)?)
}
