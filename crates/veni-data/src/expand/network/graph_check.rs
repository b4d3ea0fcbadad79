//! What is asked of an ONNX graph before the runtime sees it (onnx.proto3, IR version 13): messages that lie within each
//! other, constants of the size they claim, values that are made once and before they are used, numbers of a plausible size.

use std::collections::HashSet;

use super::wire::{Field, Fields, numbers};
use crate::limits::{MAX_ONNX_CONSTANT, MAX_ONNX_NESTING, MAX_ONNX_NODES, MAX_ONNX_PADDING, MAX_ONNX_STRIDE};
use crate::{Error, Result};
use veni_light::limits::at_most;

/// Attributes that are multiplied with an image's size, and those that are added to it.
const STRIDES: [&[u8]; 2] = [b"strides", b"dilations"];
const PADDING: [&[u8]; 4] = [b"pads", b"kernel_shape", b"output_padding", b"output_shape"];
/// Operators that make as much as a constant among their inputs asks for: the place of that input.
const GROWING: [(&[u8], usize); 3] = [(b"ConstantOfShape", 0), (b"Expand", 1), (b"Tile", 1)];
/// Operators that run a graph of their own until it says stop.
const ENDLESS: [&[u8]; 2] = [b"Loop", b"Scan"];

/// # Errors
/// [`Error::Invalid`] for damage, [`Error::TooLarge`] beyond the limits, [`Error::Unsupported`] for loops.
pub(super) fn check(file: &[u8]) -> Result<()> {
    let mut left = MAX_ONNX_NODES;
    for field in Fields::of(file) {
        if let (7, Field::Bytes(graph)) = field.ok_or_else(damaged)? {
            Graph::read(graph, 0, &mut left)?.check(&[])?;
        }
    }
    Ok(())
}

fn damaged() -> Error {
    Error::invalid("is not an ONNX model, or damaged: a part of it ends beyond its whole")
}

#[derive(Default)]
struct Graph<'a> {
    nodes: Vec<Node<'a>>,
    /// Constants and inputs.
    given: Vec<&'a [u8]>,
    constants: Vec<(&'a [u8], Vec<u64>)>,
    outputs: Vec<&'a [u8]>,
}

#[derive(Default)]
struct Node<'a> {
    operator: &'a [u8],
    inputs: Vec<&'a [u8]>,
    outputs: Vec<&'a [u8]>,
    graphs: Vec<Graph<'a>>,
    /// Of a `Constant`.
    values: Vec<u64>,
}

impl<'a> Graph<'a> {
    fn read(message: &'a [u8], depth: usize, left: &mut usize) -> Result<Self> {
        at_most("levels of graphs within graphs", depth as u64, MAX_ONNX_NESTING as u64)?;
        let mut graph = Self::default();
        for field in Fields::of(message) {
            match field.ok_or_else(damaged)? {
                (1, Field::Bytes(node)) => {
                    *left = left.checked_sub(1).ok_or_else(|| {
                        Error::too_large(format!("has more than {MAX_ONNX_NODES} operators, the limit"))
                    })?;
                    graph.nodes.push(Node::read(node, depth, left)?);
                }
                (5, Field::Bytes(tensor)) => {
                    let (name, values) = constant(tensor)?;
                    graph.given.push(name);
                    graph.constants.push((name, values));
                }
                (11, Field::Bytes(value)) => graph.given.push(value_name(value)?),
                (12, Field::Bytes(value)) => graph.outputs.push(value_name(value)?),
                (13, Field::Bytes(value)) => drop(value_name(value)?),
                _ => {}
            }
        }
        Ok(graph)
    }

