//! `fuzz-stable TARGET SECONDS [SEED] [FOLDER]`: mutates the seeds and the corpus of a target for so long, on any toolchain,
//! and prints one JSON object. `fuzz-stable` alone prints the names of the targets. Inputs that panic are kept in FOLDER;
//! one that takes longer than 10 s, or ends the process in another way, is left in the folder of the input.
#![allow(clippy::print_stdout, reason = "a command's result")]

use std::path::PathBuf;
use std::time::{Duration, Instant};

use veni_fuzz_targets::mutate::Mutator;
use veni_fuzz_targets::watch::{Clock, Tally, watch};
use veni_fuzz_targets::{corpus, target, targets};

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let Some(name) = args.first() else {
        targets().iter().for_each(|target| println!("{}", target.name));
        return;
    };
    let number = |at: usize| args.get(at).map_or(1, |text| text.parse::<u64>().expect("a whole number"));
    let (seconds, seed, keep) = (number(1), number(2), args.get(3).map(PathBuf::from));
    let target = target(name);
    let (clock, mut tally) = (Clock::start(target.name), Tally::default());
    watch();
    let inputs: Vec<_> =
        (target.seeds)().into_iter().chain(corpus(name).into_iter().map(|(_, data)| data)).collect();
    let end = Instant::now() + Duration::from_secs(seconds);
    inputs.iter().for_each(|data| tally.run(&target, data, Some(&clock), keep.as_deref()));
    let mut mutator = Mutator::new(seed, inputs);
    while Instant::now() < end {
        let mut data = mutator.next();
        (target.repair)(&mut data);
        tally.run(&target, &data, Some(&clock), keep.as_deref());
    }
    let mut places: Vec<_> = tally.crashes.iter().map(|(_, place)| place.clone()).collect();
    places.sort();
    places.dedup();
    println!(
        "{}",
        serde_json::json!({
            "target": name,
            "inputs": tally.inputs,
            "crashes": tally.crashes.len(),
            "places": places,
            "memory_mib": tally.largest >> 20,
            "slowest_ms": tally.slowest.as_millis() as u64,
        })
    );
}
