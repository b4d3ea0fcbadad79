//! Output files: what is checked before any work, and rows written to several files at once.

use std::collections::HashSet;
use std::fs::OpenOptions;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow, bail};
use veni_image::{WriteOptions, write_rows};
use veni_light::Error;
use veni_light::output::{self, Overwrite, process_token};
use veni_light::sphere::Equirect;

/// Attribute of a baked image: the latent's JSON.
pub(crate) const LATENT: &str = "veni:latent";
/// Attribute: hash of the model that decoded it.
pub(crate) const MODEL: &str = "veni:model";
/// Attribute: which axes other software gives the directions.
pub(crate) const FRAME: &str = "veni:frame";
/// Attribute of a cube map: its faces from top to bottom.
pub(crate) const CUBE_FACES: &str = "veni:cubeFaces";

/// Attribute of a generated scene: its parameters. Its unit is kcd/m².
pub(crate) const SCENE: &str = "veni:scene";

/// Attribute of a rendered image and of its normals: the camera (`veni_fit::shade::Camera`).
pub(crate) const CAMERA: &str = "veni:camera";
/// Attribute of a rendered image: what the surface is made of.
pub(crate) const MATERIAL: &str = "veni:material";

/// Refuses, before any work, what could not be written after it: a file that exists, a name without one of
/// `extensions`, a folder that is missing or cannot be written to, a name given twice.
pub(crate) fn check(paths: &[PathBuf], extensions: &[&str], overwrite: Overwrite) -> Result<()> {
    check_distinct(paths)?;
    let mut probed = HashSet::new();
    for path in paths {
        if path.as_os_str().as_encoded_bytes().last().is_some_and(|b| std::path::is_separator(char::from(*b)))
        {
            bail!("{}: ends as a folder's name does; name a file", path.display());
        }
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        if !extension.as_deref().is_some_and(|e| extensions.contains(&e)) {
            bail!("{}: the name must end in .{}", path.display(), extensions.join(" or ."));
        }
        if path.is_dir() {
            bail!("{}: is a folder; name a file in it", path.display());
        }
        refuse_existing(path, overwrite)?;
        if probed.insert(folder_of(path)) {
            writable(folder_of(path), path)?;
        }
    }
    Ok(())
}

/// Creates a folder for results unless it is there; several processes may do so at once.
pub(crate) fn create_folder(folder: &Path) -> Result<()> {
    if !folder.exists() {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
    }
    Ok(())
}

/// The file in `folder` that is called like `input`, with another extension.
pub(crate) fn named(folder: &Path, input: &Path, extension: &str) -> Result<PathBuf> {
    let Some(stem) = input.file_stem() else { bail!("{}: is not a file name", input.display()) };
    let mut name = stem.to_owned();
    name.push(".");
    name.push(extension);
    Ok(folder.join(name))
}

/// The folder that holds `path`.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    }
}

/// Refuses two outputs of one name.
pub(crate) fn check_distinct(paths: &[PathBuf]) -> Result<()> {
    let mut known = HashSet::new();
    match paths.iter().find(|path| !known.insert(place(path))) {
        Some(path) => bail!("{}: would be written twice; leave one out or rename it", path.display()),
        None => Ok(()),
    }
}

/// Where a name leads, whichever way it is written.
fn place(path: &Path) -> PathBuf {
    match (path.file_name(), folder_of(path).canonicalize()) {
        (Some(name), Ok(folder)) => folder.join(name),
        _ => path.to_path_buf(),
    }
}

/// Begins the names of files that are made for a moment to see whether a folder takes any.
pub(crate) const PROBE: &str = ".veni-cli-";

/// Creates and removes an empty file: permissions alone do not say whether a file system is writable.
pub(crate) fn writable(folder: &Path, wanted: &Path) -> Result<()> {
    match folder.metadata() {
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            bail!("{}: there is no folder {}; create it first", wanted.display(), folder.display())
        }
        Err(e) => return Err(Error::io(folder, "look into", e).into()),
        Ok(meta) if !meta.is_dir() => {
            bail!("{}: {} is a file, not a folder; name another place", wanted.display(), folder.display())
        }
        Ok(_) => {}
    }
    let probe = folder.join(format!("{PROBE}{:016x}.probe", process_token()));
    match OpenOptions::new().write(true).create_new(true).open(&probe) {
        Ok(_) => {
            // an empty file that stays behind is not worth failing for
            let _ = std::fs::remove_file(&probe);
            Ok(())
        }
        Err(e) => bail!(
            "{}: cannot create files in {} ({e}); make it writable or name another folder",
            wanted.display(),
            folder.display()
        ),
    }
}

/// Refuses a file that exists and may not be replaced, and says which option replaces it.
pub(crate) fn refuse_existing(path: &Path, overwrite: Overwrite) -> Result<()> {
    output::refuse_existing(path, overwrite).map_err(with_remedy)
}

/// What can be done about a file with several layers.
pub(crate) const CHOOSE_LAYER: &str = "--layer NAME chooses one";

