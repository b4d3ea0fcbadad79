//! One share of a command's inputs: how several processes divide a long list without talking to each other.

use std::fmt::{self, Display};

use anyhow::{Result, bail};
use clap::Args;

use crate::report::Report;

/// Which of a command's inputs this process takes.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(crate) struct Shard {
    /// Take only every N-th input, beginning with the I-th: I of N processes that together do it all
    #[arg(long = "shard", value_name = "I/N", value_parser = part)]
    part: Option<Part>,
}

/// Part `number` of `of`, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Part {
    number: usize,
    of: usize,
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

fn part(text: &str) -> Result<Part, String> {
    let numbers = text.split_once('/').map(|(number, of)| (number.trim().parse(), of.trim().parse()));
    match numbers {
        Some((Ok(number), Ok(of))) if 1 <= number && number <= of => Ok(Part { number, of }),
        Some((Ok(_), Ok(0))) => Err("there are no shards of 0; count them from 1, as 1/4 to 4/4".to_owned()),
        Some((Ok(0), Ok(of))) => Err(format!("shards are counted from 1: 1/{of} to {of}/{of}")),
        Some((Ok(number), Ok(of))) => Err(format!("there is no shard {number} of {of}: 1/{of} to {of}/{of}")),
        _ => Err("give I/N, such as 1/4".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shard(text: &str) -> Shard {
        Shard { part: Some(part(text).unwrap()) }
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

    #[test]
    fn what_is_no_shard_is_refused() {
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
            let message = part(text).unwrap_err();
            assert!(message.contains(words), "{text}: {message}");
        }
    }
}
