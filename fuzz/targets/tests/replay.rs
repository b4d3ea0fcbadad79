//! The corpus and some thousand mutations of each target, on any toolchain: nothing panics, not even where it would be caught;
//! nothing hangs; memory stays within what is declared.
//!
//! One test, because panics and the process's memory are everybody's.

use std::time::{Duration, Instant};

use veni_fuzz_targets::monitor::{Clock, LONGEST, Tally, note_panics};
use veni_fuzz_targets::mutate::Mutator;
use veni_fuzz_targets::{PIXELS, Target, corpus, on_disk, targets};

/// Mutations of each target, and the time after which a slow machine runs fewer.
const MUTATIONS: usize = 2000;
const SECONDS: f64 = 1.0;
/// Memory of the process: 1 GiB and what the pixels that may be declared take.
const MEMORY: u64 = (1 << 30) + veni_image::limits::READ_BYTES_PER_PIXEL * PIXELS as u64;

fn replay(target: &Target) -> Tally {
    let (clock, mut tally) = (Clock::start(target.name), Tally::default());
    let seeds = (target.seeds)();
    assert!(!seeds.is_empty(), "{}", target.name);
    let inputs: Vec<_> =
        seeds.into_iter().chain(corpus(target.name).into_iter().map(|(_, data)| data)).collect();
    inputs.iter().for_each(|data| tally.run(target, data, Some(&clock), None));
    let (mut mutator, begin) = (Mutator::new(20, inputs), Instant::now());
    for _ in 0..MUTATIONS {
        if begin.elapsed() > Duration::from_secs_f64(SECONDS) {
            break;
        }
        let mut data = mutator.mutation();
        (target.repair)(&mut data);
        tally.run(target, &data, Some(&clock), None);
    }
    tally
}

#[test]
fn nothing_panics_hangs_or_fills_the_memory() {
    note_panics();
    // the check must be able to fail: a panic is noted though it is caught, as readers do with a damaged EXR file
    let broken = Target { name: "broken", run: |_| panic!("on purpose"), ..targets()[0] };
    let caught = Target { run: |_| std::panic::catch_unwind(|| panic!("unseen")).is_ok(), ..broken };
    let mut on_purpose = Tally::default();
    on_purpose.run(&broken, b"x", None, None);
    on_purpose.run(&caught, b"x", None, None);

    let mut wrong = Vec::new();
    for target in targets() {
        // a seed that is refused tests only the refusal
        for (k, seed) in (target.seeds)().into_iter().enumerate() {
            if !(target.run)(&on_disk(&seed)) {
                wrong.push(format!("{}: seed {k} is refused", target.name));
            }
        }
        let tally = replay(&target);
        if tally.inputs < 20 {
            wrong.push(format!("{}: only {} inputs", target.name, tally.inputs));
        }
        wrong.extend(tally.crashes.iter().take(3).map(|(_, place)| format!("{}: {place}", target.name)));
        if tally.slowest > LONGEST || tally.largest > MEMORY {
            wrong.push(format!("{}: {:?}, {} MiB", target.name, tally.slowest, tally.largest >> 20));
        }
    }
    // from here on panics are printed again
    drop(std::panic::take_hook());
    let places: Vec<_> = on_purpose.crashes.iter().map(|(_, place)| place.as_str()).collect();
    assert!(
        places.len() == 2 && places[0].contains("on purpose") && places[1].contains("unseen"),
        "{places:?}"
    );
    assert!(wrong.is_empty(), "{wrong:#?}");
}
