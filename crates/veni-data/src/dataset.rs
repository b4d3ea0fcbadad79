//! Panoramas, ready for use.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::parallel::parallel;
use crate::pixels::Pixels;
use crate::whole::whole;
use crate::{Error, Result};
use veni_image::exposure::centre_exposure;
use veni_image::{Budget, Panorama, ReadOptions};
use veni_light::light::{LightOptions, Lights};
use veni_light::progress::{Observer, Silent};
use veni_light::sphere::Equirect;

/// One panorama, ready for use.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Where it was read from.
    pub path: PathBuf,
    /// Natural-log radiance at exposure 0, 3·W·H values.
    pub log_radiance: Pixels,
    /// What was subtracted: the solid-angle-weighted mean of ln(luminance).
    pub log_exposure: f32,
    /// The compact lights that were taken out before, at the same exposure: their irradiance is divided by its exponential.
    pub lights: Lights,
    /// Whether it is a generated scene ([`veni_synth`]).
    pub generated: bool,
}

impl Item {
    /// A clean panorama (positive and finite), resampled to `grid`, as log radiance at exposure 0.
    pub fn new(path: &Path, panorama: &Panorama, grid: Equirect) -> Self {
        let mut log_radiance = panorama.resample(grid).log().into_flattened();
        let log_exposure = centre_exposure(grid, &mut log_radiance);
        Self {
            path: path.to_path_buf(),
            log_radiance: log_radiance.into(),
            log_exposure,
            lights: Lights::default(),
            generated: false,
        }
    }

    /// The same of what is left of the panorama without its compact lights, of which up to `lights` are taken out at its full
    /// resolution.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the panorama holds a value that is not finite, or `lights` is more than
    /// [`LightOptions::MOST`].
    pub fn split(path: &Path, panorama: Panorama, grid: Equirect, lights: usize) -> Result<Self> {
        Self::split_by(path, panorama, grid, LightOptions { lights, ..LightOptions::default() })
    }

    /// [`Item::split`] with other options than the number of lights.
    ///
    /// # Errors
    /// As [`Item::split`]; also for options that no light satisfies.
    pub fn split_by(
        path: &Path,
        mut panorama: Panorama,
        grid: Equirect,
        options: LightOptions,
    ) -> Result<Self> {
        if options.lights == 0 {
            return Ok(Self::new(path, &panorama, grid));
        }
        // of the whole: without its lamps a panorama of lamps on black has no mean to be dark by
        panorama.replace_zeros();
        let full = panorama.grid();
        let light = options.of_pixels(full, panorama.into_pixels())?;
        let lights = light.lights().clone();
        let item = Self::new(path, &Panorama::new(full, light.into_residual()), grid);
        Ok(Self { lights: lights.scaled((-item.log_exposure).exp()), ..item })
    }

    /// [`Item::split_by`] of log radiance on `grid`, 3·W·H values. [`Item::log_exposure`] is what the rest lies above or below exposure 0.
    ///
    /// # Errors
    /// As [`Item::split`].
    pub fn split_log(grid: Equirect, log_radiance: &[f32], options: LightOptions) -> Result<Self> {
        Self::split_by(Path::new(""), Panorama::from_log(grid, log_radiance.as_chunks().0), grid, options)
    }

    /// File name without extension.
    pub fn name(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }
}

/// Panoramas of one grid. A clone shares them.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    grid: Equirect,
    items: Arc<Vec<Item>>,
}

impl Dataset {
    /// Wraps panoramas that are already log radiance at exposure 0.
    ///
    /// # Panics
    /// If an item does not have 3·W·H values.
    pub fn new(grid: Equirect, items: Vec<Item>) -> Self {
        for item in &items {
            let (have, want) = (item.log_radiance.len(), 3 * grid.len());
            assert_eq!(
                have,
                want,
                "{}: {have} values on a {} × {} grid",
                item.path.display(),
                grid.width,
                grid.height
            );
        }
        Self { grid, items: Arc::new(items) }
    }

