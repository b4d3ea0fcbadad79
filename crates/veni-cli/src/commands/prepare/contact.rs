//! `contact.png`: what is in the training set, at a glance.

use anyhow::Result;
use veni_data::prepare::Split;
use veni_image::Panorama;
use veni_image::tonemap::Tonemap;
use veni_light::output::Overwrite;
use veni_light::sphere::Equirect;

use super::place::{Kept, Placed};
use super::store::Store;
use veni_image::Sheet;

use crate::output::with_remedy;

/// One picture on the sheet.
const CELL: Equirect = Equirect { width: 128, height: 64 };
/// More than anyone looks at; of larger sets every n-th panorama is shown.
const MOST: usize = 600;
/// Rows at a picture's lower edge in the colour of its split.
const STRIPE: usize = 4;

pub(super) fn write(store: &Store, placed: &Placed) -> Result<()> {
    let step = placed.kept.len().div_ceil(MOST).max(1);
    let shown: Vec<&Kept> = placed.kept.iter().step_by(step).collect();
    let path = store.root().join("contact.png");
    if shown.is_empty() {
        // a sheet of an earlier run would show what is no longer there
        let _ = std::fs::remove_file(&path);
        return Ok(());
    }
    let columns = (1..).find(|c| 2 * c * c >= shown.len()).unwrap_or(1).clamp(4, 16).min(shown.len());
    let mut sheet = Sheet::new(columns, shown.len().div_ceil(columns), CELL.width, CELL.height);
    for (at, kept) in shown.into_iter().enumerate() {
        let image = Panorama::read(store.root().join(&kept.file))?.resample(CELL);
        let tonemap = Tonemap::filmic(&image, 0.0);
        let colour = colour(kept.split);
        let pixels = image.pixels().iter().enumerate().map(|(k, pixel)| match colour {
            Some(colour) if k / CELL.width >= CELL.height - STRIPE => colour,
            _ => tonemap.apply_u8(*pixel),
        });
        sheet.place(at % columns, at / columns, pixels);
    }
    sheet.write(&path, Overwrite::Replace).map_err(with_remedy)
}

/// Blue for validation, orange for the test.
pub(super) fn colour(split: Split) -> Option<[u8; 3]> {
    match split {
        Split::Train => None,
        Split::Val => Some([64, 128, 255]),
        Split::Test => Some([255, 144, 32]),
    }
}
