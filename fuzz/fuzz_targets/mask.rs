//! `cargo fuzz run mask`: see fuzz/targets.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| veni_fuzz_targets::run("mask", data));
