//! Protocol Buffers as bytes: the fields of a message, each of which lies within it.
//!
//! The runtime's reader trusts lengths: one beyond its message is allocated, or sought backwards, for ever.

/// The fields of one message, in order; an item of nothing is damage, and the last.
pub(super) struct Fields<'a>(Option<&'a [u8]>);

/// What a field holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Field<'a> {
    /// A whole number.
    Number(u64),
    /// Four bytes.
    Word([u8; 4]),
    /// Eight bytes, of which nothing here makes use.
    Long,
    /// Text, bytes, a message, or several numbers.
    Bytes(&'a [u8]),
}

impl<'a> Fields<'a> {
    pub(super) fn of(message: &'a [u8]) -> Self {
        Self(Some(message))
    }

    fn field(rest: &mut &'a [u8]) -> Option<(u64, Field<'a>)> {
        let tag = number(rest)?;
        let field = match tag & 7 {
            0 => Field::Number(number(rest)?),
            1 => {
                take(rest, 8)?;
                Field::Long
            }
            2 => {
                let length = usize::try_from(number(rest)?).ok()?;
                Field::Bytes(take(rest, length)?)
            }
            5 => Field::Word(take(rest, 4)?.try_into().ok()?),
            // groups, which ONNX never had
            _ => return None,
        };
        Some((tag >> 3, field))
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = Option<(u64, Field<'a>)>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut rest = self.0.filter(|rest| !rest.is_empty())?;
        let field = Self::field(&mut rest);
        self.0 = field.is_some().then_some(rest);
        Some(field)
    }
}

/// Whole numbers one after the other, nothing where the last is cut off.
pub(super) fn numbers(mut bytes: &[u8]) -> Option<Vec<u64>> {
    let mut found = Vec::new();
    while !bytes.is_empty() {
        found.push(number(&mut bytes)?);
    }
    Some(found)
}

/// Seven bits to a byte, the lowest first, at most ten bytes.
fn number(rest: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..70).step_by(7) {
        let (first, tail) = rest.split_first()?;
        *rest = tail;
        if shift == 63 && *first > 1 {
            return None;
        }
        value |= u64::from(first & 0x7F) << shift;
        if first & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

fn take<'a>(rest: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (taken, tail) = rest.split_at_checked(count)?;
    *rest = tail;
    Some(taken)
}
