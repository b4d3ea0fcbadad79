//! Files that use one another.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::Graph;

/// The largest sets of files in which each uses each other, directly or through others.
pub fn circles(graph: &Graph) -> Vec<Vec<PathBuf>> {
    let reached: BTreeMap<&Path, BTreeSet<&Path>> =
        graph.keys().map(|file| (file.as_path(), reached(graph, file))).collect();
    let (mut found, mut seen) = (Vec::new(), BTreeSet::new());
    for (file, from) in &reached {
        let circle: Vec<_> = from
            .iter()
            .filter(|other| reached.get(*other).is_some_and(|r| r.contains(file)))
            .copied()
            .collect();
        if circle.len() > 1 && circle.iter().all(|file| seen.insert(*file)) {
            found.push(circle.into_iter().map(Path::to_path_buf).collect());
        }
    }
    found
}

/// All files that one uses, directly or through others.
fn reached<'a>(graph: &'a Graph, file: &'a Path) -> BTreeSet<&'a Path> {
    let (mut reached, mut waiting) = (BTreeSet::new(), vec![file]);
    while let Some(next) = waiting.pop() {
        for used in graph.get(next).into_iter().flatten() {
            if reached.insert(used.as_path()) {
                waiting.push(used);
            }
        }
    }
    reached
}
