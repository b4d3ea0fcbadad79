//! One share of a command's inputs: how several processes divide a long list without talking to each other.

use std::fmt::{self, Display};

use anyhow::{Result, bail};
use clap::Args;
use veni_data::Part;

use crate::part;
use crate::report::Report;

/// Which of a command's inputs this process takes.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(crate) struct Shard {
    /// Take only every N-th input, beginning with the I-th: I of N processes that together do it all
    #[arg(long = "shard", value_name = "I/N", value_parser = part::shard)]
    part: Option<Part>,
}

impl Shard {
    /// Whether the input at `index`, from 0, belongs to this process.
    pub(crate) fn pick(self, index: usize) -> bool {
        self.part().has(index)
    }

    /// Which part of all inputs this is.
    pub(crate) fn part(self) -> Part {
        self.part.unwrap_or(Part::WHOLE)
    }

    /// The inputs that belong to this process.
    pub(crate) fn own<T: Clone>(self, inputs: &[T]) -> Vec<T> {
        inputs
            .iter()
            .enumerate()
            .filter(|(index, _)| self.pick(*index))
            .map(|(_, input)| input.clone())
            .collect()
    }

    /// Says, if it is so, that there are fewer inputs than processes.
    pub(crate) fn note_idle(self, inputs: usize, report: Report) {
        if self.part.is_some_and(|part| part.number() > inputs) {
            report.note(format_args!("--shard {self}: nothing to do, with so few inputs ({inputs})"));
        }
    }

    /// Whether other processes do the rest.
    pub(crate) fn is_part(self) -> bool {
        self.part().of() > 1
    }

    /// Refuses `option`, whose single file every process would write.
    pub(crate) fn refuse(self, option: &str, given: bool) -> Result<()> {
        if given && self.is_part() {
            bail!("{option}: every shard would write this file; leave it out, or --shard");
        }
        Ok(())
    }
}

impl Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.part().fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shard(text: &str) -> Shard {
        Shard { part: Some(part::shard(text).unwrap()) }
    }

    #[test]
    fn a_shard_takes_its_part_and_nothing_said_is_everything() {
        assert_eq!(shard("2/3").own(&[0, 1, 2, 3, 4]), [1, 4]);
        assert_eq!((shard("2/3").to_string(), Shard::default().to_string()), ("2/3".into(), "1/1".into()));
        assert!((0..9).all(|index| Shard::default().pick(index)));
        assert!(!Shard::default().is_part() && !shard("1/1").is_part() && shard("1/2").is_part());
    }
}
