//! Brings panoramas of any size to a small one, as half-precision EXR files, and shows them on one sheet.
//!
//! ```text
//! cargo run --release -p veni-research --example shrink -- WIDTH OUT_FOLDER IN.exr…
//! ```
//! The panoramas in `assets/panoramas` were made this way with WIDTH 128. `OUT_FOLDER/sheet.png` is the sheet.

use std::path::Path;
use std::time::Instant;

use veni_core::panorama::tonemap::Tonemap;
use veni_core::panorama::{HalfRange, Panorama, Precision, WriteFormat, WriteOptions};
use veni_core::sphere::Equirect;
use veni_image::Sheet;
use veni_light::output::Overwrite;

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [width, folder, inputs @ ..] = &args[..] else {
        return Err("usage: shrink WIDTH OUT_FOLDER IN.exr…".into());
    };
    let width: usize = width.parse()?;
    let grid = Equirect::new(width, width / 2);
    std::fs::create_dir_all(folder)?;
    let mut pictures = Vec::new();
    for input in inputs {
        let start = Instant::now();
        let mut image = Panorama::read(input)?;
        let replaced = image.sanitise()?.total();
        let small = image.resample(grid);
        let milliseconds = start.elapsed().as_secs_f64() * 1e3;
        let name = Path::new(input).file_stem().ok_or("no file name")?;
        let mut options = WriteOptions::new(WriteFormat::Exr(Precision::Half));
        options.half_range = HalfRange::Fit;
        small.write(Path::new(folder).join(name).with_extension("exr"), &options)?;
        let Equirect { width, height } = image.grid();
        eprintln!("{}: {width} × {height}, {replaced} values replaced, {milliseconds:.1} ms", name.display());
        pictures.push(small);
    }
    sheet(&pictures, grid, &Path::new(folder).join("sheet.png"))
}

/// Four panoramas in a row, filmic, each with its own exposure.
fn sheet(pictures: &[Panorama], grid: Equirect, path: &Path) -> Result<(), Failure> {
    let columns = pictures.len().clamp(1, 4);
    let rows = pictures.len().div_ceil(columns).max(1);
    let mut out = Sheet::spaced(columns, rows, [grid.width, grid.height], 0, [0; 3]);
    for (k, picture) in pictures.iter().enumerate() {
        let map = Tonemap::filmic(picture, 0.0);
        out.place(k % columns, k / columns, picture.pixels().iter().map(|pixel| map.apply_u8(*pixel)));
    }
    Ok(out.write(path, Overwrite::Replace)?)
}
