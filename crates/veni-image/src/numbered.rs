//! Text attributes that are longer than other software reads, over several numbered ones:
//! `veni:latent[1/2]`, `veni:latent[2/2]`.

use std::collections::BTreeMap;

use crate::{Error, Result};

/// More parts than this were not written by this crate.
const MAX_PARTS: usize = 1 << 16;

/// The attributes in the order of their names, each value in parts of at most `limit(name)` bytes, name as it is written.
///
/// # Errors
/// [`Error::Invalid`] for a name that is one of a part, or so long that nothing fits behind it.
pub(crate) fn split(
    attributes: &BTreeMap<String, String>,
    limit: impl Fn(&str) -> usize,
) -> Result<Vec<(String, String)>> {
    let mut all = Vec::new();
    for (name, value) in attributes {
        if part(name).is_some() {
            return Err(Error::invalid(format!(
                "the attribute {name:?} is not free: such names have the parts of long texts"
            )));
        }
        if value.len() <= limit(name) {
            all.push((name.clone(), value.clone()));
            continue;
        }
        all.extend(parts(name, value, &limit).ok_or_else(|| {
            Error::invalid(format!("the attribute {name:?} cannot be written: its name is too long"))
        })?);
    }
    Ok(all)
}

/// Parts of a long value; the number of digits of the last one decides the limit of all, so it is tried.
fn parts(name: &str, value: &str, limit: &impl Fn(&str) -> usize) -> Option<Vec<(String, String)>> {
    (1..=5usize).find_map(|digits| {
        let nines = "9".repeat(digits);
        let limit = limit(&format!("{name}[{nines}/{nines}]"));
        let pieces = pieces(value, limit)?;
        let last = pieces.len();
        (last.to_string().len() == digits).then(|| {
            let named = |(k, piece): (usize, &&str)| {
                (format!("{name}[{:0digits$}/{last}]", k + 1), (*piece).to_owned())
            };
            pieces.iter().enumerate().map(named).collect()
        })
    })
}

/// Cuts between characters, and not beside white space where that can be helped: readers may trim it.
fn pieces(mut rest: &str, limit: usize) -> Option<Vec<&str>> {
    let mut pieces = Vec::new();
    while rest.len() > limit {
        let bounds = || (1..=limit).rev().filter(|at| rest.is_char_boundary(*at));
        let solid = |at: &usize| {
            let (left, right) = rest.split_at(*at);
            !left.ends_with(char::is_whitespace) && !right.starts_with(char::is_whitespace)
        };
        let at = bounds().find(solid).or_else(|| bounds().next())?;
        let (piece, after) = rest.split_at(at);
        pieces.push(piece);
        rest = after;
    }
    pieces.push(rest);
    Some(pieces)
}

/// Puts the parts of long texts together again, where all are there and no attribute has the whole one's name.
pub(crate) fn join(attributes: BTreeMap<String, String>) -> BTreeMap<String, String> {
    let (mut whole, mut found) =
        (BTreeMap::new(), BTreeMap::<(String, usize), BTreeMap<usize, String>>::new());
    for (name, value) in attributes {
        match part(&name) {
            Some((base, number, last)) => {
                found.entry((base.to_owned(), last)).or_default().insert(number, value);
            }
            None => drop(whole.insert(name, value)),
        }
    }
    for ((base, last), parts) in found {
        if parts.len() == last && !whole.contains_key(&base) {
            whole.insert(base, parts.into_values().collect());
        } else {
            let digits = last.to_string().len();
            whole.extend(parts.into_iter().map(|(k, value)| (format!("{base}[{k:0digits$}/{last}]"), value)));
        }
    }
    whole
}

/// Name, number and count of a part.
fn part(name: &str) -> Option<(&str, usize, usize)> {
    let (base, place) = name.strip_suffix(']')?.rsplit_once('[')?;
    let (number, last) = place.split_once('/')?;
    let value = |text: &str| text.parse().ok().filter(|n| (1..=MAX_PARTS).contains(n));
    let (number, last) = (value(number)?, value(last)?);
    (number <= last && last > 1 && place.len() == 2 * last.to_string().len() + 1)
        .then_some((base, number, last))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(name: &str, value: &str) -> BTreeMap<String, String> {
        BTreeMap::from([(name.to_owned(), value.to_owned())])
    }

    #[test]
    fn every_length_comes_back_and_no_part_is_too_long() {
        let text: String = (0..4000u32).map(|k| char::from_u32(0x21 + k * 7 % 400).unwrap_or('a')).collect();
        let ends = (0..=text.len()).step_by(7).filter(|at| text.is_char_boundary(*at));
        for value in ends.map(|at| &text[..at]) {
            let split = split(&one("veni:latent", value), |name| 99 - name.len()).unwrap();
            assert!(split.iter().all(|(name, value)| name.len() + value.len() <= 99), "{split:?}");
            assert!(split.is_sorted());
            assert_eq!(join(split.into_iter().collect()), one("veni:latent", value));
        }
    }

    #[test]
    fn parts_do_not_end_in_spaces() {
        let value = "one two  three    four five six seven eight nine ten".repeat(5);
        let split = split(&one("a", &value), |name| 20 - name.len()).unwrap();
        assert!(split.len() > 10 && split.iter().all(|(_, part)| part.trim() == part), "{split:?}");
        // unless there is nothing else
        let spaces = " ".repeat(60);
        let split = super::split(&one("a", &spaces), |name| 20 - name.len()).unwrap();
        assert_eq!(join(split.into_iter().collect()), one("a", &spaces));
    }

    #[test]
    fn names_of_parts_are_not_free_and_long_names_are_refused() {
        for name in ["a[1/2]", "a[07/10]"] {
            assert!(split(&one(name, "x"), |_| 50).unwrap_err().to_string().contains(name));
        }
        for name in ["a[1/1]", "a[0/2]", "a[3/2]", "a[1/10]", "a[x/2]", "a[1/2] ", "[1]"] {
            assert_eq!(split(&one(name, "x"), |_| 50).unwrap(), [(name.to_owned(), "x".to_owned())]);
        }
        assert!(split(&one(&"n".repeat(98), "value"), |name| 99usize.saturating_sub(name.len())).is_err());
    }

    #[test]
    fn what_is_not_whole_stays_as_it_is() {
        let mut some: BTreeMap<String, String> =
            split(&one("a", &"x".repeat(50)), |_| 4).unwrap().into_iter().collect();
        assert_eq!(some.len(), 13);
        some.remove("a[07/13]");
        assert_eq!(join(some.clone()), some);
        // an attribute with the whole name was set by somebody else
        let mut both = BTreeMap::from([("a[1/2]".into(), "x".into()), ("a[2/2]".into(), "y".into())]);
        both.insert("a".to_owned(), "z".to_owned());
        assert_eq!(join(both.clone()), both);
    }
}