    /// Reads, cleans and resamples files, in parallel; the order is kept. At most as many files as there are processors are
    /// in memory at their full size at a time, fewer where their pixels are more than [`Budget::shared`].
    ///
    /// # Errors
    /// All files that cannot be read, by name; if it is one, what is wrong with it.
    pub fn load(files: &[PathBuf], grid: Equirect) -> Result<Self> {
        Self::load_observed(files, grid, &ReadOptions::default(), &Silent)
    }

    /// [`Dataset::load`] with limits of what is read, and an observer, to which progress is reported and what files say
    /// that is not applied.
    ///
    /// # Errors
    /// As [`Dataset::load`].
    pub fn load_observed(
        files: &[PathBuf],
        grid: Equirect,
        options: &ReadOptions,
        observer: &dyn Observer,
    ) -> Result<Self> {
        observer.begin("panorama", "loading", 0, files.len());
        Ok(Self::new(grid, load(files, grid, 0, options, |_, item| Ok(item), observer)?))
    }

    /// Only the panoramas that are wanted.
    #[must_use]
    pub fn retain(self, wanted: impl Fn(&Item) -> bool) -> Self {
        let mut items = Arc::unwrap_or_clone(self.items);
        items.retain(wanted);
        Self { items: Arc::new(items), ..self }
    }

    /// The pixel grid of every item.
    pub fn grid(&self) -> Equirect {
        self.grid
    }

    /// The panoramas, in order.
    pub fn items(&self) -> &[Item] {
        &self.items
    }

    /// Bytes of the pixels that are in a mapped file.
    pub fn mapped_bytes(&self) -> u64 {
        let mapped = self.items.iter().filter(|item| item.log_radiance.is_mapped());
        mapped.map(|item| size_of_val(item.log_radiance.as_slice()) as u64).sum()
    }

    /// Number of panoramas.
    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }
}

/// Most files that one error names.
const MOST_NAMED: usize = 20;

/// Reads files, in parallel, without up to `lights` compact lights of each; all that cannot be read are named together. Each
/// panorama goes through `keep` with its place in the list, and advances the
/// observer by one.
pub(super) fn load(
    files: &[PathBuf],
    grid: Equirect,
    lights: usize,
    options: &ReadOptions,
    keep: impl Fn(usize, Item) -> Result<Item> + Sync,
    observer: &dyn Observer,
) -> Result<Vec<Item>> {
    let read = parallel(files.len(), |at| {
        let claim = Budget::shared().claim_file(&files[at], options);
        let item = match read_item(&files[at], grid, lights, options, observer) {
            Ok(item) => Ok(keep(at, item)?),
            Err(error) => Err(error),
        };
        drop(claim);
        observer.advance(1);
        Ok(item)
    })?;
    let (mut items, mut errors) = (Vec::with_capacity(read.len()), Vec::new());
    for item in read {
        match item {
            Ok(item) => items.push(item),
            Err(error) => errors.push(error),
        }
    }
    if errors.is_empty() { Ok(items) } else { Err(all_of(errors, files.len())) }
}

fn read_item(
    path: &Path,
    grid: Equirect,
    lights: usize,
    options: &ReadOptions,
    observer: &dyn Observer,
) -> Result<Item> {
    let mut panorama = Panorama::read_with(path, options)?;
    for note in panorama.notes() {
        observer.note(&format!("{}: {note}", path.display()));
    }
    let bad = whole(&mut panorama).and_then(|()| panorama.sanitise()).map_err(|e| e.in_file(path))?;
    for note in bad.notes() {
        observer.note(&format!("{}: {note}", path.display()));
    }
    Item::split(path, panorama, grid, lights).map_err(|e| e.in_file(path))
}

/// One error for all files that cannot be used, so that they can be put right at once.
fn all_of(mut errors: Vec<Error>, files: usize) -> Error {
    if errors.len() == 1 {
        return errors.remove(0);
    }
    let named: Vec<_> = errors.iter().take(MOST_NAMED).map(Error::with_source).collect();
    let more = errors.len() - named.len();
    let more = if more > 0 { format!("; and {more} more") } else { String::new() };
    Error::invalid(format!(
        "{} of {files} panoramas cannot be used: {}{more}",
        errors.len(),
        named.join("; ")
    ))
}
