//! `I/N`: one part of N, as `--shard` and `--fold` take it.

#[cfg(feature = "learn")]
use veni_data::Fold;

/// Part `number` of `of`, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Part {
    pub(crate) number: usize,
    pub(crate) of: usize,
}

impl Part {
    /// One of several processes.
    pub(crate) fn shard(text: &str) -> Result<Self, String> {
        Self::read(text, "shard")
    }

    /// `what` are counted from 1.
    fn read(text: &str, what: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').map(|(number, of)| (number.trim().parse(), of.trim().parse()));
        match numbers {
            Some((Ok(number), Ok(of))) if 1 <= number && number <= of => Ok(Self { number, of }),
            Some((Ok(_), Ok(0))) => {
                Err(format!("there are no {what}s of 0; count them from 1, as 1/4 to 4/4"))
            }
            Some((Ok(0), Ok(of))) => Err(format!("{what}s are counted from 1: 1/{of} to {of}/{of}")),
            Some((Ok(number), Ok(of))) => {
                Err(format!("there is no {what} {number} of {of}: 1/{of} to {of}/{of}"))
            }
            _ => Err("give I/N, such as 1/4".to_owned()),
        }
    }
}

/// A part of the panoramas that is held back: of two at least, since the others are trained on.
#[cfg(feature = "learn")]
pub(crate) fn fold(text: &str) -> Result<Fold, String> {
    match Part::read(text, "fold")? {
        Part { of: 1, .. } => Err("a single fold leaves nothing to train on; give 1/2 or more".to_owned()),
        Part { number, of } => Fold::new(number, of).map_err(|e| e.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let message = Part::shard(text).unwrap_err();
            assert!(message.contains(words), "{text}: {message}");
        }
    }

    #[cfg(feature = "learn")]
    #[test]
    fn folds_are_two_or_more() {
        assert_eq!(fold("2/4").unwrap().to_string(), "2/4");
        for (text, words) in
            [("1/1", "nothing to train on"), ("0/4", "folds are counted from 1"), ("2", "1/4")]
        {
            let message = fold(text).unwrap_err();
            assert!(message.contains(words), "{text}: {message}");
        }
    }
}
