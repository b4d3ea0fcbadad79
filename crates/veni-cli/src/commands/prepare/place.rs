//! Which files are kept, under which name and on which side.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::Result;
use veni_data::prepare::{Bond, Member, Shares, Split, assign, group};

use super::record::{Fate, Record};
use super::store::Store;

/// What decides about sides.
pub(super) struct Placing {
    pub(super) shares: Shares,
    pub(super) seed: u64,
    pub(super) resplit: bool,
}

/// A panorama of the training set.
pub(super) struct Kept {
    pub(super) record: Record,
    pub(super) group: String,
    pub(super) split: Split,
    /// Relative to the folder.
    pub(super) file: String,
}

/// What became of everything.
pub(super) struct Placed {
    /// By split, then by name.
    pub(super) kept: Vec<Kept>,
    /// Files with the very bytes of a kept one: the record, and the kept one's source.
    pub(super) duplicates: Vec<(Record, String)>,
    /// Sources, or what could not even be looked at, and why.
    pub(super) refused: Vec<(String, String)>,
    /// Pairs of sources that look alike.
    pub(super) alike: Vec<(String, String, Bond)>,
}

/// Groups, splits, names and moves the images.
pub(super) fn place(
    store: &mut Store,
    placing: &Placing,
    unreadable: Vec<(PathBuf, String)>,
) -> Result<Placed> {
    let mut first: BTreeMap<String, String> = BTreeMap::new();
    let (mut fit, mut duplicates, mut refused) = (Vec::new(), Vec::new(), Vec::new());
    for record in store.records() {
        let record = record.clone();
        match &record.fate {
            Fate::Refused(reason) => refused.push((record.source.clone(), reason.clone())),
            Fate::Fit(facts) => match first.get(&facts.id) {
                Some(source) => duplicates.push((record.clone(), source.clone())),
                None => {
                    first.insert(facts.id.clone(), record.source.clone());
                    fit.push(record);
                }
            },
        }
    }
    refused.extend(unreadable.into_iter().map(|(path, reason)| (path.display().to_string(), reason)));
    refused.sort();
    let captures: Vec<String> = fit.iter().map(Record::capture).collect();
    let members: Vec<Member<'_>> = (fit.iter().zip(&captures))
        .filter_map(|(r, capture)| Some(Member { capture, fingerprint: &r.facts()?.fingerprint }))
        .collect();
    let groups = group(&members);
    let given: Vec<Option<Split>> = fit.iter().map(|r| r.given.filter(|_| !placing.resplit)).collect();
    let sides = assign(&groups.keys, &given, placing.shares, placing.seed);
    let alike = groups.bonds.iter().map(|b| (fit[b.first].source.clone(), fit[b.second].source.clone(), *b));
    let alike = alike.collect();
    let names = names(&fit);
    let mut kept: Vec<Kept> = (fit.into_iter().zip(groups.keys).zip(sides).zip(names))
        .map(|(((record, group), split), name)| Kept {
            file: format!("{split}/{name}.exr"),
            record,
            group,
            split,
        })
        .collect();
    kept.sort_by(|a, b| (a.split, &a.file).cmp(&(b.split, &b.file)));
    let ids = |k: &Kept| Some((k.record.facts()?.id.clone(), k.file.clone()));
    store.move_images(&kept.iter().filter_map(ids).collect())?;
    Ok(Placed { kept, duplicates, refused, alike })
}

/// Each file's own name, with the start of its hash behind it where several have the same.
fn names(records: &[Record]) -> Vec<String> {
    let mut count: BTreeMap<String, usize> = BTreeMap::new();
    // some file systems do not tell upper from lower case
    records.iter().for_each(|r| *count.entry(r.stem().to_lowercase()).or_default() += 1);
    let name = |r: &Record| match (count[&r.stem().to_lowercase()], r.facts()) {
        (2.., Some(facts)) => format!("{}-{}", r.stem(), &facts.id[..8]),
        _ => r.stem(),
    };
    records.iter().map(name).collect()
}
