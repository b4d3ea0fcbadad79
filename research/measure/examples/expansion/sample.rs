//! Panoramas as a camera of limited range would have recorded them.

use std::path::{Path, PathBuf};

use veni_core::panorama::tonemap::{MIDDLE_GREY, srgb};
use veni_core::panorama::{LdrPanorama, Panorama};

use crate::Failure;

/// Stops over the exposure that makes the geometric mean middle grey.
pub(crate) const STOPS: [f32; 4] = [-1.0, 0.0, 1.0, 2.0];

/// A panorama at one exposure: 1 is the display's white.
pub(crate) struct Sample {
    pub(crate) truth: Panorama,
    pub(crate) ldr: LdrPanorama,
}

/// The panoramas of a folder, clean.
pub(crate) fn read(folder: impl AsRef<Path>) -> Result<Vec<(String, Panorama)>, Failure> {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder)?.map(|e| e.map(|e| e.path())).collect::<Result<_, _>>()?;
    files.retain(|f| f.extension().is_some_and(|e| e == "exr" || e == "hdr"));
    files.sort();
    files.iter().map(|file| read_file(file)).collect()
}

pub(crate) fn read_file(file: &Path) -> Result<(String, Panorama), Failure> {
    let mut panorama = Panorama::read(file)?;
    panorama.sanitise()?;
    Ok((file.file_stem().unwrap_or_default().to_string_lossy().into_owned(), panorama))
}

impl Sample {
    /// Exposes, clips and quantises.
    pub(crate) fn new(panorama: &Panorama, stops: f32) -> Self {
        let mut truth = panorama.clone();
        truth.scale(MIDDLE_GREY / panorama.mean_log_luminance().exp() * stops.exp2());
        let code = |v: f32| (srgb(v.clamp(0.0, 1.0)) * 255.0).round() / 255.0;
        let ldr = LdrPanorama::new(truth.grid(), truth.pixels().iter().map(|p| p.map(code)).collect());
        Self { truth, ldr }
    }

    /// All exposures of all panoramas.
    pub(crate) fn all(panoramas: &[(String, Panorama)]) -> impl Iterator<Item = Self> {
        panoramas.iter().flat_map(|(_, p)| STOPS.map(|stops| Self::new(p, stops)))
    }
}
