//! `cargo fuzz run target`: see fuzz/targets.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| veni_fuzz_targets::run("target", data));
