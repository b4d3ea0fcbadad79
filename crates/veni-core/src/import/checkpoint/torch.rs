//! From a PyTorch pickle to tensors: dictionaries become dotted paths, `_rebuild_tensor_v2` becomes a view.

use std::collections::BTreeMap;
use std::ops::Range;

use super::arena::{Arena, Id, Value};
use super::pickle;
use super::{Element, View, zip};
use crate::limits::{MAX_WEIGHTS_ENTRIES, MAX_WEIGHTS_NESTING};
use crate::{Error, Result};

/// The tensors of a file in the zip format.
pub(super) fn views_of_archive(file: &[u8]) -> Result<BTreeMap<String, View>> {
    let entries = zip::entries(file)?;
    let pickle = entries.get("data.pkl").ok_or_else(|| {
        Error::unsupported("a zip archive without data.pkl: not a file that torch.save has written")
    })?;
    if let Some(order) = entries.get("byteorder").filter(|r| file[(*r).clone()].trim_ascii() != b"little") {
        let order = String::from_utf8_lossy(&file[order.clone()]).into_owned();
        return Err(Error::unsupported(format!("byte order {order}: convert the weights to safetensors")));
    }
    let mut arena = Arena::default();
    let (root, _) = pickle::read(&file[pickle.clone()], 0, &mut arena)?;
    views(&arena, root, &|key| entries.get(&format!("data/{key}")).cloned())
}

/// A storage as the pickle names it: ('storage', type, key, location, number of elements).
pub(super) struct Storage<'a> {
    pub(super) key: &'a str,
    pub(super) element: Element,
    pub(super) count: usize,
}

/// All tensors below `root`, with the bytes of a storage from `locate`.
pub(super) fn views(
    arena: &Arena,
    root: Id,
    locate: &dyn Fn(&str) -> Option<Range<usize>>,
) -> Result<BTreeMap<String, View>> {
    let (mut found, mut left) = (BTreeMap::new(), MAX_WEIGHTS_ENTRIES);
    walk(arena, root, String::new(), 0, &mut |name, id| {
        left = left.checked_sub(1).ok_or_else(|| Error::invalid("more than a million entries"))?;
        if let Some(view) =
            tensor(arena, id, locate).map_err(|e| Error::invalid(format!("tensor {name}: {e}")))?
        {
            found.insert(name, view);
        }
        Ok(())
    })?;
    Ok(found)
}

fn walk(
    arena: &Arena,
    id: Id,
    path: String,
    depth: usize,
    leaf: &mut dyn FnMut(String, Id) -> Result<()>,
) -> Result<()> {
    let Value::Map(entries) = arena.get(id) else { return leaf(path, id) };
    for (key, value) in entries {
        // optimiser states are keyed by numbers
        let Value::Text(key) = arena.get(*key) else { continue };
        let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        if depth < MAX_WEIGHTS_NESTING {
            walk(arena, *value, path, depth + 1, leaf)?;
        }
    }
    Ok(())
}

/// The view that a value is, if it is a tensor.
fn tensor(arena: &Arena, id: Id, locate: &dyn Fn(&str) -> Option<Range<usize>>) -> Result<Option<View>> {
    let Value::Call(function, arguments) = arena.get(id) else { return Ok(None) };
    let arguments = items(arena, *arguments);
    match (function.as_str(), arguments) {
        // (tensor, requires_grad, hooks); a parameter of a parameter does not exist
        ("torch._utils _rebuild_parameter", [inner, ..]) if *inner != id => match arena.get(*inner) {
            Value::Call(function, _) if function.starts_with("torch._utils _rebuild_tensor") => {
                tensor(arena, *inner, locate)
            }
            _ => Ok(None),
        },
        (
            "torch._utils _rebuild_tensor" | "torch._utils _rebuild_tensor_v2",
            [stored, offset, shape, strides, ..],
        ) => {
            let stored =
                storage(arena, *stored).ok_or_else(|| Error::invalid("its storage is not described"))?;
            let located = locate(stored.key)
                .ok_or_else(|| Error::invalid(format!("storage {} is missing from the file", stored.key)))?;
            let sizes = |id: Id| items(arena, id).iter().map(|i| size(arena, *i)).collect::<Option<Vec<_>>>();
            let parts = (size(arena, *offset), sizes(*shape), sizes(*strides));
            let (Some(offset), Some(shape), Some(strides)) = parts else {
                return Err(Error::invalid("its shape is not described"));
            };
            if shape.len() != strides.len() {
                return Err(Error::invalid(format!("shape {shape:?} with strides {strides:?}")));
            }
            Ok(Some(View { element: stored.element, storage: located, offset, shape, strides }))
        }
        _ => Ok(None),
    }
}

/// What a persistent identifier says.
pub(super) fn storage(arena: &Arena, id: Id) -> Option<Storage<'_>> {
    let Value::Persistent(id) = arena.get(id) else { return None };
    let [tag, kind, key, _, count, ..] = items(arena, *id) else { return None };
    let (Value::Text(tag), Value::Global(kind), Value::Text(key)) =
        (arena.get(*tag), arena.get(*kind), arena.get(*key))
    else {
        return None;
    };
    (tag == "storage").then_some(Storage { key, element: element(kind)?, count: size(arena, *count)? })
}

fn element(kind: &str) -> Option<Element> {
    let kind = kind.strip_prefix("torch.cuda ").or_else(|| kind.strip_prefix("torch "))?;
    Some(match kind {
        "DoubleStorage" => Element::F64,
        "FloatStorage" => Element::F32,
        "HalfStorage" => Element::F16,
        "BFloat16Storage" => Element::Bf16,
        "LongStorage" => Element::Other(8),
        "IntStorage" => Element::Other(4),
        "ShortStorage" => Element::Other(2),
        "CharStorage" | "ByteStorage" | "BoolStorage" => Element::Other(1),
        _ => return None,
    })
}

fn items(arena: &Arena, id: Id) -> &[Id] {
    match arena.get(id) {
        Value::Sequence(items) => items,
        _ => &[],
    }
}

fn size(arena: &Arena, id: Id) -> Option<usize> {
    match arena.get(id) {
        Value::Int(value) => usize::try_from(*value).ok(),
        _ => None,
    }
}