    /// Values are made once, and before they are used: a graph in this order has no cycles.
    fn check(&self, outer: &[&HashSet<&[u8]>]) -> Result<()> {
        let mut known: HashSet<&[u8]> = self.given.iter().copied().collect();
        for node in &self.nodes {
            let called = String::from_utf8_lossy(node.operator);
            if ENDLESS.contains(&node.operator) {
                return Err(Error::unsupported(format!(
                    "has an operator {called}: how often it runs cannot be told before; unroll it"
                )));
            }
            let seen = |name: &&[u8]| {
                name.is_empty() || known.contains(name) || outer.iter().any(|o| o.contains(name))
            };
            if let Some(name) = node.inputs.iter().find(|name| !seen(name)) {
                return Err(Error::invalid(format!(
                    "its operator {called} takes '{}', which is not made before",
                    String::from_utf8_lossy(name)
                )));
            }
            for graph in &node.graphs {
                graph.check(&[outer, &[&known]].concat())?;
            }
            self.check_growth(node)?;
            for name in node.outputs.iter().filter(|name| !name.is_empty()) {
                if !known.insert(name) {
                    let name = String::from_utf8_lossy(name);
                    return Err(Error::invalid(format!("makes '{name}' twice, by {called} the second time")));
                }
            }
        }
        let seen = |name: &&&[u8]| known.contains(**name) || outer.iter().any(|o| o.contains(**name));
        match self.outputs.iter().find(|name| !seen(name)) {
            None => Ok(()),
            Some(name) => {
                Err(Error::invalid(format!("nothing makes its output '{}'", String::from_utf8_lossy(name))))
            }
        }
    }

    /// What a constant asks an operator to make.
    fn check_growth(&self, node: &Node<'_>) -> Result<()> {
        let Some((_, at)) = GROWING.iter().find(|(operator, _)| *operator == node.operator) else {
            return Ok(());
        };
        let Some(name) = node.inputs.get(*at) else { return Ok(()) };
        let direct = self.constants.iter().find(|(constant, _)| constant == name).map(|(_, values)| values);
        let by_node = || {
            let makes = |other: &&Node<'_>| other.operator == b"Constant" && other.outputs.contains(name);
            self.nodes.iter().find(makes).map(|other| &other.values)
        };
        let Some(values) = direct.or_else(by_node) else { return Ok(()) };
        // −1 and 0 stand for sides that are kept
        let sides = values.iter().map(|v| (*v as i64).max(1) as u64);
        at_most("values that a constant asks for", sides.fold(1, u64::saturating_mul), MAX_ONNX_CONSTANT)
    }
}

impl<'a> Node<'a> {
    fn read(message: &'a [u8], depth: usize, left: &mut usize) -> Result<Self> {
        let mut node = Self::default();
        for field in Fields::of(message) {
            match field.ok_or_else(damaged)? {
                (1, Field::Bytes(name)) => node.inputs.push(name),
                (2, Field::Bytes(name)) => node.outputs.push(name),
                (4, Field::Bytes(name)) => node.operator = name,
                (5, Field::Bytes(attribute)) => node.attribute(attribute, depth, left)?,
                _ => {}
            }
        }
        Ok(node)
    }

    fn attribute(&mut self, message: &'a [u8], depth: usize, left: &mut usize) -> Result<()> {
        let (mut name, mut values) = (&[][..], Vec::new());
        for field in Fields::of(message) {
            match field.ok_or_else(damaged)? {
                (1, Field::Bytes(found)) => name = found,
                (3 | 8, Field::Number(value)) => values.push(value),
                (8, Field::Bytes(packed)) => values.extend(numbers(packed).ok_or_else(damaged)?),
                (5, Field::Bytes(tensor)) => self.values = constant(tensor)?.1,
                (6 | 11, Field::Bytes(graph)) => self.graphs.push(Graph::read(graph, depth + 1, left)?),
                _ => {}
            }
        }
        let limit = match name {
            _ if STRIDES.contains(&name) => MAX_ONNX_STRIDE,
            _ if PADDING.contains(&name) => MAX_ONNX_PADDING,
            _ => return Ok(()),
        };
        let name = String::from_utf8_lossy(name);
        values.iter().try_for_each(|value| at_most(&format!("pixels of its {name}"), *value, limit))
    }
}

