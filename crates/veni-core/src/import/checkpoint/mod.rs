//! Named tensors from a file that a user has: safetensors, or what `torch.save` writes.
//!
//! PyTorch's files are a pickle that describes dictionaries of tensors, and raw storages the tensors are views of:
//! inside a zip archive (since PyTorch 1.6), or one after the other (before). Only what is asked for is copied.

mod arena;
mod bytes;
mod legacy;
mod pickle;
#[cfg(test)]
mod tests;
mod torch;
mod zip;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use half::{bf16, f16};
use safetensors::tensor::{Dtype, SafeTensors};

use crate::limits::MAX_WEIGHTS_BYTES;
use crate::{Error, Result};
use veni_light::limits::read_file;
use veni_light::model::Array;

/// A tensor as a view of its file.
#[derive(Clone, Debug, PartialEq)]
struct View {
    element: Element,
    /// Bytes of the storage it looks into.
    storage: Range<usize>,
    /// First element within the storage.
    offset: usize,
    shape: Vec<usize>,
    strides: Vec<usize>,
}

/// The type of a storage's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Element {
    F64,
    F32,
    F16,
    Bf16,
    /// Integers and others, of this many bytes; never a weight.
    Other(usize),
}

impl Element {
    fn bytes(self) -> usize {
        match self {
            Self::F64 => 8,
            Self::F32 => 4,
            Self::F16 | Self::Bf16 => 2,
            Self::Other(bytes) => bytes,
        }
    }
}

/// The tensors of one file, by dotted path.
#[derive(Debug)]
pub struct Checkpoint {
    file: Vec<u8>,
    views: BTreeMap<String, View>,
}

impl Checkpoint {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read; [`Error::Invalid`] and [`Error::Unsupported`] by name if it is none of the
    /// formats, or damaged.
    pub fn open(path: &Path) -> Result<Self> {
        let bytes = read_file(path, "a file of LPIPS weights", MAX_WEIGHTS_BYTES)?;
        Self::from_bytes(bytes).map_err(|e| e.in_file(path))
    }

    /// The same from a file's bytes.
    fn from_bytes(file: Vec<u8>) -> Result<Self> {
        let views = if file.starts_with(b"PK") {
            torch::views_of_archive(&file)?
        } else if file.starts_with(&legacy::MAGIC) {
            legacy::views(&file)?
        } else {
            safetensors_views(&file)?
        };
        Ok(Self { file, views })
    }

    /// The names of all tensors.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.views.keys().map(String::as_str)
    }

    /// One tensor, contiguous, as f32.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is absent, reaches outside of its storage or is not finite; [`Error::Unsupported`] if
    /// it does not hold floating-point numbers.
    pub fn tensor(&self, name: &str) -> Result<Array> {
        let view =
            self.views.get(name).ok_or_else(|| Error::invalid(format!("there is no tensor {name}")))?;
        let View { element, shape, strides, .. } = view;
        let outside = || Error::invalid(format!("tensor {name} {shape:?} reaches outside of its storage"));
        let count = shape.iter().try_fold(1usize, |n, d| n.checked_mul(*d)).ok_or_else(outside)?;
        let available = view.storage.len() / element.bytes();
        let last = shape.iter().zip(strides).try_fold(view.offset, |at, (d, s)| {
            d.saturating_sub(1).checked_mul(*s).and_then(|step| at.checked_add(step))
        });
        if count > available || (count > 0 && last.is_none_or(|last| last >= available)) {
            return Err(outside());
        }
        let storage = &self.file[view.storage.clone()];
        let mut data = Vec::with_capacity(count);
        let mut index = vec![0; shape.len()];
        for _ in 0..count {
            let at = view.offset + index.iter().zip(strides).map(|(i, s)| i * s).sum::<usize>();
            data.push(number(storage, at, *element).ok_or_else(|| {
                Error::unsupported(format!("tensor {name} holds integers, not floating-point numbers"))
            })?);
            for (i, size) in index.iter_mut().zip(shape).rev() {
                *i += 1;
                if *i < *size {
                    break;
                }
                *i = 0;
            }
        }
        match data.iter().position(|v| !v.is_finite()) {
            Some(at) => Err(Error::invalid(format!("tensor {name}: value {at} is {}", data[at]))),
            None => Ok(Array { shape: shape.clone(), data }),
        }
    }
}

/// Element `at` of a storage as f32; the caller has checked that it is inside.
fn number(storage: &[u8], at: usize, element: Element) -> Option<f32> {
    let bytes = &storage[at * element.bytes()..][..element.bytes()];
    match element {
        Element::F64 => bytes.as_array().map(|b| f64::from_le_bytes(*b) as f32),
        Element::F32 => bytes.as_array().map(|b| f32::from_le_bytes(*b)),
        Element::F16 => bytes.as_array().map(|b| f16::from_le_bytes(*b).to_f32()),
        Element::Bf16 => bytes.as_array().map(|b| bf16::from_le_bytes(*b).to_f32()),
        Element::Other(_) => None,
    }
}

fn safetensors_views(file: &[u8]) -> Result<BTreeMap<String, View>> {
    let tensors = SafeTensors::deserialize(file).map_err(|e| {
        Error::invalid(format!("neither a safetensors file ({e}) nor one that torch.save has written"))
    })?;
    let start = file.as_ptr() as usize;
    let view = |(name, tensor): (&str, safetensors::tensor::TensorView<'_>)| {
        let element = match tensor.dtype() {
            Dtype::F64 => Element::F64,
            Dtype::F32 => Element::F32,
            Dtype::F16 => Element::F16,
            Dtype::BF16 => Element::Bf16,
            _ => Element::Other(1),
        };
        let shape = tensor.shape().to_vec();
        let first = tensor.data().as_ptr() as usize - start;
        let strides = contiguous(&shape);
        (
            name.to_owned(),
            View { element, storage: first..first + tensor.data().len(), offset: 0, shape, strides },
        )
    };
    Ok(tensors.iter().map(view).collect())
}

/// Row-major strides.
fn contiguous(shape: &[usize]) -> Vec<usize> {
    let mut strides = vec![1usize; shape.len()];
    for d in (1..shape.len()).rev() {
        strides[d - 1] = strides[d].saturating_mul(shape[d]);
    }
    strides
}
