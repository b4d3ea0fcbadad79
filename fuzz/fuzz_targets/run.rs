//! `cargo fuzz run run`: see fuzz/targets.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| veni_fuzz_targets::run("run", data));
