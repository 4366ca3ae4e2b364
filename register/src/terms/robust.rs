//! The weight that Geman and McClure's function gives a residual: 1 / (1 + (r / s)^2)^2. Far ones count nothing.

/// The weight of a residual of this length, given the scale at which it counts a quarter.
pub fn weight(length: f64, scale: f64) -> f64 {
    let ratio = length / scale;
    1.0 / (1.0 + ratio * ratio).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    // w = rho'(r) / (2 r), rho = r^2 / (1 + (r / s)^2)
    #[test]
    fn it_is_the_slope_of_the_robust_cost() {
        let cost = |r: f64| r * r / (1.0 + (r / 0.3).powi(2));
        for r in [0.01, 0.2, 0.3, 2.0] {
            let slope = (cost(r + 1e-6) - cost(r - 1e-6)) / 2e-6;
            assert!((slope / (2.0 * r) - weight(r, 0.3)).abs() < 1e-8);
        }
    }
}
