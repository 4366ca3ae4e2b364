//! Bones of people of whom registrations say unequally much (factor analysis with known noise; METHOD-BODY 9.4 b).
//!
//! What a person's registrations say of the coefficients x of free bones is x^T H x / 2 - h^T x, in units of their noise: a bone about which little turns has
//! hardly any H. x = m + P c with c ~ N(0, 1): m and P by expectation maximisation, from the principal components of each person's own
//! most probable x. So a bone that one person's poses leave open is as in the people whose poses tell it. B bones, K factors.

use nalgebra::{DMatrix, DVector};

use crate::core::Factor;

/// Rounds of expectation and maximisation.
const ROUNDS: usize = 300;
/// What holds an entry of m and P at zero.
const HELD: f64 = 1.0;

/// What registrations say of coefficients of unit variance (B).
#[derive(Clone, Debug)]
pub(super) struct SaidOfBones {
    /// H (B, B).
    pub matrix: DMatrix<f64>,
    /// h (B).
    pub vector: DVector<f64>,
}

impl SaidOfBones {
    /// Of no registrations.
    pub fn nothing(bones: usize) -> Self {
        Self { matrix: DMatrix::zeros(bones, bones), vector: DVector::zeros(bones) }
    }

    /// x of one person alone.
    pub fn most_probable(&self) -> Option<DVector<f64>> {
        let held = &self.matrix + DMatrix::identity(self.vector.len(), self.vector.len());
        Some(Factor::of(&held)?.solve(&self.vector)).filter(|found| found.iter().all(|value| value.is_finite()))
    }
}

/// The most probable x (B) of each person, given all of them, with at most so many factors; none if equations cannot be solved.
pub(super) fn bones_of_people(people: &[SaidOfBones], factors: usize) -> Option<Vec<DVector<f64>>> {
    let (mut mean, mut loadings) = first_loadings(people, factors)?;
    let mut found = Vec::new();
    for _ in 0..ROUNDS {
        let expected: Vec<Expected> =
            people.iter().map(|said| Expected::of(said, &mean, &loadings)).collect::<Option<_>>()?;
        found = expected.iter().map(|of| &mean + &loadings * &of.mean).collect();
        (mean, loadings) = maximised(people, &expected)?;
    }
    Some(found)
}

/// c of one person: its mean and its covariance.
struct Expected {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Expected {
    fn of(said: &SaidOfBones, mean: &DVector<f64>, loadings: &DMatrix<f64>) -> Option<Self> {
        let seen = loadings.transpose() * &said.matrix;
        let precision = &seen * loadings + DMatrix::identity(loadings.ncols(), loadings.ncols());
        let factor = Factor::of(&precision)?;
        Some(Self {
            mean: factor.solve(&(loadings.transpose() * &said.vector - seen * mean)),
            covariance: factor.solve_all(&DMatrix::identity(loadings.ncols(), loadings.ncols())),
        })
    }
}

/// m and P from the principal components of what each person alone is.
fn first_loadings(people: &[SaidOfBones], factors: usize) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let alone: Vec<DVector<f64>> = people.iter().map(SaidOfBones::most_probable).collect::<Option<_>>()?;
    let bones = alone.first()?.len();
    let mean = alone.iter().fold(DVector::zeros(bones), |sum, of| sum + of) / alone.len() as f64;
    let centred = DMatrix::from_columns(&alone.iter().map(|of| of - &mean).collect::<Vec<_>>());
    let parts = (centred / (alone.len() as f64).sqrt()).svd(true, false);
    let mut order: Vec<usize> = (0..parts.singular_values.len()).collect();
    order.sort_by(|one, other| parts.singular_values[*other].total_cmp(&parts.singular_values[*one]));
    let directions = parts.u?;
    let kept: Vec<DVector<f64>> =
        order.iter().take(factors).map(|at| directions.column(*at) * parts.singular_values[*at]).collect();
    Some((mean, DMatrix::from_columns(&kept)))
}

/// m and P that are the most probable with what is expected of each person: sum_i E[c c^T] x H_i of [m | P].
fn maximised(people: &[SaidOfBones], expected: &[Expected]) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let bones = people.first()?.vector.len();
    let factors = expected.first()?.mean.len();
    let count = (factors + 1) * bones;
    let mut matrix = DMatrix::identity(count, count) * HELD;
    let mut right = DVector::zeros(count);
    for (said, of) in people.iter().zip(expected) {
        let with_one = |at: usize| if at == 0 { 1.0 } else { of.mean[at - 1] };
        for one in 0..=factors {
            for other in 0..=factors {
                let own = if one > 0 && other > 0 { of.covariance[(one - 1, other - 1)] } else { 0.0 };
                let mut block = matrix.view_mut((one * bones, other * bones), (bones, bones));
                block += &said.matrix * (with_one(one) * with_one(other) + own);
            }
            let mut rows = right.rows_mut(one * bones, bones);
            rows += &said.vector * with_one(one);
        }
    }
    let solved = Factor::of(&matrix)?.solve(&right);
    let column = |at: usize| solved.rows(at * bones, bones).into_owned();
    Some((column(0), DMatrix::from_columns(&(1..=factors).map(column).collect::<Vec<_>>())))
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    // Each person's poses tell half of the bones, the others they leave open.
    #[test]
    fn a_bone_that_a_persons_poses_leave_open_is_as_in_others() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let (bones, people) = (12, 40);
        let loadings = DMatrix::from_fn(bones, 2, |_, _| normal());
        let truth: Vec<DVector<f64>> = (0..people).map(|_| &loadings * DVector::from_fn(2, |_, _| normal())).collect();
        let noise = 0.1;
        let mut random = ChaCha8Rng::seed_from_u64(6);
        let said = truth.iter().map(|of| {
            let information = |_, _| if random.random::<bool>() { 1.0 / (noise * noise) } else { 1e-6 };
            let information = DVector::from_fn(bones, information);
            let seen = of.map(|value| value + noise * normal());
            SaidOfBones { vector: information.component_mul(&seen), matrix: DMatrix::from_diagonal(&information) }
        });
        let said: Vec<SaidOfBones> = said.collect();
        let distance = |found: &[DVector<f64>]| {
            found.iter().zip(&truth).map(|(found, truth)| (found - truth).norm_squared()).sum::<f64>().sqrt()
        };
        let alone: Vec<DVector<f64>> = said.iter().map(|of| of.most_probable().unwrap()).collect();
        let together = bones_of_people(&said, 3).unwrap();
        assert!(distance(&together) < 0.15 * distance(&alone), "{} {}", distance(&together), distance(&alone));
    }
}
