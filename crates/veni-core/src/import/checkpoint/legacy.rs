//! `torch.save` before PyTorch 1.6: five pickles (magic number, protocol, system, the object, the keys of its storages),
//! then each storage as its number of elements (64 bits) and the elements. LPIPS's own heads are still such a file.

use std::collections::BTreeMap;

use super::View;
use super::arena::{Arena, Value};
use super::bytes::{array, at};
use super::pickle;
use super::torch::{self, Storage};
use crate::{Error, Result};

/// The first pickle: protocol 2, the number 0x1950a86a20f9469cfc6c, end.
pub(super) const MAGIC: [u8; 15] =
    [0x80, 2, 0x8a, 10, 0x6c, 0xfc, 0x9c, 0x46, 0xf9, 0x20, 0x6a, 0xa8, 0x50, 0x19, b'.'];

/// The tensors of such a file.
pub(super) fn views(file: &[u8]) -> Result<BTreeMap<String, View>> {
    let mut arena = Arena::default();
    let (protocol, position) = pickle::read(file, MAGIC.len(), &mut arena)?;
    if *arena.get(protocol) != Value::Int(1001) {
        return Err(Error::unsupported(
            "an unknown protocol of torch.save: convert the weights to safetensors",
        ));
    }
    let (_, position) = pickle::read(file, position, &mut arena)?;
    let first = arena.len();
    let (root, position) = pickle::read(file, position, &mut arena)?;
    let described: BTreeMap<_, _> = (first..arena.len())
        .filter_map(|id| torch::storage(&arena, id))
        .map(|s| (s.key.to_owned(), s))
        .collect();
    let mut list = Arena::default();
    let (keys, mut position) = pickle::read(file, position, &mut list)?;
    let Value::Sequence(keys) = list.get(keys) else {
        return Err(Error::invalid("the list of storages is missing"));
    };
    let mut places = BTreeMap::new();
    for key in keys {
        let Value::Text(key) = list.get(*key) else {
            return Err(Error::invalid("a storage has no name"));
        };
        let Some(Storage { element, count, .. }) = described.get(key) else {
            return Err(Error::invalid(format!("storage {key} belongs to no tensor")));
        };
        let stored = u64::from_le_bytes(array(file, position)?);
        if stored != *count as u64 {
            return Err(Error::invalid(format!("storage {key} has {stored} elements, not {count}")));
        }
        let start = position + 8;
        let bytes = count.checked_mul(element.bytes()).unwrap_or(usize::MAX);
        at(file, start, bytes)?;
        places.insert(key.clone(), start..start + bytes);
        position = start + bytes;
    }
    torch::views(&arena, root, &|key| places.get(key).cloned())
}