/// The name of a value, whose type lies within it.
fn value_name(message: &[u8]) -> Result<&[u8]> {
    let mut name = &[][..];
    for field in Fields::of(message) {
        match field.ok_or_else(damaged)? {
            (1, Field::Bytes(found)) => name = found,
            (2, Field::Bytes(kind)) => value_type(kind, 0)?,
            _ => {}
        }
    }
    Ok(name)
}

fn value_type(message: &[u8], depth: usize) -> Result<()> {
    at_most("levels of types within types", depth as u64, MAX_ONNX_NESTING as u64)?;
    for field in Fields::of(message) {
        if let (1 | 2 | 4 | 9, Field::Bytes(inner)) = field.ok_or_else(damaged)? {
            // tensors, their shapes, and the sides of those are messages too; text in them ends the walk
            if Fields::of(inner).all(|field| field.is_some()) {
                value_type(inner, depth + 1)?;
            }
        }
    }
    Ok(())
}

/// Name and whole numbers of a constant, which has as many values as its sides say.
fn constant(message: &[u8]) -> Result<(&[u8], Vec<u64>)> {
    let (mut name, mut sides, mut kind) = (&[][..], Vec::new(), 0);
    let (mut counted, mut raw, mut values, mut elsewhere) = (0_u64, None, Vec::new(), false);
    for field in Fields::of(message) {
        match field.ok_or_else(damaged)? {
            (1, Field::Number(side)) => sides.push(side),
            (1, Field::Bytes(packed)) => sides.extend(numbers(packed).ok_or_else(damaged)?),
            (2, Field::Number(found)) => kind = found,
            (4, Field::Word(_)) | (10, Field::Long) => counted += 1,
            (4, Field::Bytes(packed)) => counted += packed.len() as u64 / 4,
            (10, Field::Bytes(packed)) => counted += packed.len() as u64 / 8,
            (5 | 7 | 11, Field::Number(value)) => values.push(value),
            (5 | 7 | 11, Field::Bytes(packed)) => values.extend(numbers(packed).ok_or_else(damaged)?),
            (8, Field::Bytes(found)) => name = found,
            (9, Field::Bytes(bytes)) => raw = Some(bytes),
            (13, _) => elsewhere = true,
            (14, Field::Number(place)) => elsewhere |= place != 0,
            _ => {}
        }
    }
    let called = String::from_utf8_lossy(name);
    let wanted = sides.iter().copied().try_fold(1, u64::checked_mul);
    let wanted = wanted.filter(|n| *n <= MAX_ONNX_CONSTANT).ok_or_else(|| {
        Error::too_large(format!(
            "its constant '{called}' claims sides of {sides:?}; the limit is {MAX_ONNX_CONSTANT} values"
        ))
    })?;
    let found = match (raw, bytes_of(kind)) {
        (Some(raw), Some(bytes)) => raw.len() as u64 / bytes,
        _ => counted + values.len() as u64,
    };
    // complex and text are not read; what is elsewhere is refused by name later
    if !elsewhere && bytes_of(kind).is_some() && found != wanted {
        return Err(Error::invalid(format!(
            "is not an ONNX model, or damaged: its constant '{called}' has {found} values, its sides say {wanted}"
        )));
    }
    if let (Some(raw), 7) = (raw, kind) {
        values = raw.as_chunks().0.iter().map(|bytes| u64::from_le_bytes(*bytes)).collect();
    }
    Ok((name, values))
}

/// Of an element of `TensorProto.DataType`.
fn bytes_of(kind: u64) -> Option<u64> {
    match kind {
        2 | 3 | 9 => Some(1),
        4 | 5 | 10 | 16 => Some(2),
        1 | 6 | 12 => Some(4),
        7 | 11 | 13 => Some(8),
        _ => None,
    }
}
