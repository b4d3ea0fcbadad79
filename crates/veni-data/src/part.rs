//! `I/N`: how a whole is divided, and which part of it is meant.

use std::fmt;

use crate::{Error, Result};

/// Part I of N, written `I/N` with I from 1: of processes that divide a list without talking to each other, or of a set whose
/// parts are held back in turn ([`Fold`](crate::Fold)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    number: usize,
    of: usize,
}

impl Part {
    /// Everything: part 1 of 1.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// Part `number`, from 1, of `of`. `what` is its name in messages ("shard").
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no such part.
    pub fn new(number: usize, of: usize, what: &str) -> Result<Self> {
        match (number, of) {
            (_, 0) => {
                Err(Error::invalid(format!("there are no {what}s of 0; count them from 1, as 1/4 to 4/4")))
            }
            (0, _) => Err(Error::invalid(format!("{what}s are counted from 1: 1/{of} to {of}/{of}"))),
            _ if number > of => {
                Err(Error::invalid(format!("there is no {what} {number} of {of}: 1/{of} to {of}/{of}")))
            }
            _ => Ok(Self { number, of }),
        }
    }

    /// The part that a text names, otherwise as [`Part::new`].
    ///
    /// # Errors
    /// As [`Part::new`], and [`Error::Invalid`] if the text is not `I/N`.
    pub fn parse(text: &str, what: &str) -> Result<Self> {
        match numbers(text) {
            Some([number, of]) => Self::new(number, of, what),
            None => Err(Error::invalid("give I/N, such as 1/4")),
        }
    }

    /// I, from 1.
    pub fn number(self) -> usize {
        self.number
    }

    /// N.
    pub fn of(self) -> usize {
        self.of
    }

    /// Whether item `index`, from 0, of a list belongs to this part: every N-th, beginning with the I-th.
    pub fn has(self, index: usize) -> bool {
        index % self.of == self.number - 1
    }
}

/// The two numbers of `I/N`, whatever they are.
pub(crate) fn numbers(text: &str) -> Option<[usize; 2]> {
    let (number, of) = text.split_once('/')?;
    Some([number.trim().parse().ok()?, of.trim().parse().ok()?])
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_belongs_to_one_part() {
        for (of, items) in [(1, 3), (3, 10), (4, 2)] {
            let parts: Vec<_> = (1..=of).map(|number| Part::new(number, of, "part").unwrap()).collect();
            for index in 0..items {
                let takers = parts.iter().filter(|part| part.has(index)).count();
                assert_eq!(takers, 1, "item {index} of {items} in {of} parts");
            }
        }
        assert!((0..9).all(|index| Part::WHOLE.has(index)));
    }

    #[test]
    fn what_is_not_a_part_is_refused() {
        for (text, words) in [
            ("0/4", "from 1"),
            ("5/4", "no shard 5"),
            ("1/0", "no shards of 0"),
            ("0/0", "no shards of 0"),
            ("2", "1/4"),
            ("a/b", "1/4"),
            ("-1/4", "1/4"),
            ("", "1/4"),
        ] {
            let message = Part::parse(text, "shard").unwrap_err().to_string();
            assert!(message.contains(words), "{text}: {message}");
        }
        assert_eq!(Part::parse(" 2 / 4 ", "shard").unwrap().to_string(), "2/4");
    }
}
