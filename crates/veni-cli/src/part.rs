//! `I/N`, as `--shard` and `--fold` take it.

use veni_data::Part;

/// One of several processes.
pub(crate) fn shard(text: &str) -> Result<Part, String> {
    Part::parse(text, "shard").map_err(|e| e.to_string())
}

/// A part of the panoramas that is held back: of two at least, since the others are trained on.
#[cfg(feature = "learn")]
pub(crate) fn fold(text: &str) -> Result<veni_data::Fold, String> {
    let part = Part::parse(text, "fold").map_err(|e| e.to_string())?;
    if part.of() == 1 {
        return Err("a single fold leaves nothing to train on; give 1/2 or more".to_owned());
    }
    veni_data::Fold::new(part.number(), part.of()).map_err(|e| e.to_string())
}

#[cfg(all(test, feature = "learn"))]
mod tests {
    use super::*;

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
