//! Some ten seconds of what training is made of, as figures beside those of `docs/performance.md`.
//!
//! The same measurements as in `cargo bench --bench performance`, on fewer points: good to tell a machine, or a build, on which something
//! is wrong; not to tell a change of ten percent.

use serde::Serialize;

use super::{NetworkCase, Networks, PosedSubject};
use crate::Result;
use crate::config::SearchedField;

const DOCUMENT: &str = include_str!("../../docs/performance.md");
const ROUNDS: usize = 2;
const NETWORK_POINTS: usize = 2048;
/// Enough for most starts to converge.
const TRAINING_STEPS: u64 = 60;
const SEARCHED_POINTS: usize = 1500;

/// One figure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// The row's name in docs/performance.md.
    pub name: String,
    /// What it counts.
    pub unit: &'static str,
    /// On this machine.
    pub measured: f64,
    /// In docs/performance.md, on the machine described there.
    pub documented: Option<f64>,
}

/// Measures all figures; `progress` hears which share is done, and what comes next.
///
/// # Errors
/// If there is no folder for temporary files.
pub fn self_test(progress: &mut dyn FnMut(f64, &str)) -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    let mut add = |name: &str, unit: &'static str, measured: f64| {
        figures.push(Figure { name: name.into(), unit, measured, documented: documented(name) });
    };
    progress(0.0, "matrix products and networks");
    let mut networks = Networks::new(NETWORK_POINTS)?;
    let mut product_rates = Vec::new();
    for case in [NetworkCase::GeometryForward, NetworkCase::GeometryNormalStep] {
        let speed = networks.measure(case, ROUNDS);
        product_rates.extend(speed.product_rates);
        add(&format!("{}_gflops", case.name()), "Gflop/s", speed.operations * 1e-9 / speed.seconds.median());
        add(&format!("{}_of_gemm", case.name()), "of the product's rate", speed.share_of_product);
    }
    product_rates.sort_by(f64::total_cmp);
    add("gemm_gflops", "Gflop/s", product_rates[product_rates.len() / 2] * 1e-9);
    progress(0.3, "a skinning network to search on");
    let subject = PosedSubject::new(TRAINING_STEPS, SEARCHED_POINTS)?;
    for (share, name, field) in
        [(0.7, "search_exact", SearchedField::Exact), (0.95, "search_baked", PosedSubject::BAKED)]
    {
        progress(share, "correspondence search");
        let speed = subject.search(field, ROUNDS)?;
        add(&format!("{name}_roots_per_s"), "roots/s", speed.roots as f64 / speed.seconds.median());
        if field == SearchedField::Exact {
            let evaluations = speed.evaluations as f64 / speed.starts as f64;
            add(&format!("{name}_evaluations_per_start"), "evaluations", evaluations);
        }
    }
    progress(1.0, "done");
    Ok(figures)
}

/// The first number of a row's second column in docs/performance.md.
fn documented(name: &str) -> Option<f64> {
    let mut cells = DOCUMENT.lines().filter_map(|line| line.strip_prefix("| ")?.split_once(" | "));
    let (_, value) = cells.find(|(row, _)| row.trim() == name)?;
    value.split([' ', '|']).next()?.replace(',', "").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_document_has_the_figures_that_are_compared() {
        for name in [
            "gemm_gflops",
            "geometry_forward_of_gemm",
            "geometry_normal_step_of_gemm",
            "search_exact_roots_per_s",
            "search_baked_roots_per_s",
            "search_exact_evaluations_per_start",
        ] {
            assert!(documented(name).is_some_and(|value| value > 0.0), "{name}");
        }
        assert!(documented("search_baked_roots_per_s").is_some_and(|roots| roots > 1000.0), "thousands have commas");
        assert_eq!(documented("no_such_row"), None);
    }
}
