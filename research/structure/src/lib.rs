//! Which file of a crate uses which, read from its source text, and the circles among them.
//!
//! A file uses another if it names something that the other defines: in a `use`, or by a path in its code. Declaring
//! `mod x;` is no use of it, and what a file passes on with `pub use` belongs to where it is defined. Tests are left
//! out: they may look at everything. Paths are read without a compiler: names that macros build, methods and traits
//! are not seen.

#![forbid(unsafe_code)]

mod circles;
mod graph;
mod krate;
mod tokens;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The text of a crate's files, by their paths below `src`.
pub type Sources = BTreeMap<PathBuf, String>;

/// For each file, the files that it uses.
pub type Graph = BTreeMap<PathBuf, BTreeSet<PathBuf>>;

pub use circles::circles;
pub use graph::graph;

/// Reads all Rust files below a folder.
///
/// # Errors
/// What the system says.
pub fn read(folder: &Path) -> std::io::Result<Sources> {
    let (mut sources, mut folders) = (Sources::new(), vec![folder.to_path_buf()]);
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let name = path.strip_prefix(folder).unwrap_or(&path).to_path_buf();
                sources.insert(name, std::fs::read_to_string(&path)?);
            }
        }
    }
    Ok(sources)
}

/// The texts of all strings of a Rust file, tests left out.
pub fn strings(source: &str) -> Vec<String> {
    let text = |token| match token {
        tokens::Token::Text(text) => Some(text),
        _ => None,
    };
    tokens::tokens(source).into_iter().filter_map(text).collect()
}

/// The module directly below the root that a file belongs to; the root's own file has none.
pub fn top_module(file: &Path) -> Option<String> {
    let first = file.components().next()?.as_os_str().to_string_lossy().into_owned();
    match first.strip_suffix(".rs") {
        Some("lib" | "main") => None,
        Some(name) => Some(name.to_owned()),
        None => Some(first),
    }
}
