//! The files of a set: what exists, what is missing, and how a scene is written.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use veni_image::{
    HALF_ERROR, HalfRange, Panorama, Precision, WriteFormat, WriteOptions, attributes, half_error,
};
use veni_light::Error;
use veni_light::output::Overwrite;
use veni_light::sphere::Equirect;
use veni_synth::Scene;

use crate::output::{SCENE, create_folder, refuse_existing, writable};

/// Attribute: columns x rows.
const SIZE: &str = "veni:size";
/// Half precision is used so that the geometric mean of a scene comes out near this.
const MIDDLE: f32 = 0.25;
/// The largest power of two that leaves a finite half-precision number.
const HALF_MAX: f32 = 65504.0;

/// Where a set goes.
pub(super) struct Files {
    folder: PathBuf,
    precision: Precision,
    overwrite: Overwrite,
    resume: bool,
}

impl Files {
    /// Creates the folder; refuses files of `indices` that exist unless they may be replaced or kept.
    pub(super) fn open(
        folder: &Path,
        mut indices: impl Iterator<Item = u64>,
        precision: Precision,
        overwrite: Overwrite,
        resume: bool,
    ) -> Result<Self> {
        let this = Self { folder: folder.to_path_buf(), precision, overwrite, resume };
        make(folder)?;
        writable(folder, folder)?;
        if !resume {
            let refused = indices.find_map(|index| refuse_existing(&this.path(index), overwrite).err());
            if let Some(e) = refused {
                bail!("{e}, --resume keeps it and writes what is missing");
            }
        }
        Ok(this)
    }

    fn path(&self, index: u64) -> PathBuf {
        self.folder.join(format!("synth-{index:06}.exr"))
    }

    /// Whether a scene has still to be written. With `--resume` a file that exists must hold this very scene.
    pub(super) fn wanted(&self, scene: &Scene, grid: Equirect) -> Result<bool> {
        let path = self.path(scene.index);
        if !self.resume || !path.exists() {
            return Ok(true);
        }
        let found = attributes(&path)?;
        if found.get(SCENE) == Some(&json(scene)?) && found.get(SIZE) == Some(&size(grid)) {
            return Ok(false);
        }
        bail!(
            "{}: does not belong to this data set (another seed, size or option); name another folder, or --force replaces it",
            path.display()
        )
    }

    /// Writes one panorama, unless it was found already.
    pub(super) fn write(&self, scene: &Scene, panorama: &Panorama) -> veni_light::Result<()> {
        let path = self.path(scene.index);
        if self.resume && path.exists() {
            return Ok(());
        }
        let factor = scale(panorama);
        // a scene that is wider than half precision stays whole
        let keeps = || half_error(panorama.pixels(), factor) <= HALF_ERROR;
        let half = self.precision == Precision::Half && keeps();
        let mut options =
            WriteOptions::new(WriteFormat::Exr(if half { Precision::Half } else { Precision::Float }));
        options.overwrite = self.overwrite;
        if half {
            options.half_range = HalfRange::Factor(factor);
        }
        options.attributes.insert(SCENE.to_owned(), json(scene)?);
        options.attributes.insert(SIZE.to_owned(), size(panorama.grid()));
        panorama.write(&path, &options)
    }
}

/// Creates the folder unless it is there. In this order: another shard may make it between any two questions.
fn make(folder: &Path) -> Result<()> {
    create_folder(folder)?;
    if !folder.is_dir() {
        bail!("{}: is a file; name a folder", folder.display());
    }
    Ok(())
}

fn json(scene: &Scene) -> veni_light::Result<String> {
    serde_json::to_string(scene).map_err(|e| Error::invalid(format!("scene {}: {e}", scene.index)))
}

fn size(grid: Equirect) -> String {
    format!("{}x{}", grid.width, grid.height)
}

/// The power of two that brings a scene into the middle of half precision without losing its brightest pixel.
fn scale(panorama: &Panorama) -> f32 {
    let brightest = panorama.pixels().as_flattened().iter().copied().fold(0f32, f32::max);
    let wanted = (MIDDLE / panorama.mean_log_luminance().exp()).log2().round();
    wanted.min((HALF_MAX / brightest).log2().floor()).exp2()
}

#[cfg(test)]
mod tests {
    use std::sync::Barrier;

    use super::*;

    /// All shards of a command begin at once, and one of them is the first to make the folder.
    #[test]
    fn shards_that_begin_at_once_share_a_new_folder() {
        let dir = tempfile::tempdir().unwrap();
        for round in 0..500 {
            let (folder, barrier) = (dir.path().join(round.to_string()), Barrier::new(4));
            std::thread::scope(|scope| {
                for _ in 0..4 {
                    scope.spawn(|| {
                        barrier.wait();
                        make(&folder).unwrap();
                    });
                }
            });
        }
    }
}
