//! What the program's speed claims are made of: networks, search, training steps; see `docs/performance.md`.
//!
//! `cargo bench --bench performance` prints a table and writes `target/performance.json`, a flat map of row names to numbers.
//! Times are medians of several runs, the shortest beside them; one section a file. Rates of networks count the
//! multiply-adds of matrix products only, two operations each, so that they compare with `gemm_gflops`.

mod extraction;
mod networks;
mod report;
mod search;
mod steps;

use report::Report;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A training step runs in a process of its own, whose peak memory is then the step's.
    if let Some(case) = std::env::var_os(steps::CASE) {
        return steps::child(&case.to_string_lossy());
    }
    println!("{} threads", rayon::current_num_threads());
    let mut report = Report::default();
    networks::measure(&mut report)?;
    search::measure(&mut report)?;
    steps::measure(&mut report)?;
    extraction::measure(&mut report)?;
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/target/performance.json");
    report.save(path)?;
    println!("written to {path}");
    Ok(())
}
