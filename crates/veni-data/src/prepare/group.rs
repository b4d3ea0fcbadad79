//! Which panoramas belong together: union–find over captures and near-duplicates.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::{Fingerprint, Likeness};

/// What is known of a panorama that is to be grouped.
#[derive(Clone, Copy, Debug)]
pub struct Member<'a> {
    /// Its capture ([`super::capture`]).
    pub capture: &'a str,
    /// What it looks like.
    pub fingerprint: &'a Fingerprint,
}

/// Two panoramas that look alike, by their index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bond {
    /// The earlier one.
    pub first: usize,
    /// The later one.
    pub second: usize,
    /// How alike they are.
    pub likeness: Likeness,
}

/// Panoramas that must stay on one side of a split.
#[derive(Clone, Debug, PartialEq)]
pub struct Groups {
    /// The group of each panorama: its key, the first of its members' captures in alphabetical order.
    pub keys: Vec<String>,
    /// All near-duplicates that were found.
    pub bonds: Vec<Bond>,
}

/// Groups panoramas that share a capture or look alike, directly or through others. Every pair is compared, which takes
/// about a second per 10⁸ pairs and core.
pub fn group(members: &[Member<'_>]) -> Groups {
    let prints: Vec<_> = members.par_iter().map(|m| m.fingerprint.unpack()).collect();
    let bonds: Vec<Bond> = (0..prints.len())
        .into_par_iter()
        .flat_map_iter(|first| {
            let prints = &prints;
            (first + 1..prints.len()).filter_map(move |second| {
                let likeness = prints[first].near_duplicate(&prints[second])?;
                Some(Bond { first, second, likeness })
            })
        })
        .collect();
    let mut parents: Vec<usize> = (0..members.len()).collect();
    let mut by_capture = BTreeMap::new();
    for (at, member) in members.iter().enumerate() {
        let first = *by_capture.entry(member.capture).or_insert(at);
        union(&mut parents, first, at);
    }
    bonds.iter().for_each(|bond| union(&mut parents, bond.first, bond.second));
    let roots: Vec<usize> = (0..members.len()).map(|at| find(&mut parents, at)).collect();
    let mut keys = BTreeMap::new();
    for (member, root) in members.iter().zip(&roots) {
        let key = keys.entry(*root).or_insert(member.capture);
        *key = (*key).min(member.capture);
    }
    Groups { keys: roots.iter().map(|root| keys[root].to_owned()).collect(), bonds }
}

fn find(parents: &mut [usize], mut at: usize) -> usize {
    while parents[at] != at {
        parents[at] = parents[parents[at]];
        at = parents[at];
    }
    at
}

fn union(parents: &mut [usize], a: usize, b: usize) {
    let (a, b) = (find(parents, a), find(parents, b));
    parents[a.max(b)] = a.min(b);
}
