//! Every command and option that a text names is one that can be typed.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use clap::CommandFactory;

use super::Cli;
use crate::features::{GPU, LEARN};

/// Options of cargo and other programs, which documents and messages name too.
const FOREIGN: [&str; 43] = [
    "allocator",
    "array",
    "balls",
    "bench",
    "cases",
    "check",
    "command",
    "compare",
    "cpus-per-task",
    "deploy",
    "details",
    "edges",
    "example",
    "export",
    "features",
    "form",
    "ibl-samples",
    "include",
    "lib",
    "light",
    "mixed",
    "no-default-features",
    "nocapture",
    "only",
    "panorama",
    "path",
    "picture",
    "record",
    "release",
    "runs",
    "same",
    "sampler",
    "samples",
    "scope",
    "signal",
    "stable",
    "test",
    "threads",
    "time",
    "topic",
    "veni",
    "veni-cli",
    "workspace",
];
/// What follows the program's name in a sentence.
const PROSE: [&str; 1] = ["was"];

/// What the command line stands on.
const LIBRARIES: [&str; 8] =
    ["veni-core", "veni-data", "veni-eval", "veni-fit", "veni-gpu", "veni-image", "veni-light", "veni-synth"];

/// The options of each command.
struct Known(BTreeMap<String, BTreeSet<String>>);

impl Known {
    fn new() -> Self {
        let mut cli = Cli::command();
        cli.build();
        let options = |command: &clap::Command| {
            let typed = command
                .get_arguments()
                .filter(|a| !a.is_hide_set())
                .filter_map(|a| a.get_long())
                .map(str::to_owned);
            typed.chain(["help", "version"].map(str::to_owned)).collect()
        };
        Self(cli.get_subcommands().map(|c| (c.get_name().to_owned(), options(c))).collect())
    }

    fn everywhere(&self, option: &str) -> bool {
        self.0.values().any(|options| options.contains(option)) || FOREIGN.contains(&option)
    }

    /// What a text names and nobody can type.
    fn unknown(&self, text: &str) -> Vec<String> {
        let text = text.replace("\\\n", " ");
        let ends = ["\n", "#", "&&", "|", ";", "'", "`", "\"", "(", ")"];
        let mut parts = vec![text.as_str()];
        for end in ends {
            parts = parts.into_iter().flat_map(|part| part.split(end)).collect();
        }
        parts.into_iter().flat_map(|part| self.unknown_in(part)).collect()
    }

    /// The same for what may be one command.
    fn unknown_in(&self, part: &str) -> Vec<String> {
        let words: Vec<_> = part.split_whitespace().collect();
        let mut unknown = Vec::new();
        let mut command = None;
        for (at, word) in words.iter().enumerate() {
            let before = at.checked_sub(1).map(|before| words[before]);
            let names = matches!(before, Some("veni-cli" | "veni")) && is_name(word);
            if names && before == Some("veni-cli") && !PROSE.contains(word) {
                command = self.0.get(*word);
                if command.is_none() {
                    unknown.push(format!("veni-cli {word}"));
                }
            } else if before == Some("cargo") && *word == "bake" {
                command = self.0.get("bake");
            } else if names && at > 1 && words[at - 2] == "cargo" {
                command = self.0.get(*word);
            }
            for option in options(word) {
                let is_known = command.map_or(self.everywhere(option), |options| options.contains(option));
                if !is_known {
                    unknown.push(format!("--{option} in: {}", part.trim()));
                }
            }
        }
        unknown
    }
}

fn is_name(word: &str) -> bool {
    word.chars().all(|c| c.is_ascii_lowercase() || c == '-') && !word.starts_with('-')
}

/// The long options in a word, without their dashes.
fn options(word: &str) -> impl Iterator<Item = &str> {
    word.match_indices("--").filter_map(|(at, dashes)| {
        let before = word[..at].chars().next_back();
        let rest = &word[at + dashes.len()..];
        let end = rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '-')).unwrap_or(rest.len());
        let begins = rest.starts_with(|c: char| c.is_ascii_lowercase());
        (begins && before.is_none_or(|c| !c.is_alphanumeric() && c != '-'))
            .then(|| rest[..end].trim_end_matches('-'))
    })
}

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