/// Adds what can be done here, of which the library knows nothing.
pub(crate) fn with_remedy(error: Error) -> anyhow::Error {
    let remedy = match &error {
        Error::Exists { .. } => return anyhow!("{error}; --force replaces it"),
        Error::Layers { .. } => return anyhow!("{error}; {CHOOSE_LAYER}"),
        Error::Busy { .. } => return anyhow!("{error}; wait until it has ended, or name another folder"),
        Error::LowRange { .. } => return anyhow!("{error}, as 'veni-cli prepare' does"),
        Error::Io { action: "write", source, .. } => match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                "free some space or name another disk"
            }
            io::ErrorKind::FileTooLarge => "bake a smaller size or raise the limit on file sizes",
            io::ErrorKind::PermissionDenied => "make the folder writable or name another one",
            // some encoders hide the kind
            _ => "check free space, quota and limits, or name another disk",
        },
        _ => return error.into(),
    };
    anyhow!("{}; nothing was kept of this file: {remedy}", error.with_source())
}

/// Takes rows of linear radiance from the top down.
pub(crate) type Push<'a> = &'a mut dyn FnMut(&[[f32; 3]]) -> veni_light::Result<()>;

/// Writes one image to several files in one pass: what `produce` pushes goes to all of them.
///
/// Every file is complete or absent; if a later one fails, an earlier one may stay.
pub(crate) fn write_all(
    files: &[(PathBuf, WriteOptions)],
    grid: Equirect,
    produce: &mut dyn FnMut(Push<'_>) -> veni_light::Result<()>,
) -> veni_light::Result<()> {
    // writers put their own path before an error that passes through them; the first one said is the true one
    let mut first = None;
    let result = nest(files, grid, &mut |_| Ok(()), produce, &mut first);
    first.map_or(result, Err)
}

fn nest(
    files: &[(PathBuf, WriteOptions)],
    grid: Equirect,
    outer: Push<'_>,
    produce: &mut dyn FnMut(Push<'_>) -> veni_light::Result<()>,
    first: &mut Option<Error>,
) -> veni_light::Result<()> {
    let Some(((path, options), rest)) = files.split_first() else {
        return keep(produce(outer), first);
    };
    let result = write_rows(path, grid, options, |sink| {
        let mut push = |rows: &[[f32; 3]]| {
            outer(rows)?;
            sink.push(rows).map_err(|e| e.in_file(path))
        };
        nest(rest, grid, &mut push, produce, first)
    });
    keep(result, first)
}

/// Moves an error to `first` unless there is one, and leaves a stand-in that only says "stop".
fn keep(result: veni_light::Result<()>, first: &mut Option<Error>) -> veni_light::Result<()> {
    result.map_err(|error| {
        first.get_or_insert(error);
        Error::invalid("stopped")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use veni_image::{Panorama, Precision, WriteFormat};

    fn options() -> WriteOptions {
        WriteOptions::new(WriteFormat::Exr(Precision::Float))
    }

    #[test]
    fn rows_go_to_every_file() {
        let folder = tempfile::tempdir().unwrap();
        let files: Vec<_> = ["a.exr", "b.exr", "c.exr"].map(|n| (folder.path().join(n), options())).into();
        let image = Panorama::from_fn(Equirect::new(8, 4), |[x, y, z]| [2.0 + x, 2.0 + y, 2.0 + z]);
        write_all(&files, image.grid(), &mut |push| image.pixels().chunks(8).try_for_each(&mut *push))
            .unwrap();
        for (path, _) in &files {
            assert_eq!(Panorama::read(path).unwrap().pixels(), image.pixels());
        }
    }

    #[test]
    fn one_place_is_not_written_twice() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("sub")).unwrap();
        let at = |name: &str| folder.path().join(name);
        for other in ["a.exr", "./a.exr", "sub/../a.exr"] {
            let message = check_distinct(&[at("a.exr"), at(other)]).unwrap_err().to_string();
            assert!(message.contains("written twice"), "{message}");
        }
        check_distinct(&[at("a.exr"), at("sub/a.exr"), at("no/a.exr"), at("no/b.exr")]).unwrap();
        let message = check(&[at("a.exr/")], &["exr"], Overwrite::Refuse).unwrap_err().to_string();
        assert!(message.contains("a.exr/: ends as a folder"), "{message}");
    }

    #[test]
    fn a_failing_file_is_named_alone() {
        let folder = tempfile::tempdir().unwrap();
        let files: Vec<_> =
            ["a.exr", "missing/b.exr", "c.exr"].map(|n| (folder.path().join(n), options())).into();
        let row = [[1.0; 3]; 8];
        let error = write_all(&files, Equirect::new(8, 4), &mut |push| (0..4).try_for_each(|_| push(&row)));
        let text = error.unwrap_err().to_string();
        assert!(text.contains("b.exr") && !text.contains("a.exr") && !text.contains("c.exr"), "{text}");
        assert!(!files[0].0.exists());
    }
}
