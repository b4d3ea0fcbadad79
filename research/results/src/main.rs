//! The pages of `docs/results`, written from the measured tables in `docs/results/data/*.json`.
//!
//! ```sh
//! cargo run --release -p veni-results                  # writes docs/results/*.md
//! cargo run --release -p veni-results -- --check       # exit 1 and a line for each page that is not up to date, each link
//!                                                      # that leads nowhere and each head that lacks its equation's number
//! cargo run --release -p veni-results -- add tables/reconstruction.json --topic reconstruction --command "veni-cli …"
//! ```

#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, reason = "a command-line program")]

mod add;
mod data;
mod date;
mod links;
mod page;
mod wrap;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use data::Topic;

/// What went wrong, as a sentence.
type Result<T> = std::result::Result<T, String>;

const USAGE: &str = "usage: veni-results [--check] [--root FOLDER]\n       \
    veni-results add FILE.json --topic TOPIC --command COMMAND [--title TITLE] [--columns A,B,…]\n                    \
    [--commit HASH] [--date YYYY-MM-DD] [--note TEXT]… [--replace] [--root FOLDER]";

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match run(&words) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(words: &[String]) -> Result<ExitCode> {
    let mut words = words.to_vec();
    let folder = match option(&mut words, "--root")? {
        Some(root) => PathBuf::from(root),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."),
    }
    .join("docs/results");
    match words.first().map(String::as_str) {
        None => {
            let pages = pages(&folder)?;
            for (name, text) in &pages {
                let path = folder.join(name);
                std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
            }
            println!("{}: {} pages", folder.display(), pages.len());
            Ok(ExitCode::SUCCESS)
        }
        Some("--check") if words.len() == 1 => {
            let stale = stale(&folder, &pages(&folder)?)?;
            for name in &stale {
                println!("docs/results/{name} differs: run `cargo run --release -p veni-results`");
            }
            let broken = links::broken(&folder.join("../.."))?;
            for line in &broken {
                println!("{line}");
            }
            Ok(if stale.is_empty() && broken.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
        }
        Some("add") => {
            words.remove(0);
            add::run(&folder, words)?;
            run(&["--root".to_owned(), folder.join("../..").display().to_string()])
        }
        Some("--help" | "-h") => {
            println!("{USAGE}");
            Ok(ExitCode::SUCCESS)
        }
        Some(other) => Err(format!("{other} is not an argument\n{USAGE}")),
    }
}

/// Takes `--name VALUE` out of the words.
fn option(words: &mut Vec<String>, name: &str) -> Result<Option<String>> {
    let Some(at) = words.iter().position(|word| word == name) else { return Ok(None) };
    words.remove(at);
    if at == words.len() {
        return Err(format!("{name} needs a value\n{USAGE}"));
    }
    Ok(Some(words.remove(at)))
}

/// Every page by file name.
fn pages(folder: &Path) -> Result<BTreeMap<String, String>> {
    let topics = Topic::all(folder)?;
    let mut pages: BTreeMap<_, _> =
        topics.iter().map(|(name, topic)| (format!("{name}.md"), page::topic(name, topic))).collect();
    pages.insert("README.md".to_owned(), page::index(&topics));
    Ok(pages)
}

/// The pages on disk that are missing, differ, or belong to no data file.
fn stale(folder: &Path, pages: &BTreeMap<String, String>) -> Result<Vec<String>> {
    let mut stale: Vec<String> = pages
        .iter()
        .filter(|(name, text)| std::fs::read_to_string(folder.join(name)).ok().as_ref() != Some(text))
        .map(|(name, _)| name.clone())
        .collect();
    for name in data::names(folder, "md")? {
        let name = format!("{name}.md");
        if !pages.contains_key(&name) {
            stale.push(name);
        }
    }
    stale.sort();
    Ok(stale)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/results")
    }

    #[test]
    fn the_pages_of_this_repository_are_up_to_date() {
        let pages = pages(&folder()).unwrap();
        assert_eq!(stale(&folder(), &pages).unwrap(), Vec::<String>::new());
    }

    /// Numbers with a point in the tables of the summary.
    fn decimals(text: &str) -> Vec<&str> {
        let rows = text.lines().filter(|line| line.starts_with('|'));
        let words = rows.flat_map(|row| row.split(|c: char| !(c.is_ascii_digit() || c == '.')));
        words.filter(|word| word.contains('.') && word.bytes().any(|b| b.is_ascii_digit())).collect()
    }

    #[test]
    fn the_summary_cites_recorded_numbers_only() {
        let summary = std::fs::read_to_string(folder().join("../RESULTS.md")).unwrap();
        let recorded = pages(&folder()).unwrap().into_values().collect::<String>();
        let cited = decimals(&summary);
        assert!(cited.len() > 100, "{} numbers found in docs/RESULTS.md", cited.len());
        let recorded = |word: &str| {
            recorded.match_indices(word).any(|(at, _)| {
                let digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit() || c == '.');
                !digit(recorded[..at].chars().next_back())
                    && !recorded[at + word.len()..].starts_with(|c: char| c.is_ascii_digit())
            })
        };
        let foreign: Vec<_> = cited.into_iter().filter(|word| !recorded(word)).collect();
        assert_eq!(foreign, Vec::<&str>::new(), "in docs/RESULTS.md, but on no page of docs/results");
    }

    #[test]
    fn a_changed_page_a_missing_page_and_a_foreign_page_are_found() {
        let mut pages = pages(&folder()).unwrap();
        let (first, last) = (pages.keys().next().unwrap().clone(), pages.keys().next_back().unwrap().clone());
        let text = pages.get_mut(&first).unwrap();
        *text = text.replacen("# ", "## ", 1);
        pages.remove(&last);
        pages.insert("zz.md".to_owned(), String::new());
        assert_eq!(stale(&folder(), &pages).unwrap(), [first, last, "zz.md".to_owned()]);
    }

    #[test]
    fn arguments_without_value_or_meaning_are_refused() {
        let run = |words: &[&str]| run(&words.iter().map(|&w| w.to_owned()).collect::<Vec<_>>());
        assert!(run(&["--root"]).unwrap_err().contains("needs a value"));
        assert!(run(&["--chekc"]).unwrap_err().contains("--chekc"));
        assert!(run(&["--root", "/nonexistent"]).unwrap_err().contains("/nonexistent"));
    }
}
