//! Mutates the seeds and the corpus of a target on any toolchain; the same inputs every time.
//!
//! - `fuzz-stable`: prints the names of the targets
//! - `fuzz-stable TARGET SECONDS [SEED] [FOLDER]`: runs one and prints one JSON object. Inputs that panic are kept in FOLDER;
//!   one that takes longer than 10 s, or ends the process in another way, is left in the folder of the input
//! - `fuzz-stable --seeds FOLDER`: writes seeds and corpus of every target to FOLDER/TARGET
//! - `fuzz-stable --table [--json]`: the JSON objects of standard input as a table, or as one object for docs/results
#![allow(clippy::print_stdout, reason = "a command's result")]

use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::Value;
use veni_fuzz_targets::monitor::{Clock, Tally, note_panics};
use veni_fuzz_targets::mutate::Mutator;
use veni_fuzz_targets::{Target, corpus, target, targets};

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => targets().iter().for_each(|target| println!("{}", target.name)),
        ["--table"] => table(false),
        ["--table", "--json"] => table(true),
        ["--seeds", folder] => write_seeds(Path::new(folder)),
        [name, ref rest @ ..] => {
            let number = |at: usize| rest.get(at).map_or(1, |text| text.parse().expect("a whole number"));
            println!("{}", fuzz(&target(name), number(0), number(1), rest.get(2).map(PathBuf::from)));
        }
    }
}

fn inputs(target: &Target) -> Vec<Vec<u8>> {
    (target.seeds)().into_iter().chain(corpus(target.name).into_iter().map(|(_, data)| data)).collect()
}

fn fuzz(target: &Target, seconds: u64, seed: u64, keep: Option<PathBuf>) -> Value {
    let (clock, mut tally) = (Clock::start(target.name), Tally::default());
    note_panics();
    let inputs = inputs(target);
    let end = Instant::now() + Duration::from_secs(seconds);
    inputs.iter().for_each(|data| tally.run(target, data, Some(&clock), keep.as_deref()));
    let mut mutator = Mutator::new(seed, inputs);
    while Instant::now() < end {
        let mut data = mutator.mutation();
        (target.repair)(&mut data);
        tally.run(target, &data, Some(&clock), keep.as_deref());
    }
    let mut places: Vec<_> = tally.crashes.iter().map(|(_, place)| place.clone()).collect();
    places.sort();
    places.dedup();
    serde_json::json!({
        "target": target.name,
        "by": "mutations",
        "seconds": seconds,
        "inputs": tally.inputs,
        "crashes": tally.crashes.len(),
        "places": places,
        "memory_mib": tally.largest >> 20,
        "slowest_ms": tally.slowest.as_millis() as u64,
    })
}

fn write_seeds(folder: &Path) {
    for target in targets() {
        let own = folder.join(target.name);
        std::fs::create_dir_all(&own).expect("a folder");
        for (k, data) in inputs(&target).into_iter().enumerate() {
            std::fs::write(own.join(format!("seed-{k:03}")), data).expect("a seed");
        }
    }
}

const COLUMNS: [&str; 7] = ["target", "by", "seconds", "inputs", "crashes", "memory_mib", "slowest_ms"];
const TITLES: [&str; 7] = ["target", "by", "seconds", "inputs", "crashes", "memory, MiB", "slowest, ms"];

/// As a page, or as one object of the form that the results of the project are kept in.
fn table(json: bool) {
    let lines = std::io::stdin().lock().lines();
    let rows: Vec<Value> =
        lines.map(|line| serde_json::from_str(&line.expect("text")).expect("a JSON object")).collect();
    let total: u64 = rows.iter().filter_map(|row| row["inputs"].as_u64()).sum();
    let note = format!("{total} inputs in all.");
    if json {
        // by hand: the columns stay in their order
        let pair = |row: &Value, (key, title): (&str, &str)| format!("{}:{}", Value::from(title), row[key]);
        let named = |row: &Value| {
            let pairs: Vec<_> = COLUMNS.into_iter().zip(TITLES).map(|column| pair(row, column)).collect();
            format!("{{{}}}", pairs.join(","))
        };
        let rows: Vec<_> = rows.iter().map(named).collect();
        let (rows, note) = (rows.join(","), Value::from(note));
        println!(r#"{{"name":"fuzzing","title":"Fuzzing","rows":[{rows}],"notes":[{note}]}}"#);
        return;
    }
    println!("| {} |\n|---|---|--:|--:|--:|--:|--:|", TITLES.join(" | "));
    for row in &rows {
        let cell = |key: &str| row[key].as_str().map_or_else(|| row[key].to_string(), str::to_owned);
        println!("| {} |", COLUMNS.map(cell).join(" | "));
    }
    println!("\n{note}");
}
