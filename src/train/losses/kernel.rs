//! The table of losses: which there are, at which points each is computed, and by what.

use std::ops::Range;

use xavatar_network::Real;

use super::worker::{Frame, Worker};
use super::{CanonicalBatch, LossTerms, bone, eikonal, off_surface, on_surface, weights};
use crate::Result;
use crate::config::LossSettings;
use crate::fields::BLOCK_ROWS;

/// A loss.
pub(super) struct Term {
    /// Its name in records, that of its weight among the settings.
    pub name: &'static str,
    pub weight: fn(&LossSettings) -> f64,
}

/// Adds the losses of some of its points, and the gradients.
type Run<T> = fn(&mut Worker<T>, &Frame<T>, Range<usize>) -> Result<()>;

/// What computes one loss, or those that share their points.
pub(super) struct Kernel<T> {
    /// It runs if one of these has a weight.
    pub terms: &'static [Term],
    /// How many points a batch has for it.
    pub points: fn(&CanonicalBatch<T>) -> usize,
    /// Adds the losses of a block of them, and the gradients.
    pub run: Run<T>,
}

/// All of them, the dearest first: threads take turns.
fn kernels<T: Real>() -> [Kernel<T>; 8] {
    [
        on_surface::kernel(),
        off_surface::captured(),
        off_surface::far(),
        eikonal::kernel(),
        bone::kernel(),
        weights::surface(),
        weights::volume(),
        weights::joint(),
    ]
}

/// Consecutive points of one kernel.
pub(super) struct Block<T> {
    run: Run<T>,
    rows: Range<usize>,
}

impl<T: Real> Block<T> {
    pub fn run(&self, worker: &mut Worker<T>, frame: &Frame<T>) -> Result<()> {
        (self.run)(worker, frame, self.rows.clone())
    }
}

/// The blocks of every kernel of which a term has a weight.
pub(super) fn blocks<T: Real>(batch: &CanonicalBatch<T>, losses: &LossSettings) -> Vec<Block<T>> {
    let is_wanted = |kernel: &Kernel<T>| kernel.terms.iter().any(|term| (term.weight)(losses) > 0.0);
    let cut = |Kernel { points, run, .. }: Kernel<T>| {
        let count = points(batch);
        (0..count).step_by(BLOCK_ROWS).map(move |first| Block { run, rows: first..count.min(first + BLOCK_ROWS) })
    };
    kernels().into_iter().filter(is_wanted).flat_map(cut).collect()
}

/// The weighted sum of terms.
pub(super) fn total<T: Real>(terms: &LossTerms, losses: &LossSettings) -> f64 {
    let kernels = kernels::<T>();
    let weight = |name: &str| {
        let term = kernels.iter().flat_map(|kernel| kernel.terms).find(|term| term.name == name);
        term.map_or(0.0, |term| (term.weight)(losses))
    };
    terms.iter().map(|(name, value)| weight(name) * value).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    // A weight that no kernel looks at would be a setting without effect.
    #[test]
    fn every_weight_among_the_settings_is_that_of_a_term() {
        let losses = toml::Table::try_from(Config::preset("demo").unwrap().losses).unwrap();
        let names: Vec<_> = kernels::<f64>().iter().flat_map(|kernel| kernel.terms).map(|term| term.name).collect();
        for (key, value) in losses.iter().filter(|(key, value)| value.is_float() && *key != "truncation") {
            assert!(names.contains(&key.as_str()), "{key} = {value}");
        }
    }
}
