//! How good a body's space of shapes is beside people that it was not trained on (METHOD-BODY 7), by its first k directions.
//!
//! *Compactness*: the share of the variance that they have. *Generalisation*: how far people at rest are from what they make of them. *Specificity*: how far
//! people that are drawn from them are from the nearest one; both the mean distance of a vertex. A person at rest is the mean of its registrations, un-posed.

use glam::{DMat3, DVec3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use xavatar_body::{BodyModel, ShapeSpace};

use crate::core::{Fitted, FittedBody, shaped, unposed};

/// People that are drawn.
const DRAWN: usize = 1000;

/// Of k directions.
pub(super) struct Measures {
    pub compactness: f64,
    pub generalisation: f64,
    pub specificity: f64,
}

/// A body's space, and people at rest (V).
pub(super) struct Space {
    space: ShapeSpace,
    compactness: Vec<f64>,
    generalisation: Vec<f64>,
    people: Vec<Vec<f64>>,
    draws: Vec<Vec<f64>>,
}

impl Space {
    pub fn of(model: &BodyModel, people: &[Vec<DVec3>]) -> Self {
        let flat = |values: &[f32]| values.iter().map(|value| f64::from(*value)).collect::<Vec<f64>>();
        let width = 3 * model.vertex_count();
        let directions: Vec<Vec<f64>> = model
            .anatomy()
            .shapes
            .directions()
            .take(model.shape_coefficients())
            .map(|row| if row.is_empty() { vec![0.0; width] } else { flat(row) })
            .collect();
        let mean = model.template().iter().flat_map(|place| place.as_dvec3().to_array()).collect();
        let space = ShapeSpace::of_directions(mean, &directions);
        let people: Vec<Vec<f64>> =
            people.iter().map(|shape| shape.iter().flat_map(|place| place.to_array()).collect()).collect();
        let mut random = ChaCha8Rng::seed_from_u64(0);
        let draws = (0..DRAWN).map(|_| (0..directions.len()).map(|_| StandardNormal.sample(&mut random)).collect());
        Self {
            compactness: space.compactness(),
            generalisation: space.generalisation(&people),
            draws: draws.collect(),
            people,
            space,
        }
    }

    /// Of the first `count` directions; none if there are no directions or no people.
    pub fn measures(&self, count: usize) -> Option<Measures> {
        let last = count.min(self.compactness.len()).checked_sub(1).filter(|_| !self.people.is_empty())?;
        let distances: Vec<f64> = self
            .draws
            .par_iter()
            .map(|draw| ShapeSpace::specificity(&self.space.shape(&draw[..=last]), &self.people))
            .collect();
        Some(Measures {
            compactness: self.compactness[last],
            generalisation: self.generalisation[last],
            specificity: distances.iter().sum::<f64>() / DRAWN as f64,
        })
    }
}

/// A person at rest (V), by its registrations and what was fitted to them.
pub(super) fn at_rest(model: &BodyModel, body: &FittedBody, frames: &[Vec<DVec3>], found: &[Fitted]) -> Vec<DVec3> {
    let of_frame = |(frame, found): (&Vec<DVec3>, &Fitted)| -> Vec<DVec3> {
        let (posed, _) = body.posed(&found.pose, &found.shape);
        let turns: &[DMat3] = &posed.turns;
        unposed(&posed.positions, turns, frame, &shaped(model, &found.shape).template)
    };
    let all: Vec<Vec<DVec3>> = frames.par_iter().zip(found).map(of_frame).collect();
    let at = |vertex: usize| all.iter().map(|frame| frame[vertex]).sum::<DVec3>() / all.len().max(1) as f64;
    (0..model.vertex_count()).map(at).collect()
}
