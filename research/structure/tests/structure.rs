//! The files of each crate form floors: what is used never uses what uses it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use structure::{Graph, Sources, circles, graph, read, top_module};

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Every library and program of the workspace.
fn crates() -> Vec<(String, Sources)> {
    let folders = std::fs::read_dir(workspace().join("crates")).unwrap();
    let mut folders: Vec<_> = folders.map(|entry| entry.unwrap().path()).collect();
    folders.push(workspace());
    folders.sort();
    let named = |folder: PathBuf| {
        let name = folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let source = folder.join("src");
        source.is_dir().then(|| (name, read(&source).unwrap()))
    };
    folders.into_iter().filter_map(named).collect()
}

/// The circles, each with the arrows in it.
fn describe(graph: &Graph, circles: &[Vec<PathBuf>]) -> String {
    let mut text = String::new();
    for circle in circles {
        text += "\ncircle:";
        for file in circle {
            for used in graph[file].iter().filter(|used| circle.contains(used)) {
                text += &format!("\n  {} uses {}", file.display(), used.display());
            }
        }
    }
    text
}

#[test]
fn no_circle_crosses_the_modules_of_a_crate() {
    let crates = crates();
    assert!(crates.len() > 2, "only {} crates were found", crates.len());
    for (name, sources) in crates {
        let graph = graph(&sources);
        let mut circles = circles(&graph);
        circles
            .retain(|circle| circle.iter().map(|file| top_module(file)).collect::<BTreeSet<_>>().len() > 1);
        assert!(circles.is_empty(), "{name}:{}", describe(&graph, &circles));
    }
}

/// The command line has no circle at all.
fn command_line() -> Sources {
    read(&workspace().join("crates/veni-cli/src")).unwrap()
}

#[test]
fn no_file_of_the_command_line_uses_one_that_uses_it() {
    let graph = graph(&command_line());
    let circles = circles(&graph);
    assert!(circles.is_empty(), "{}", describe(&graph, &circles));
    // the scan has seen the files, and what they use
    let uses =
        |file: &str| graph[Path::new(file)].iter().map(|f| f.display().to_string()).collect::<Vec<_>>();
    assert!(uses("cli.rs").contains(&"commands/bake.rs".to_owned()), "{:?}", uses("cli.rs"));
    assert!(uses("commands/bake.rs").contains(&"args.rs".to_owned()), "{:?}", uses("commands/bake.rs"));
    let seen = graph.len();
    assert!(seen > 40, "only {seen} files were seen");
}

#[test]
fn a_circle_is_found_when_one_is_made() {
    let mut sources = command_line();
    sources.get_mut(Path::new("args.rs")).unwrap().push_str("\nuse crate::cli::Cli;\n");
    let circles = circles(&graph(&sources));
    let has = |name: &str| circles.iter().flatten().any(|file| file == Path::new(name));
    assert!(has("args.rs") && has("cli.rs") && has("commands/bake.rs"), "{circles:?}");
}

#[test]
fn every_way_to_name_a_file_counts() {
    let low = "pub mod deep;\npub use deep::Thing;\npub struct Own;\n";
    let circle = |high: &str, deep: &str| {
        let files =
            [("lib.rs", "mod high; mod low;"), ("high.rs", high), ("low.rs", low), ("low/deep.rs", deep)];
        let sources = files.into_iter().map(|(name, text)| (name.into(), text.to_owned())).collect();
        circles(&graph(&sources)).into_iter().flatten().map(|f| f.display().to_string()).collect::<Vec<_>>()
    };
    let both = ["high.rs", "low/deep.rs"];
    for high in [
        "use crate::low::deep::Thing;",
        "use crate::low::Thing;",
        "use crate::{low::{Thing as Other}};",
        "use super::low; fn f() { low::Thing }",
        "fn f() -> crate::low::deep::Thing {}",
    ] {
        for deep in ["use crate::high::f;", "fn g() { super::super::high::f() }"] {
            let circle = circle(high, deep);
            assert!(
                both.iter().all(|file| circle.iter().any(|f| f == file)),
                "{high} and {deep}: {circle:?}"
            );
        }
        for none in ["", "// use crate::high::f;", "#[cfg(test)] mod tests { use crate::high::f; }"] {
            assert!(circle(high, none).is_empty(), "{high} and {none}");
        }
    }
    assert_eq!(circle("", "use super::Own;"), ["low/deep.rs", "low.rs"]);
    assert!(circle("use crate::low::Own;", "use other::high::f;").is_empty());
}
