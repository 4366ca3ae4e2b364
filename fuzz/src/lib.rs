//! Every reader of untrusted bytes as a [`Target`], and mutated inputs to try them with. No input may make one panic, hang or take
//! memory beyond what its format allows.
//!
//! The same targets run three ways: some thousand inputs each among the tests (`cargo test`); as many as wanted on any toolchain,
//! `cargo run --release -p xavatar-fuzz -- 1000000`, with a table of counts, times and memory; and guided by coverage,
//! `cargo +nightly fuzz run npz --features libfuzzer`. What once failed is kept in `corpus/TARGET/` and tried first.

mod drive;
mod mutation;
mod targets;

pub use drive::{Failure, Tally, drive, drive_known, found_before};
pub use mutation::mutated;
pub use targets::{TARGETS, Target, run};
