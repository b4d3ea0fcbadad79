//! Which side of the split a group goes to.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use serde::{Deserialize, Serialize};
use veni_light::digest::Digest;

/// A side of the split; a later one is better kept from training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// To learn from.
    Train,
    /// To choose by.
    Val,
    /// To report on.
    Test,
}

impl Split {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Train, Self::Val, Self::Test];

    /// The name of its folder.
    pub fn folder(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Val => "val",
            Self::Test => "test",
        }
    }

    /// The split that a folder's name speaks of.
    pub fn named(folder: &str) -> Option<Self> {
        match folder.to_lowercase().as_str() {
            "train" | "training" => Some(Self::Train),
            "val" | "valid" | "validation" => Some(Self::Val),
            "test" | "testing" => Some(Self::Test),
            _ => None,
        }
    }
}

impl fmt::Display for Split {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.folder())
    }
}

/// Expected shares of the groups whose side is not given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shares {
    /// Of validation, 0 to 1.
    pub val: f64,
    /// Of the test, 0 to 1; with validation less than 1.
    pub test: f64,
}

/// The side of each panorama, from its group and the side that its folder gave it.
///
/// - A group with given sides goes to the last of them in the order train, val, test: what was held out stays so.
/// - Any other group's side depends on `seed` and the group's key alone, so that it stays when other panoramas come or
///   go: u in [0, 1) from SHA-256 of both; test if u < test, val if u < test + val.
/// - If that leaves validation (or the test) empty although it has a share, it gets the undecided group with the
///   smallest u, as long as another is left for training.
///
/// # Panics
/// If there are not as many keys as given sides.
pub fn assign(keys: &[String], given: &[Option<Split>], shares: Shares, seed: u64) -> Vec<Split> {
    assert_eq!(keys.len(), given.len(), "a group and perhaps a side for each");
    let mut fixed: BTreeMap<&str, Split> = BTreeMap::new();
    for (key, side) in keys.iter().zip(given) {
        if let Some(side) = side {
            let to = fixed.entry(key).or_insert(*side);
            *to = (*to).max(*side);
        }
    }
    let free: BTreeSet<&str> = keys.iter().map(String::as_str).filter(|k| !fixed.contains_key(k)).collect();
    let mut sides = fixed;
    let mut order: Vec<(f64, &str)> = free.iter().map(|key| (draw(seed, key), *key)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (u, key) in &order {
        let side = match u {
            u if *u < shares.test => Split::Test,
            u if *u < shares.test + shares.val => Split::Val,
            _ => Split::Train,
        };
        sides.insert(key, side);
    }
    for (side, share) in [(Split::Test, shares.test), (Split::Val, shares.val)] {
        let count = |wanted: Split| sides.values().filter(|s| **s == wanted).count();
        if share > 0.0 && count(side) == 0 && count(Split::Train) > 1 {
            let first = order.iter().find(|(_, key)| sides[key] == Split::Train).map(|(_, key)| *key);
            if let Some(first) = first {
                sides.insert(first, side);
            }
        }
    }
    keys.iter().map(|key| sides[key.as_str()]).collect()
}

/// A number in [0, 1) that a seed and a group's key decide.
fn draw(seed: u64, key: &str) -> f64 {
    let digest = Digest::build().update(seed.to_le_bytes()).update(key).finish();
    // 53 bits, so that 1 is never reached by rounding
    (digest.number() >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHARES: Shares = Shares { val: 0.2, test: 0.1 };

    fn keys(n: usize) -> Vec<String> {
        (0..n).map(|k| format!("capture_{k}")).collect()
    }

    #[test]
    fn sides_depend_on_seed_and_key_alone() {
        let all = keys(2000);
        let none = vec![None; all.len()];
        let sides = assign(&all, &none, SHARES, 7);
        let share = |side| sides.iter().filter(|s| **s == side).count() as f64 / all.len() as f64;
        assert!((share(Split::Val) - 0.2).abs() < 0.03 && (share(Split::Test) - 0.1).abs() < 0.03);
        let fewer = assign(&all[100..], &none[100..], SHARES, 7);
        assert_eq!(sides[100..], fewer);
        assert_ne!(sides, assign(&all, &none, SHARES, 8));
    }

    /// Prepared folders keep their sides when panoramas are added by a later version. The expected numbers are Python's:
    /// `(int.from_bytes(sha256(pack("<Q", seed) + key).digest()[:8], "big") >> 11) / 2**53`.
    #[test]
    fn a_side_is_what_it_was() {
        for (seed, key, u, side) in [
            (0, "kloofendal_43d_clear", 0.201_732_122_835_409_98, Split::Val),
            (7, "capture_0", 0.443_066_620_945_906_3, Split::Train),
            (2026, "monday/img_07", 0.787_812_345_953_053_3, Split::Train),
            (5, "snowy_field", 0.061_773_230_074_404_27, Split::Test),
        ] {
            assert_eq!(draw(seed, key), u, "{seed} {key}");
            // one alone would be moved if its side were empty otherwise: two that are given fill them
            let keys = [key, "held out", "reported on"].map(str::to_owned);
            let sides = assign(&keys, &[None, Some(Split::Val), Some(Split::Test)], SHARES, seed);
            assert_eq!(sides[0], side, "{seed} {key}");
        }
    }

    #[test]
    fn given_sides_win_and_the_strictest_holds_for_a_group() {
        let keys: Vec<String> = ["a", "a", "a", "b", "c"].map(String::from).into();
        let given = [Some(Split::Train), Some(Split::Val), None, Some(Split::Train), None];
        let sides = assign(&keys, &given, Shares { val: 0.0, test: 0.0 }, 0);
        assert_eq!(sides, [Split::Val, Split::Val, Split::Val, Split::Train, Split::Train]);
    }

    #[test]
    fn small_sets_have_something_to_validate_by() {
        for n in 2..6 {
            let sides = assign(&keys(n), &vec![None; n], Shares { val: 1e-9, test: 0.0 }, 3);
            assert_eq!(sides.iter().filter(|s| **s == Split::Val).count(), 1, "{n}");
        }
        assert_eq!(assign(&keys(1), &[None], SHARES, 3).len(), 1);
        let all_train = assign(&keys(5), &[None; 5], Shares { val: 0.0, test: 0.0 }, 3);
        assert!(all_train.iter().all(|s| *s == Split::Train));
    }
}
