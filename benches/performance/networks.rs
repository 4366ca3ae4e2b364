//! The paper's three networks against the matrix product itself: 8,192 points, five rounds.

use xavatar::doctor::{NetworkCase, Networks};

use crate::report::Report;

const POINTS: usize = 8192;
const ROUNDS: usize = 5;

/// Measures the reference and each network.
pub fn measure(report: &mut Report) -> Result<(), Box<dyn std::error::Error>> {
    report.section("networks, 8,192 points");
    let mut networks = Networks::new(POINTS)?;
    let mut product_rates = Vec::new();
    for case in NetworkCase::ALL {
        let speed = networks.measure(case, ROUNDS);
        report.rate(&format!("{}_gflops", case.name()), speed.operations * 1e-9, &speed.seconds, "Gflop");
        let share = "of the product's rate in the same round";
        report.number(&format!("{}_of_gemm", case.name()), speed.share_of_product, share);
        product_rates.extend(speed.product_rates);
    }
    product_rates.sort_by(f64::total_cmp);
    let best = product_rates[product_rates.len() - 1];
    let median = product_rates[product_rates.len() / 2];
    report.number("gemm_gflops", median * 1e-9, &format!("Gflop/s, best {:.3}", best * 1e-9));
    Ok(())
}
