//! The correspondence search alone: 10,000 points at the built-in subject's posed surface, nine starts each.

use xavatar::config::SearchedField;
use xavatar::doctor::PosedSubject;

use crate::report::Report;

const POINTS: usize = 10_000;
const TRAINING_STEPS: u64 = 300;
const REPEATS: usize = 3;

/// Measures the exact and the baked search.
pub fn measure(report: &mut Report) -> Result<(), Box<dyn std::error::Error>> {
    report.section("search, 10,000 points x 9 starts");
    let subject = PosedSubject::new(TRAINING_STEPS, POINTS)?;
    for (name, field) in [("exact", SearchedField::Exact), ("baked", PosedSubject::BAKED)] {
        let speed = subject.search(field, REPEATS)?;
        let starts = speed.starts as f64;
        report.rate(&format!("search_{name}_roots_per_s"), speed.roots as f64, &speed.seconds, "roots");
        report.number(&format!("search_{name}_evaluations_per_start"), speed.evaluations as f64 / starts, "");
        report.number(&format!("search_{name}_converged"), speed.roots as f64 / starts, "of the starts");
    }
    Ok(())
}
