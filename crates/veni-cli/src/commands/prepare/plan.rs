//! `plan.json`: where prepared images lie. Somebody else may have made it: its names are those of prepared images, or refused.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use veni_data::prepare::Split;
use veni_light::Error;
use veni_light::output::below;

/// The folder of what is remembered.
pub(super) const OWN: &str = ".prepare";
/// The file in it that is locked.
pub(super) const LOCK: &str = "lock";

/// Where each image is, or is being moved, by its id.
pub(super) type Plan = BTreeMap<String, Vec<String>>;

/// The path of a prepared image, `SPLIT/NAME.exr` below `root`.
pub(super) fn checked(root: &Path, place: &str) -> Result<PathBuf> {
    let path = below(root, place)?;
    let name = Path::new(place);
    let folder = name.parent().and_then(Path::to_str);
    let is_split = Split::ALL.iter().any(|split| folder == Some(split.folder()));
    if !is_split || name.extension().is_none_or(|e| e != "exr") {
        bail!(
            "{}: is not the name of a prepared image (train/…, val/… or test/… .exr); nothing was touched",
            path.display()
        );
    }
    Ok(path)
}

/// Refuses what is not an image's id, of which names of files are made.
pub(super) fn check_id(file: &Path, id: &str) -> Result<()> {
    if id.len() != 16 || !id.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b)) {
        bail!("{}: names an image {id:?}, which is not a hash; nothing was touched", file.display());
    }
    Ok(())
}

/// The plan that an earlier run left, all of whose places are below the folder.
pub(super) fn read(root: &Path) -> Result<Plan> {
    let path = root.join(OWN).join("plan.json");
    let bytes = match fs::read(&path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Plan::new()),
        Err(e) => return Err(Error::io(&path, "read", e).into()),
    };
    let plan: Plan = serde_json::from_slice(&bytes).with_context(|| {
        format!(
            "{}: damaged, so that nobody knows which images an earlier run made; name another folder",
            path.display()
        )
    })?;
    for (id, names) in &plan {
        check_id(&path, id)?;
        for name in names {
            checked(root, name).with_context(|| path.display().to_string())?;
        }
    }
    Ok(plan)
}

/// Removes all that was written here, and nothing else; the lock stays.
pub(super) fn clear(root: &Path, plan: &Plan) -> Result<()> {
    for place in plan.values().flatten() {
        remove(&checked(root, place)?)?;
    }
    let own = root.join(OWN);
    for entry in fs::read_dir(&own).map_err(|e| Error::io(&own, "list", e))? {
        let path = entry.map_err(|e| Error::io(&own, "list", e))?.path();
        if path.file_name().is_some_and(|name| name == LOCK) {
            continue;
        }
        let is_folder = path.symlink_metadata().is_ok_and(|meta| meta.is_dir());
        let removed = if is_folder { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
        removed.map_err(|e| Error::io(&path, "remove", e))?;
    }
    Ok(())
}

/// Removes a file if it is there.
pub(super) fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(path, "remove", e).into()),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_prepared_images_are_touched() {
        let root = tempfile::tempdir().unwrap();
        assert_eq!(checked(root.path(), "val/a b.exr").unwrap(), root.path().join("val/a b.exr"));
        for name in [
            "../a.exr",
            "/a.exr",
            "train/../../a.exr",
            "notes.txt",
            "train/a.txt",
            "a.exr",
            "train/x/a.exr",
            "train",
        ] {
            assert!(checked(root.path(), name).is_err(), "{name}");
        }
        let file = Path::new("plan.json");
        check_id(file, "0123456789abcdef").unwrap();
        for id in ["0000", "", "../../../victim", "0123456789ABCDEF", "0123456789abcdef0"] {
            assert!(check_id(file, id).unwrap_err().to_string().contains("plan.json"), "{id}");
        }
    }
}
