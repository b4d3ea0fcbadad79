//! One share of a command's inputs: how several processes divide a long list without talking to each other.

use std::fmt::{self, Display};

use anyhow::{Result, bail};
use clap::Args;

use crate::part::Part;
use crate::report::Report;

/// Which of a command's inputs this process takes.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(crate) struct Shard {
    /// Take only every N-th input, beginning with the I-th: I of N processes that together do it all
    #[arg(long = "shard", value_name = "I/N", value_parser = Part::shard)]
    part: Option<Part>,
}

impl Shard {
    /// Whether the input at `index`, from 0, belongs to this process.
    pub(crate) fn pick(self, index: usize) -> bool {
        self.part.is_none_or(|part| index % part.of == part.number - 1)
    }

    /// (I − 1, N) of I/N; (0, 1) for everything.
    pub(crate) fn place(self) -> (usize, usize) {
        self.part.map_or((0, 1), |part| (part.number - 1, part.of))
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
        if self.part.is_some_and(|part| part.number > inputs) {
            report.note(format_args!("--shard {self}: nothing to do, with so few inputs ({inputs})"));
        }
    }

    /// Whether other processes do the rest.
    pub(crate) fn is_part(self) -> bool {
        self.part.is_some_and(|part| part.of > 1)
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
        let (at, of) = self.place();
        write!(f, "{}/{of}", at + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shard(text: &str) -> Shard {
        Shard { part: Some(Part::shard(text).unwrap()) }
    }

    #[test]
    fn every_input_belongs_to_one_shard() {
        for (of, inputs) in [(1, 3), (3, 10), (4, 2)] {
            for index in 0..inputs {
                let takers = (1..=of).filter(|i| shard(&format!("{i}/{of}")).pick(index)).count();
                assert_eq!(takers, 1, "input {index} of {inputs} in {of} shards");
            }
        }
        assert_eq!(shard("2/3").own(&[0, 1, 2, 3, 4]), [1, 4]);
        assert_eq!((shard("2/3").place(), shard("2/3").to_string().as_str()), ((1, 3), "2/3"));
        assert!((0..9).all(|index| Shard::default().pick(index)));
    }
}
