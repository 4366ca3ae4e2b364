//! Adam (Kingma & Ba 2015) with its whole state in the open, so that a checkpoint can hold it.
//!
//! m = b1 m + (1 - b1) g,  v = b2 v + (1 - b2) g^2,  p -= rate * (m / (1 - b1^t)) / (sqrt(v / (1 - b2^t)) + epsilon).
//!
//! A grid's table is updated sparsely (Mueller et al. 2022): a number whose gradient is exactly zero in this step keeps its
//! value and moments; t counts all steps.

use serde::{Deserialize, Serialize};

use crate::Real;
use crate::mlp::{Mlp, SummedGradient, for_each_touched};
use xavatar_vector::vectorised;

/// The constants of [`Adam`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdamSettings {
    /// Decay of the first moment.
    pub first_decay: f64,
    /// Decay of the second moment.
    pub second_decay: f64,
    /// Keeps the division finite.
    pub epsilon: f64,
}

impl Default for AdamSettings {
    fn default() -> Self {
        Self { first_decay: 0.9, second_decay: 0.999, epsilon: 1e-8 }
    }
}

/// How one group of parameters is updated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterGroup {
    /// Adam's constants.
    pub settings: AdamSettings,
    /// The learning rate.
    pub rate: f64,
}

/// How a network is updated in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetworkUpdate {
    /// The layers and the condition's embedding.
    pub network: ParameterGroup,
    /// The table of a grid encoding.
    pub grid: ParameterGroup,
    /// What clipping leaves of the gradient.
    pub factor: f64,
}

/// The moments of one flat parameter vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam<T> {
    /// First moment of each parameter.
    pub first_moment: Vec<T>,
    /// Second moment of each parameter.
    pub second_moment: Vec<T>,
    /// Updates done.
    pub updates: u64,
}

impl<T: Real> Adam<T> {
    /// The state before the first update of `length` parameters.
    pub fn new(length: usize) -> Self {
        Self { first_moment: vec![T::zero(); length], second_moment: vec![T::zero(); length], updates: 0 }
    }

    /// Updates `parameters` against `factor * gradient` (the factor is what clipping leaves).
    pub fn step(&mut self, settings: AdamSettings, rate: f64, factor: f64, gradient: &[T], parameters: &mut [T]) {
        self.updates += 1;
        let rule = Rule::<T>::new(ParameterGroup { settings, rate }, factor, self.updates);
        rule.update(gradient, parameters, &mut self.first_moment, &mut self.second_moment);
    }

    /// Updates a network, its table sparsely, and sets the gradient to zero.
    pub fn step_network(&mut self, update: &NetworkUpdate, gradient: SummedGradient<T>, network: &mut Mlp<T>) {
        self.updates += 1;
        let rule = Rule::<T>::new(update.network, update.factor, self.updates);
        let sparse = Rule::<T>::new(update.grid, update.factor, self.updates);
        let entries = gradient.table.len();
        let (first_of_table, first) = self.first_moment.split_at_mut(entries);
        let (second_of_table, second) = self.second_moment.split_at_mut(entries);
        network.update(|parameters| {
            let (table, parameters) = parameters.split_at_mut(entries);
            rule.update(&gradient.network, parameters, first, second);
            let moments = [first_of_table, second_of_table];
            for_each_touched(
                gradient.table,
                table,
                moments,
                #[inline(always)]
                |gradient, parameters, [first, second]| sparse.update_touched(gradient, parameters, first, second),
            );
        });
    }
}

/// One step's constants.
struct Rule<T> {
    first_decay: T,
    second_decay: T,
    /// With the first moment's bias taken out.
    rate: T,
    /// What takes the second moment's bias out.
    correction: T,
    factor: T,
    epsilon: T,
}

impl<T: Real> Rule<T> {
    fn new(ParameterGroup { settings, rate }: ParameterGroup, factor: f64, updates: u64) -> Self {
        let steps = updates as f64;
        Self {
            first_decay: T::of(settings.first_decay),
            second_decay: T::of(settings.second_decay),
            rate: T::of(rate / (1.0 - settings.first_decay.powf(steps))),
            correction: T::of(1.0 / (1.0 - settings.second_decay.powf(steps))),
            factor: T::of(factor),
            epsilon: T::of(settings.epsilon),
        }
    }

    /// The parameter's change and its new moments.
    #[inline(always)]
    fn apply(&self, gradient: T, first: T, second: T) -> (T, T, T) {
        let gradient = self.factor * gradient;
        let first = self.first_decay * first + (T::one() - self.first_decay) * gradient;
        let second = self.second_decay * second + (T::one() - self.second_decay) * gradient * gradient;
        (self.rate * first / ((second * self.correction).sqrt() + self.epsilon), first, second)
    }

    fn update(&self, gradient: &[T], parameters: &mut [T], first: &mut [T], second: &mut [T]) {
        vectorised(
            #[inline(always)]
            || {
                let moments = first.iter_mut().zip(second);
                for ((parameter, gradient), (first, second)) in parameters.iter_mut().zip(gradient).zip(moments) {
                    let change;
                    (change, *first, *second) = self.apply(*gradient, *first, *second);
                    *parameter -= change;
                }
            },
        );
    }

    /// As [`Rule::update`], but only where the gradient is not zero.
    #[inline(always)]
    fn update_touched(&self, gradient: &[T], parameters: &mut [T], first: &mut [T], second: &mut [T]) {
        let moments = first.iter_mut().zip(second);
        for ((parameter, gradient), (first, second)) in parameters.iter_mut().zip(gradient).zip(moments) {
            let touched = *gradient != T::zero();
            let (change, new_first, new_second) = self.apply(*gradient, *first, *second);
            *parameter -= if touched { change } else { T::zero() };
            *first = if touched { new_first } else { *first };
            *second = if touched { new_second } else { *second };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Two updates computed by hand: after the first, |change| = rate whatever the gradient's size.
    #[test]
    fn first_updates_follow_the_definition() {
        let mut adam = Adam::<f64>::new(2);
        let mut parameters = [1.0, -1.0];
        adam.step(AdamSettings::default(), 0.1, 1.0, &[4.0, -0.5], &mut parameters);
        assert!((parameters[0] - 0.9).abs() < 1e-8 && (parameters[1] + 0.9).abs() < 1e-8);
        adam.step(AdamSettings::default(), 0.1, 0.5, &[0.0, 0.0], &mut parameters);
        let m = 0.9 * 0.4 / (1.0 - 0.81);
        let v: f64 = 0.999 * 0.016 / (1.0 - 0.999f64.powi(2));
        assert!((parameters[0] - (0.9 - 0.1 * m / v.sqrt())).abs() < 1e-8);
    }
}