#[test]
fn help_names_what_this_build_has() {
    let known = Known::new();
    let mut cli = Cli::command();
    let mut helps = vec![cli.render_long_help().to_string()];
    cli.build();
    helps.extend(cli.get_subcommands_mut().map(|command| command.render_long_help().to_string()));
    let unknown: Vec<_> = helps.iter().flat_map(|help| known.unknown(help)).collect();
    assert!(unknown.is_empty(), "{unknown:#?}");
    // lines are wrapped anywhere
    let flat: Vec<_> =
        helps.iter().map(|help| help.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
    let promises = |words: &str| flat.iter().any(|help| help.contains(words));
    assert_eq!(promises("graphics card"), GPU);
    assert_eq!(promises("trains models"), LEARN);
    assert!(promises("encodes panoramas"), "every build encodes");
}

/// The texts of a crate, each with its file; tests may name what they like.
fn texts(name: &str) -> Vec<(String, String)> {
    let mut texts = Vec::new();
    for (file, source) in structure::read(&workspace().join("crates").join(name).join("src")).unwrap() {
        let file = file.display().to_string();
        if !file.contains("test") && !file.ends_with("advice.rs") {
            texts.extend(structure::strings(&source).into_iter().map(|text| (file.clone(), text)));
        }
    }
    assert!(texts.len() > 30, "only {} texts were found in {name}", texts.len());
    texts
}

#[test]
fn libraries_leave_options_and_commands_to_the_command_line() {
    for (file, text) in LIBRARIES.iter().flat_map(|name| texts(name)) {
        let named = text.split_whitespace().any(|word| options(word).next().is_some());
        assert!(!named && !text.contains("veni-cli"), "{file}: {text}");
    }
}

/// Every page that a user or a contributor reads.
#[cfg(all(feature = "learn", feature = "gpu"))]
fn documents() -> Vec<PathBuf> {
    let files =
        |folder: &Path| std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect::<Vec<_>>();
    let root = workspace();
    let mut folders = files(&root.join("crates"));
    let here = [
        "",
        "assets",
        "assets/panoramas",
        "benches/peer",
        "docs",
        "docs/results",
        "examples",
        "examples/bevy",
        "scripts/engines",
    ];
    for folder in here {
        folders.push(root.join(folder));
    }
    let mut found: Vec<_> = folders.iter().flat_map(|folder| files(folder)).collect();
    found.retain(|path| path.extension().is_some_and(|e| e == "md"));
    assert!(found.len() > 30, "only {} documents were found", found.len());
    found
}

/// Messages and documents speak of the whole program.
#[cfg(all(feature = "learn", feature = "gpu"))]
#[test]
fn messages_and_documents_name_what_there_is() {
    let known = Known::new();
    let mut texts = texts("veni-cli");
    for path in documents() {
        // anchors are made of titles, which may begin with an option
        let text = std::fs::read_to_string(&path).unwrap().replace("](#-", "](# ");
        texts.push((path.display().to_string(), text));
    }
    let unknown: Vec<_> = texts
        .iter()
        .flat_map(|(file, text)| {
            known.unknown(text).into_iter().map(move |unknown| format!("{file}: {unknown}"))
        })
        .collect();
    assert!(unknown.is_empty(), "{unknown:#?}");
}

#[test]
fn what_nobody_can_type_is_found() {
    let known = Known::new();
    let found = |text: &str| known.unknown(text);
    assert_eq!(found("see 'veni-cli bake --size 64 -o a.exr' or --seed 2"), Vec::<String>::new());
    assert_eq!(found("`veni-cli import` reads it"), ["veni-cli import"]);
    assert_eq!(found("leave it out; --made-up does it"), ["--made-up in: --made-up does it"]);
    assert_eq!(found("veni-cli bake --made-up=3"), ["--made-up in: veni-cli bake --made-up=3"]);
    // an option of another command, also behind a line's end
    assert_eq!(found("veni-cli sample --turn 3").len(), 1);
    assert_eq!(found("veni-cli sample \\\n  --turn 3").len(), 1);
    assert_eq!(found("cargo bake --seed 1 --columns 2").len(), 1);
    assert!(found("veni-cli sample -o a.png && veni-cli bake --turn 3").is_empty());
}
