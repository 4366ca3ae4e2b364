//! How much a judge of meshes minds made ones beside real ones (Wang eq. 4.10 and 4.12, after BEGAN): L = L(real) - k L(made),
//! k <- k + 0.001 (0.7 L(real) - L(made)), from 0, within 0 and 1.

/// Of a step.
const RATE: f64 = 0.001;
/// L(made) as a share of L(real), where k stays.
const SHARE: f64 = 0.7;

/// k.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Balance(f64);

impl Balance {
    /// k.
    pub fn share(self) -> f64 {
        self.0
    }

    /// After a step with these losses.
    #[must_use]
    pub fn after(self, real: f64, made: f64) -> Self {
        Self((self.0 + RATE * (SHARE * real - made)).clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{largest_difference, reference};

    #[test]
    fn the_balance_is_the_references_and_stays_within_its_bounds() {
        let losses = [(2.0, 1.0), (1.5, 1.3), (1.2, 1.4), (1.0, 0.2)];
        let mut balance = Balance::default();
        let found: Vec<f64> = losses
            .iter()
            .map(|(real, made)| {
                balance = balance.after(*real, *made);
                balance.share()
            })
            .collect();
        assert!(largest_difference(&found, &reference("registration_terms")["balance"]) < 1e-15);
        assert_eq!(balance.after(0.0, 1e9).share(), 0.0);
        assert_eq!(balance.after(1e9, 0.0).share(), 1.0);
    }
}
