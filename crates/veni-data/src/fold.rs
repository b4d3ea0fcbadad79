//! Cross-validation: a set in N parts, of which each is held back once.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use veni_light::digest::Digest;

use crate::part::{Part, numbers};
use crate::prepare::capture;
use crate::{Error, Result};

/// The [`Part`] that is held back while the other parts are trained on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Fold(Part);

impl Fold {
    /// Part `number` (from 1) of `of` (2 or more).
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no such part.
    pub fn new(number: usize, of: usize) -> Result<Self> {
        let part = Part::new(number, of, "fold").ok().filter(|part| part.of() > 1);
        part.map(Self).ok_or_else(|| {
            Error::invalid(format!(
                "fold {number}/{of}: give I/N with N of 2 or more and I of 1 to N, such as 1/4"
            ))
        })
    }

    /// Which of the files are held back. Files of one [`capture`] are in the same part; captures are dealt in the order of a
    /// hash of their names, each to the part with the fewest files so far. The parts of N are disjoint, cover everything, and
    /// depend on the names alone.
    pub fn held_back(self, files: &[PathBuf]) -> Vec<bool> {
        let captures: Vec<_> = files.iter().map(|file| capture(file)).collect();
        let mut sizes: BTreeMap<(Digest, &str), usize> = BTreeMap::new();
        for name in &captures {
            *sizes.entry((Digest::of(name), name)).or_default() += 1;
        }
        let mut filled = vec![0; self.0.of()];
        let mut part_of = BTreeMap::new();
        for ((_, name), size) in sizes {
            let part = (0..filled.len()).min_by_key(|part| filled[*part]).unwrap_or_default();
            filled[part] += size;
            part_of.insert(name, part);
        }
        captures.iter().map(|name| part_of[name.as_str()] == self.0.number() - 1).collect()
    }

    /// The files held back and the others.
    ///
    /// # Errors
    /// [`Error::Invalid`] if one side is empty.
    pub fn split(self, files: &[PathBuf]) -> Result<(Vec<PathBuf>, Vec<PathBuf>)> {
        let held = self.held_back(files);
        let side = |wanted| {
            files
                .iter()
                .zip(&held)
                .filter(|(_, held)| **held == wanted)
                .map(|(file, _)| file.clone())
                .collect::<Vec<_>>()
        };
        let (held, others) = (side(true), side(false));
        if held.is_empty() || others.is_empty() {
            return Err(Error::invalid(format!(
                "fold {self}: {} of {} panoramas are in it; give fewer folds or more captures",
                held.len(),
                files.len()
            )));
        }
        Ok((held, others))
    }
}

impl FromStr for Fold {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match numbers(text) {
            Some([number, of]) => Self::new(number, of),
            None => Err(Error::invalid(format!("fold {text:?}: give I/N, such as 1/4"))),
        }
    }
}

impl fmt::Display for Fold {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl TryFrom<String> for Fold {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

impl From<Fold> for String {
    fn from(fold: Fold) -> Self {
        fold.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(n: usize) -> Vec<PathBuf> {
        // two files of every third capture
        (0..n)
            .flat_map(|k| {
                [Some(format!("place{k}x.exr")), (k % 3 == 0).then(|| format!("place{k}x_puresky.exr"))]
            })
            .flatten()
            .map(PathBuf::from)
            .collect()
    }

    #[test]
    fn the_parts_cover_everything_once_are_even_and_keep_captures_together() {
        let files = files(31);
        let parts: Vec<_> = (1..=4).map(|i| Fold::new(i, 4).unwrap().held_back(&files)).collect();
        for k in 0..files.len() {
            assert_eq!(parts.iter().filter(|part| part[k]).count(), 1, "{:?}", files[k]);
        }
        let sizes: Vec<_> = parts.iter().map(|part| part.iter().filter(|held| **held).count()).collect();
        assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 2, "{sizes:?}");
        for part in &parts {
            for (a, b) in files
                .iter()
                .zip(part)
                .zip(files.iter().zip(part).skip(1))
                .filter(|((a, _), (b, _))| capture(a) == capture(b))
            {
                assert_eq!(a.1, b.1, "{:?} and {:?}", a.0, b.0);
            }
        }
    }

    #[test]
    fn the_order_of_the_files_does_not_matter() {
        let (files, fold) = (files(12), Fold::new(2, 3).unwrap());
        let mut backwards = files.clone();
        backwards.reverse();
        let mut held = fold.held_back(&backwards);
        held.reverse();
        assert_eq!(held, fold.held_back(&files));
    }

    #[test]
    fn what_is_no_fold_is_refused() {
        for text in ["0/4", "5/4", "1/1", "1/0", "2", "a/b", ""] {
            assert!(text.parse::<Fold>().unwrap_err().to_string().contains("1/4"), "{text}");
        }
        assert_eq!("2/4".parse::<Fold>().unwrap().to_string(), "2/4");
        let message = Fold::new(4, 4).unwrap().split(&files(1)[..1]).unwrap_err().to_string();
        assert!(message.contains("fewer folds"), "{message}");
    }
}
