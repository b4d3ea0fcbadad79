//! The part of Python's pickle language that PyTorch's files use. Nothing is executed: classes and functions are names.

use std::collections::HashMap;

use super::arena::{Arena, Id, Value};
use super::bytes::{array, at, u16_at, u32_at};
use crate::{Error, Result};

/// Reads one pickle that starts at `position`: its value, and where it ends.
///
/// # Errors
/// [`Error::Invalid`] for a truncated or impossible one, [`Error::Unsupported`] for an instruction PyTorch does not use.
pub(super) fn read(file: &[u8], position: usize, arena: &mut Arena) -> Result<(Id, usize)> {
    let mut machine =
        Machine { file, position, arena, stack: Vec::new(), marks: Vec::new(), memo: HashMap::new() };
    loop {
        if let Some(value) = machine.step()? {
            return Ok((value, machine.position));
        }
    }
}

struct Machine<'a> {
    file: &'a [u8],
    position: usize,
    arena: &'a mut Arena,
    stack: Vec<Id>,
    marks: Vec<usize>,
    memo: HashMap<usize, Id>,
}

impl Machine<'_> {
    fn step(&mut self) -> Result<Option<Id>> {
        match self.take(1)?[0] {
            0x80 => drop(self.take(1)?),
            0x95 => drop(self.take(8)?),
            b'.' => return self.pop().map(Some),
            b'(' => self.marks.push(self.stack.len()),
            b'0' => drop(self.pop()?),
            b'N' | 0x88 | 0x89 => self.put(Value::Other),
            b'G' => {
                self.take(8)?;
                self.put(Value::Other);
            }
            b'K' => {
                let value = self.take(1)?[0];
                self.put(Value::Int(value.into()));
            }
            b'M' => {
                let value = self.number(2)?;
                self.put(Value::Int(value as i64));
            }
            b'J' => {
                let value = i32::from_le_bytes(array(self.file, self.position)?);
                self.position += 4;
                self.put(Value::Int(value.into()));
            }
            0x8a => self.long()?,
            b'X' | b'T' | b'B' => self.text(4)?,
            0x8c | b'U' | b'C' => self.text(1)?,
            b'}' => self.put(Value::Map(Vec::new())),
            b']' | b')' | 0x8f => self.put(Value::Sequence(Vec::new())),
            b't' => {
                let items = self.marked()?;
                self.put(Value::Sequence(items));
            }
            count @ 0x85..=0x87 => self.tuple(usize::from(count - 0x84))?,
            b'a' => self.extend(1)?,
            b'e' | 0x90 => self.extend_marked()?,
            b's' => self.insert(2)?,
            b'u' => {
                let count = self.stack.len() - self.mark()?;
                self.insert(count)?;
            }
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.put(Value::Global(format!("{module} {name}")));
            }
            0x93 => {
                let (name, module) = (self.pop()?, self.pop()?);
                let (Value::Text(module), Value::Text(name)) = (self.arena.get(module), self.arena.get(name))
                else {
                    return Err(damaged("a class without a name"));
                };
                let global = format!("{module} {name}");
                self.put(Value::Global(global));
            }
            b'q' => {
                let key = usize::from(self.take(1)?[0]);
                self.memoise(key)?;
            }
            b'r' => {
                let key = self.number(4)?;
                self.memoise(key)?;
            }
            0x94 => self.memoise(self.memo.len())?,
            b'h' => {
                let key = usize::from(self.take(1)?[0]);
                self.recall(key)?;
            }
            b'j' => {
                let key = self.number(4)?;
                self.recall(key)?;
            }
            b'Q' => {
                let id = self.pop()?;
                self.put(Value::Persistent(id));
            }
            b'R' | 0x81 => self.call()?,
            // an object's state: PyTorch's dictionaries keep their versions there
            b'b' => drop(self.pop()?),
            code => {
                return Err(Error::unsupported(format!(
                    "pickle instruction {code:#04x} at byte {} is none that PyTorch writes: convert the weights to \
                     safetensors",
                    self.position - 1
                )));
            }
        }
        Ok(None)
    }

    fn take(&mut self, count: usize) -> Result<&[u8]> {
        let bytes = at(self.file, self.position, count)?;
        self.position += count;
        Ok(bytes)
    }

    /// An unsigned number of 1, 2 or 4 bytes.
    fn number(&mut self, bytes: usize) -> Result<usize> {
        let value = match bytes {
            1 => usize::from(array::<1>(self.file, self.position)?[0]),
            2 => u16_at(self.file, self.position)?,
            _ => u32_at(self.file, self.position)?,
        };
        self.position += bytes;
        Ok(value)
    }

    fn line(&mut self) -> Result<String> {
        let rest = &self.file[self.position..];
        let length = rest.iter().position(|b| *b == b'\n').ok_or_else(|| damaged("a name without an end"))?;
        let line = String::from_utf8_lossy(&rest[..length]).into_owned();
        self.position += length + 1;
        Ok(line)
    }

    fn long(&mut self) -> Result<()> {
        let length = self.number(1)?;
        let bytes = self.take(length)?;
        let negative = bytes.last().is_some_and(|b| b & 0x80 != 0);
        let mut wide = [if negative { 0xff } else { 0 }; 8];
        let value = if length <= 8 {
            wide[..length].copy_from_slice(bytes);
            Value::Int(i64::from_le_bytes(wide))
        } else {
            Value::Other
        };
        self.put(value);
        Ok(())
    }

    fn text(&mut self, length_bytes: usize) -> Result<()> {
        let length = self.number(length_bytes)?;
        let text = String::from_utf8_lossy(self.take(length)?).into_owned();
        self.put(Value::Text(text));
        Ok(())
    }

    fn put(&mut self, value: Value) {
        let id = self.arena.push(value);
        self.stack.push(id);
    }

    fn pop(&mut self) -> Result<Id> {
        self.stack.pop().ok_or_else(|| damaged("it takes a value that is not there"))
    }

    fn mark(&mut self) -> Result<usize> {
        let mark = self.marks.pop().filter(|m| *m <= self.stack.len());
        mark.ok_or_else(|| damaged("a group without a beginning"))
    }

    fn marked(&mut self) -> Result<Vec<Id>> {
        let mark = self.mark()?;
        Ok(self.stack.split_off(mark))
    }

    /// The last `count` values.
    fn last(&mut self, count: usize) -> Result<Vec<Id>> {
        let first = self.stack.len().checked_sub(count);
        first.map(|f| self.stack.split_off(f)).ok_or_else(|| damaged("it takes values that are not there"))
    }

    fn tuple(&mut self, count: usize) -> Result<()> {
        let items = self.last(count)?;
        self.put(Value::Sequence(items));
        Ok(())
    }

    fn extend_marked(&mut self) -> Result<()> {
        let count = self.stack.len() - self.mark()?;
        self.extend(count)
    }

    fn extend(&mut self, count: usize) -> Result<()> {
        let items = self.last(count)?;
        let target = *self.stack.last().ok_or_else(|| damaged("items without a list"))?;
        if let Value::Sequence(list) = self.arena.get_mut(target) {
            list.extend(items);
        }
        Ok(())
    }

    fn insert(&mut self, count: usize) -> Result<()> {
        let items = self.last(count)?;
        let target = *self.stack.last().ok_or_else(|| damaged("entries without a dictionary"))?;
        if let Value::Map(map) = self.arena.get_mut(target) {
            map.extend(items.as_chunks().0.iter().map(|[key, value]| (*key, *value)));
        }
        Ok(())
    }

    fn memoise(&mut self, key: usize) -> Result<()> {
        let value = *self.stack.last().ok_or_else(|| damaged("nothing to remember"))?;
        self.memo.insert(key, value);
        Ok(())
    }

    fn recall(&mut self, key: usize) -> Result<()> {
        let value = self.memo.get(&key).ok_or_else(|| damaged("it recalls what it never stored"))?;
        self.stack.push(*value);
        Ok(())
    }

    /// Ordered dictionaries become maps that later instructions fill; other calls are kept as they are.
    fn call(&mut self) -> Result<()> {
        let (arguments, function) = (self.pop()?, self.pop()?);
        let value = match self.arena.get(function) {
            Value::Global(name) if name == "collections OrderedDict" => Value::Map(self.pairs(arguments)),
            Value::Global(name) => Value::Call(name.clone(), arguments),
            _ => Value::Other,
        };
        self.put(value);
        Ok(())
    }

    /// The entries of `OrderedDict([(key, value), …])`; none for an empty argument list.
    fn pairs(&self, arguments: Id) -> Vec<(Id, Id)> {
        let sequence = |id: Id| match self.arena.get(id) {
            Value::Sequence(items) => items.as_slice(),
            _ => &[],
        };
        let pairs = sequence(arguments).first().map_or(&[][..], |list| sequence(*list));
        let pair = |id: &Id| match sequence(*id) {
            [key, value] => Some((*key, *value)),
            _ => None,
        };
        pairs.iter().filter_map(pair).collect()
    }
}

fn damaged(what: &str) -> Error {
    Error::invalid(format!("the pickle is damaged: {what}"))
}
