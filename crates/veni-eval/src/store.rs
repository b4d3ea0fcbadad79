//! Kept results: one small JSON file per image and setting, so that an evaluation that was stopped goes on where it was.
//!
//! A file is `results/PROTOCOL/NAME-HASH.json` = `{key, value}`. The key says everything that decides the value (model,
//! image, settings, seed); HASH is its digest. Nothing else is trusted: another key, or a file that does not parse, is an
//! error and never a result.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use veni_light::digest::Digest;

use crate::canonical::Canonical;
use crate::{Error, Result};
use veni_light::output::{Overwrite, below, write_atomic};

/// A folder of kept results.
#[derive(Clone, Debug)]
pub struct ResultStore {
    folder: PathBuf,
}

/// What a result belongs to.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// The protocol: the name of a folder.
    pub protocol: &'static str,
    /// What people call it: the beginning of the file's name.
    pub name: String,
    /// Everything that decides the value.
    pub decides: Canonical,
}

#[derive(Serialize, Deserialize)]
struct Kept<T> {
    key: Canonical,
    value: T,
}

impl ResultStore {
    /// Results in `folder`, which is created with the first of them.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into() }
    }

    /// The kept result of a key, if there is one.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read; [`Error::Invalid`] by name if it is damaged or of another key.
    pub fn get<T: DeserializeOwned>(&self, key: &Key) -> Result<Option<T>> {
        let path = self.path(key)?;
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(Error::io(&path, "read", e)),
        };
        let damaged = |why: String| {
            Error::invalid(format!("no kept result ({why}); remove the file to compute it again"))
                .in_file(&path)
        };
        let kept: Kept<T> = serde_json::from_slice(&bytes).map_err(|e| damaged(e.to_string()))?;
        if kept.key != key.decides {
            return Err(damaged("it belongs to other settings".to_owned()));
        }
        Ok(Some(kept.value))
    }

    /// Keeps a result.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be written.
    pub fn put<T: Serialize>(&self, key: &Key, value: &T) -> Result<()> {
        let path = self.path(key)?;
        let folder = path.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
        let kept = Kept { key: key.decides.clone(), value };
        let text = serde_json::to_vec(&kept)
            .map_err(|e| Error::invalid(format!("cannot be written as JSON: {e}")).in_file(&path))?;
        write_atomic(&path, Overwrite::Replace, |file| {
            file.write_all(&text).map_err(|e| Error::io(&path, "write", e))
        })
    }

    /// The file of a key, which is in this folder: a link in it leads elsewhere, and is refused.
    fn path(&self, key: &Key) -> Result<PathBuf> {
        let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let name: String = key.name.chars().map(plain).take(80).collect();
        let hash = Digest::of(key.decides.to_string());
        below(&self.folder, Path::new("results").join(key.protocol).join(format!("{name}-{hash}.json")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn key(steps: u64) -> Key {
        let decides = Canonical::of(json!({ "steps": steps, "rate": 0.1 }));
        Key { protocol: "fit", name: "a sky/α".to_owned(), decides }
    }

    #[test]
    fn results_come_back_to_the_bit_under_their_own_key_only() {
        let folder = tempfile::tempdir().unwrap();
        let store = ResultStore::new(folder.path());
        assert_eq!(store.get::<Vec<f32>>(&key(1)).unwrap(), None);
        let value = vec![0.1f32, -1e-38, 3.402_823e38];
        store.put(&key(1), &value).unwrap();
        assert_eq!(store.get::<Vec<f32>>(&key(1)).unwrap(), Some(value));
        assert_eq!(store.get::<Vec<f32>>(&key(2)).unwrap(), None);
        assert!(store.path(&key(1)).unwrap().starts_with(folder.path().join("results/fit")));
    }

    #[test]
    fn a_damaged_file_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let store = ResultStore::new(folder.path());
        store.put(&key(1), &1.5f32).unwrap();
        let path = store.path(&key(1)).unwrap();
        let whole = fs::read(&path).unwrap();
        fs::write(&path, &whole[..whole.len() - 3]).unwrap();
        let message = store.get::<f32>(&key(1)).unwrap_err().to_string();
        assert!(message.contains("a_sky_α-") && message.contains("remove the file"), "{message}");
        fs::write(&path, String::from_utf8(whole).unwrap().replace("0.1", "0.2")).unwrap();
        assert!(store.get::<f32>(&key(1)).unwrap_err().to_string().contains("other settings"));
    }
}
