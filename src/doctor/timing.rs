//! How long something takes, of several runs.

use std::time::Instant;

/// Seconds of several runs, in ascending order.
#[derive(Clone, Debug)]
pub struct Seconds(Vec<f64>);

impl Seconds {
    /// Runs `work` once unmeasured, then `repeats` times, at least once.
    pub fn of(repeats: usize, mut work: impl FnMut()) -> Self {
        work();
        let measured = (0..repeats.max(1)).map(|_| {
            let begin = Instant::now();
            work();
            begin.elapsed().as_secs_f64()
        });
        Self::from(measured.collect::<Vec<_>>())
    }

    /// The middle one; NaN of none.
    pub fn median(&self) -> f64 {
        self.0.get(self.0.len() / 2).copied().unwrap_or(f64::NAN)
    }

    /// The shortest; NaN of none.
    pub fn shortest(&self) -> f64 {
        self.0.first().copied().unwrap_or(f64::NAN)
    }
}

impl From<Vec<f64>> for Seconds {
    fn from(mut seconds: Vec<f64>) -> Self {
        seconds.sort_by(f64::total_cmp);
        Self(seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_the_middle_and_the_work_runs_once_more() {
        let seconds = Seconds::from(vec![3.0, 1.0, 2.0]);
        assert_eq!((seconds.median(), seconds.shortest()), (2.0, 1.0));
        assert!(Seconds::from(Vec::new()).median().is_nan());
        let mut runs = 0;
        Seconds::of(4, || runs += 1);
        assert_eq!(runs, 5);
    }
}
