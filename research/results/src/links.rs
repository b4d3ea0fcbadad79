//! Links between documents and code: every relative link leads somewhere, and every file that `docs/MODEL.md` names for an
//! equation cites its number in its head ("MODEL (12)").

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use crate::page::anchor;
use crate::{Result, data};

/// Lines of a file in which a citation counts.
const HEAD: usize = 12;

/// What is wrong, a line each.
pub(crate) fn broken(root: &Path) -> Result<Vec<String>> {
    let mut folders: Vec<PathBuf> = [
        "",
        "docs",
        "docs/results",
        "examples",
        "examples/bevy",
        "assets",
        "assets/panoramas",
        "scripts/engines",
    ]
    .map(PathBuf::from)
    .to_vec();
    for entry in std::fs::read_dir(root.join("crates")).map_err(|e| format!("crates: {e}"))? {
        folders.push(Path::new("crates").join(entry.map_err(|e| format!("crates: {e}"))?.file_name()));
    }
    let mut files = Vec::new();
    for folder in folders {
        let names = data::names(&root.join(&folder), "md")?;
        files.extend(names.iter().map(|name| folder.join(format!("{name}.md"))));
    }
    let read = |path: &Path| {
        std::fs::read_to_string(root.join(path)).map_err(|e| format!("{}: {e}", path.display()))
    };
    let mut texts = BTreeMap::new();
    for file in files {
        let text = read(&file)?;
        texts.insert(file, text);
    }
    let mut found = Vec::new();
    for (file, text) in &texts {
        for link in links(text) {
            let (path, fragment) = link.split_once('#').unwrap_or((&link, ""));
            let target = if path.is_empty() { file.clone() } else { beside(file, path) };
            let lost = match texts.get(&target) {
                Some(text) => !fragment.is_empty() && !anchors(text).contains(fragment),
                None => !root.join(&target).exists(),
            };
            if lost {
                found.push(format!("{}: the link {link} leads nowhere", file.display()));
            }
        }
    }
    let model = Path::new("docs/MODEL.md");
    for (file, numbers) in cited(&read(model)?) {
        let file = beside(model, &file);
        let Ok(text) = read(&file) else { continue }; // said above
        let missing = missing(&text, &numbers);
        if !missing.is_empty() {
            let list = missing.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
            found.push(format!("{}: the head does not cite MODEL ({list})", file.display()));
        }
    }
    Ok(found)
}

/// The relative targets of all links outside of code.
fn links(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for line in prose(text) {
        for (at, _) in line.match_indices("](") {
            let rest = &line[at + 2..];
            found.extend(rest.find(')').map(|end| rest[..end].to_owned()));
        }
        found.extend(definition(line).map(|(_, target)| target.to_owned()));
    }
    found.retain(|link| !link.starts_with("http") && !link.contains(char::is_whitespace) && !link.is_empty());
    found
}

/// Lines that are not in a fenced block.
fn prose(text: &str) -> impl Iterator<Item = &str> {
    let mut code = false;
    text.lines().filter(move |line| {
        let fence = line.starts_with("```");
        code ^= fence;
        !code && !fence
    })
}

/// `[label]: target`.
fn definition(line: &str) -> Option<(&str, &str)> {
    let (label, target) = line.strip_prefix('[')?.split_once("]: ")?;
    (!target.contains(' ')).then_some((label, target))
}

fn anchors(text: &str) -> BTreeSet<String> {
    let headings = prose(text)
        .filter_map(|line| line.trim_start_matches('#').strip_prefix(' ').filter(|_| line.starts_with('#')));
    headings.map(|heading| anchor(&plain(heading))).collect()
}

/// A heading as it is shown: `[text](target)` is `text`.
fn plain(heading: &str) -> String {
    let mut out = String::new();
    let mut rest = heading;
    while let Some((before, after)) = rest.split_once("](") {
        out += before;
        rest = after.split_once(')').map_or("", |(_, after)| after);
    }
    out + rest
}

/// A path relative to `file`'s folder, without `..`.
fn beside(file: &Path, path: &str) -> PathBuf {
    let mut out = PathBuf::new();
    for part in file.parent().unwrap_or(Path::new("")).join(path).components() {
        match part {
            Component::ParentDir => drop(out.pop()),
            Component::CurDir => {}
            part => out.push(part),
        }
    }
    out
}

/// The files of the table "Equation to file", as they are linked, with their equations.
fn cited(model: &str) -> BTreeMap<String, BTreeSet<u32>> {
    let targets: BTreeMap<_, _> = model.lines().filter_map(definition).collect();
    let mut files = BTreeMap::<String, BTreeSet<u32>>::new();
    for line in model.lines() {
        let Some((number, rest)) = line.strip_prefix("| (").and_then(|line| line.split_once(") |")) else {
            continue;
        };
        let Ok(number) = number.parse() else { continue };
        for label in rest.split('[').skip(1).filter_map(|part| part.split_once(']')).map(|(label, _)| label) {
            let target = targets.get(label).copied().unwrap_or(label);
            files.entry(target.to_owned()).or_default().insert(number);
        }
    }
    files
}

/// Those of `numbers` that the head of a file does not cite. "MODEL (3, 5–7)" cites 3, 5, 6 and 7.
fn missing(text: &str, numbers: &BTreeSet<u32>) -> Vec<u32> {
    let mut found = BTreeSet::new();
    for line in text.lines().take(HEAD) {
        for (at, mark) in line.match_indices("MODEL (") {
            let list = line[at + mark.len()..].split(')').next().unwrap_or_default();
            for part in list.split(',') {
                let (from, to) = part.trim().split_once('–').unwrap_or((part.trim(), part.trim()));
                if let (Ok(from), Ok(to)) = (from.parse::<u32>(), to.parse()) {
                    found.extend(from..=to);
                }
            }
        }
    }
    numbers.difference(&found).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_and_citations_of_this_repository_hold() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        // the documents name the files of the crates that this folder is the first of
        if root.join("crates/veni-light").exists() {
            assert_eq!(broken(&root).unwrap(), Vec::<String>::new());
        }
    }

    #[test]
    fn links_are_found_outside_of_code_only() {
        let text = "[a](x.md#b) and ![](y.png)\n```\n[c](z.md)\n```\n[d]: ../w.rs\n[e](https://example.org)";
        assert_eq!(links(text), ["x.md#b", "y.png", "../w.rs"]);
        assert_eq!(beside(Path::new("docs/results/a.md"), "../images/b.png"), Path::new("docs/images/b.png"));
    }

    #[test]
    fn anchors_are_those_of_headings() {
        let found = anchors("# A (b) `c`\n## [D](d.md)\n```\n# no\n```\n#no");
        assert_eq!(found.into_iter().collect::<Vec<_>>(), ["a-b-c", "d"]);
    }

    #[test]
    fn a_head_without_its_number_is_noticed() {
        let files = cited("| (3) | S | [a], [b] |\n| (4) | S | [a] |\n| x | y |\n[a]: ../a.rs\n[b]: ../b.rs");
        assert_eq!(files["../a.rs"], BTreeSet::from([3, 4]));
        assert_eq!(missing("//! What. MODEL (1, 3–4).", &files["../a.rs"]), Vec::<u32>::new());
        assert_eq!(missing("//! What. MODEL (1, 3).", &files["../a.rs"]), [4]);
        assert_eq!(missing("//! What.", &files["../b.rs"]), [3]);
    }
}
