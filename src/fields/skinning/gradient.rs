//! The gradient of the skinning field: a thread's, the threads' sum, and the step against it.

use xavatar_network::{Adam, MlpGradient, NetworkUpdate, ParameterGroup, Real, SummedGradient};

use super::{Kind, Skinning};
use crate::Result;

/// One thread's share of the skinning field's gradient.
#[derive(Debug)]
pub enum SkinningGradient<T> {
    /// Of a network's parameters.
    Network(MlpGradient<T>),
    /// What a grid's is made of once the frame's blocks are done.
    Grid {
        /// By block: the number of its first root, and the cotangents of its roots.
        roots: Vec<(usize, Vec<[T; 3]>)>,
    },
}

/// The skinning field's gradient, summed over threads.
#[derive(Debug)]
pub enum SummedSkinning<'a, T> {
    /// Of a network's parameters.
    Network(SummedGradient<'a, T>),
    /// Of a grid's logits (P).
    Grid(&'a mut [T]),
}

impl<T: Real> SkinningGradient<T> {
    /// Forgets the roots of the frame before.
    pub fn begin_frame(&mut self) {
        if let Self::Grid { roots } = self {
            roots.clear();
        }
    }
}

impl<T: Real> SummedSkinning<'_, T> {
    /// The sum of all entries' squares.
    pub fn squared_norm(&self) -> f64 {
        match self {
            Self::Network(gradient) => gradient.squared_norm(),
            Self::Grid(gradient) => gradient.iter().map(|value| value.wide() * value.wide()).sum(),
        }
    }

    /// The gradient, flat, in the order of [`Skinning::parameters`].
    pub fn to_vec(&self) -> Vec<T> {
        match self {
            Self::Network(gradient) => gradient.to_vec(),
            Self::Grid(gradient) => gradient.to_vec(),
        }
    }
}

impl<T: Real> Skinning<T> {
    /// A thread's gradient that nothing has been added to yet.
    pub fn zero_gradient(&self) -> SkinningGradient<T> {
        match &self.kind {
            Kind::Network(field) => SkinningGradient::Network(field.mlp().zero_gradient()),
            Kind::Grid(_) => SkinningGradient::Grid { roots: Vec::new() },
        }
    }

    /// A gradient of a grid's logits (P) that nothing has been added to yet; empty for a network.
    pub fn zero_logit_gradient(&self) -> Vec<T> {
        match &self.kind {
            Kind::Network(_) => Vec::new(),
            Kind::Grid(field) => field.zero_gradient(),
        }
    }

    /// Pulls a grid's logits to where they began: adds `weight` times the gradient of the mean over touched nodes of |l - l_initial|^2 to
    /// `logits` and returns the mean; none for a network, which follows weights instead.
    ///
    /// # Errors
    /// If `logits` has not one element per logit.
    pub fn pull_to_initial(&self, weight: T, logits: &mut [T]) -> Result<Option<T>> {
        match &self.kind {
            Kind::Network(_) => Ok(None),
            Kind::Grid(field) => Ok(Some(field.pull_to_initial(weight, logits)?)),
        }
    }

    /// Sums the threads' gradients of a network, or takes that of a grid's logits.
    pub fn sum_gradients<'a>(
        &self,
        threads: impl IntoIterator<Item = &'a mut SkinningGradient<T>>,
        logits: &'a mut [T],
    ) -> SummedSkinning<'a, T> {
        match &self.kind {
            Kind::Network(field) => {
                let of_network = |gradient: &'a mut SkinningGradient<T>| match gradient {
                    SkinningGradient::Network(gradient) => Some(gradient),
                    SkinningGradient::Grid { .. } => None,
                };
                SummedSkinning::Network(field.mlp().sum_gradients(threads.into_iter().filter_map(of_network)))
            }
            Kind::Grid(_) => SummedSkinning::Grid(logits),
        }
    }

    /// Moves the parameters against `factor` times the gradient, and sets it to zero: a network at the first of the rates, a grid's logits
    /// at the second.
    pub fn step(
        &mut self,
        gradient: SummedSkinning<T>,
        adam: &mut Adam<T>,
        (network, logits): (ParameterGroup, ParameterGroup),
        factor: f64,
    ) {
        match (&mut self.kind, gradient) {
            (Kind::Network(field), SummedSkinning::Network(gradient)) => {
                adam.step_network(&NetworkUpdate { network, grid: network, factor }, gradient, field.mlp_mut());
            }
            (Kind::Grid(field), SummedSkinning::Grid(gradient)) => {
                field.update(|parameters| adam.step(logits.settings, logits.rate, factor, gradient, parameters));
                gradient.fill(T::zero());
            }
            _ => {}
        }
    }
}
