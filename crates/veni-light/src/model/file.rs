//! Reading and writing the weight file.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, View};

use super::{Array, Model, half, header};
use crate::limits::{MAX_MODEL_HEADER_BYTES, at_most, read_file};
use crate::output::{Overwrite, write_atomic};
use crate::{Error, Result};

pub use crate::limits::MAX_MODEL_BYTES as MAX_FILE_BYTES;

/// How weights are stored. In memory they are always f32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoredType {
    /// Half precision: half the size, for shipping.
    F16,
    /// Single precision: exact, for training.
    F32,
}

impl Model {
    /// Reads a model file.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read; [`Error::TooLarge`] beyond a limit of [`crate::limits`]; [`Error::Invalid`]
    /// if it is not a safetensors file, has no `veni` header, or fails a check of [`Model::new`];
    /// [`Error::Unsupported`] for an unknown format, frame or stored type.
    pub fn load(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let bytes = read_file(path, "a veni model", MAX_FILE_BYTES)?;
        Self::from_bytes(&bytes).map_err(|e| e.in_file(path))
    }

    /// Reads a model from the bytes of its file.
    ///
    /// # Errors
    /// As [`Model::load`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        if bytes.len() as u64 > MAX_FILE_BYTES {
            return Err(Error::beyond(
                format!("larger than {} MiB, not a veni model", MAX_FILE_BYTES >> 20),
                bytes.len() as u64,
                MAX_FILE_BYTES,
            ));
        }
        let header = bytes.first_chunk().map_or(0, |length| u64::from_le_bytes(*length));
        if header <= bytes.len() as u64 {
            at_most("bytes of header", header, MAX_MODEL_HEADER_BYTES)?;
        }
        let broken = |e| Error::invalid(format!("not a complete safetensors file ({e})"));
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(broken)?;
        let entry = metadata.metadata().as_ref().and_then(|entries| entries.get("veni"));
        let json = entry.ok_or_else(|| {
            Error::invalid("not a veni model file: safetensors without a `veni` header entry")
        })?;
        let (config, info) = header::from_json(json)?;
        let file = SafeTensors::deserialize(bytes).map_err(broken)?;
        let mut tensors = BTreeMap::new();
        for (name, view) in file.iter() {
            let data = match view.dtype() {
                Dtype::F32 => values(view.data(), f32::from_le_bytes),
                Dtype::F16 => values(view.data(), |bytes| half::to_f32(u16::from_le_bytes(bytes))),
                other => {
                    return Err(Error::unsupported(format!(
                        "tensor {name} is stored as {other:?}; F32 or F16 is read"
                    )));
                }
            };
            tensors.insert(name.to_owned(), Array { shape: view.shape().to_vec(), data });
        }
        Self::new(config, tensors, info)
    }

    /// Writes the model to `path`, all or nothing.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the file exists and may not be replaced, or a value does not fit half precision;
    /// [`Error::Io`] if it cannot be written.
    pub fn save(&self, path: impl AsRef<Path>, stored: StoredType, overwrite: Overwrite) -> Result<()> {
        let path = path.as_ref();
        let bytes = self.to_bytes(stored).map_err(|e| e.in_file(path))?;
        write_atomic(path, overwrite, |file| file.write_all(&bytes).map_err(|e| Error::io(path, "write", e)))
    }

    /// The bytes [`Model::save`] writes.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a value does not fit half precision.
    pub fn to_bytes(&self, stored: StoredType) -> Result<Vec<u8>> {
        let mut parts = Vec::with_capacity(self.tensors.len());
        for (name, tensor) in &self.tensors {
            let (dtype, bytes) = match stored {
                StoredType::F32 => (Dtype::F32, tensor.data.iter().flat_map(|v| v.to_le_bytes()).collect()),
                StoredType::F16 => (Dtype::F16, halves(name, &tensor.data)?),
            };
            parts.push((name, Part { dtype, shape: &tensor.shape, bytes }));
        }
        let json = header::to_json(&self.config, &self.info, super::prior::has_sun(&self.tensors))?;
        // collected: the map's type is the standard library's only where some other crate asks safetensors for it
        safetensors::serialize(parts, Some([("veni".to_owned(), json)].into_iter().collect()))
            .map_err(|e| Error::invalid(format!("the model cannot be written: {e}")))
    }
}

fn values<const B: usize>(bytes: &[u8], decode: impl Fn([u8; B]) -> f32) -> Vec<f32> {
    // safetensors has checked that the length is shape × size
    bytes.as_chunks::<B>().0.iter().map(|chunk| decode(*chunk)).collect()
}

fn halves(name: &str, data: &[f32]) -> Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(2 * data.len());
    for (at, value) in data.iter().enumerate() {
        let half = half::from_f32(*value);
        if !half::to_f32(half).is_finite() {
            return Err(Error::invalid(format!(
                "tensor {name}: value {at} is {value}, beyond half precision (65504); store f32"
            )));
        }
        bytes.extend(half.to_le_bytes());
    }
    Ok(bytes)
}

struct Part<'a> {
    dtype: Dtype,
    shape: &'a [usize],
    bytes: Vec<u8>,
}

impl View for Part<'_> {
    fn dtype(&self) -> Dtype {
        self.dtype
    }

    fn shape(&self) -> &[usize] {
        self.shape
    }

    fn data(&self) -> Cow<'_, [u8]> {
        Cow::Borrowed(&self.bytes)
    }

    fn data_len(&self) -> usize {
        self.bytes.len()
    }
}
