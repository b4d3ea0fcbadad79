//! From the names in the files to the files that define them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::krate::{Modules, Names, modules};
use crate::{Graph, Sources};

/// More steps than any chain of re-exports takes.
const STEPS: usize = 32;

/// Which file uses which, in the crate whose root is `lib.rs` or `main.rs`.
pub fn graph(sources: &Sources) -> Graph {
    let mut graph = Graph::new();
    for root in ["lib.rs", "main.rs"] {
        let modules = modules(sources, Path::new(root));
        for (name, module) in &modules {
            let used = graph.entry(module.file.clone()).or_default();
            for path in module.named.iter().chain(&module.globs) {
                used.extend(defined(&modules, name, path, STEPS));
            }
            used.remove(&module.file);
        }
    }
    graph
}

/// The files that define what `path` names, seen from the module `from`; none for what comes from elsewhere.
fn defined(modules: &Modules, from: &Names, path: &[String], steps: usize) -> BTreeSet<PathBuf> {
    let nothing = BTreeSet::new();
    let Some(steps) = steps.checked_sub(1) else { return nothing };
    let Some(first) = path.first() else { return nothing };
    let (mut at, mut rest) = match first.as_str() {
        "crate" => (Names::new(), &path[1..]),
        "self" => (from.clone(), &path[1..]),
        "super" => (from.clone(), path),
        name => {
            let Some(module) = modules.get(from) else { return nothing };
            if !module.children.contains(name) {
                // a name that was brought in, if it stands for something longer
                return match module.imports.get(name).filter(|target| target.as_slice() != path) {
                    Some(target) if target.first() != Some(first) || target.len() > 1 => {
                        let whole: Names = target.iter().chain(&path[1..]).cloned().collect();
                        defined(modules, from, &whole, steps)
                    }
                    _ => nothing,
                };
            }
            (from.clone(), path)
        }
    };
    while let Some(name) = rest.first() {
        let Some(module) = modules.get(&at) else { return nothing };
        if name == "super" {
            at.pop();
        } else if module.children.contains(name) {
            at.push(name.clone());
        } else if let Some(target) = module.imports.get(name) {
            let whole: Names = target.iter().chain(&rest[1..]).cloned().collect();
            return if whole.len() == 1 { nothing } else { defined(modules, &at, &whole, steps) };
        } else {
            // defined here, or in a module all of whose names are brought in: the first would be found by a compiler, and
            // here the module itself stands for all
            return BTreeSet::from([module.file.clone()]);
        }
        rest = &rest[1..];
    }
    modules.get(&at).map(|module| BTreeSet::from([module.file.clone()])).unwrap_or_default()
}
