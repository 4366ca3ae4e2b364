//! `blsm` guided by coverage.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| xavatar_fuzz::run("blsm", bytes));
