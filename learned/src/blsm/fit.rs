//! The parameters in which a body comes nearest to a registration (METHOD-BODY 9.5).
//!
//! minimise sum_v |v(p) - r_v|^2 + h (|c_b|^2 + |c_s|^2) over some vertices of each joint by Levenberg-Marquardt with exact derivatives, in stages: the
//! trunk, then the arms too, then the legs too, then all. Steps are in the atoms' angles, where a limit is a wall and not a plain without end. No single
//! start is safe: joints turned one by one, rest, and arms down are each tried, and the nearest is gone on with. Metres.

use std::ops::Range;

use glam::DVec3;
use nalgebra::{DMatrix, DVector};

use super::first_turns::first_turns;
use super::{Atoms, BlsmBody, BlsmParameters, Columns};

/// Vertices of each joint that are fitted.
const OF_JOINT: usize = 16;
/// Such a weight, and a vertex follows a joint.
const FOLLOWS: f64 = 0.3;
/// Steps of a stage but the last, and of the last.
const STEPS: [usize; 2] = [12, 100];
/// Tries of one step.
const TRIES: usize = 8;
/// Stages end when a step lowers the sum by a smaller share, the last one later.
const CONVERGED: [f64; 2] = [1e-2, 1e-9];
/// What holds an unknown that nothing depends on, metres^2.
const EPSILON: f64 = 1e-10;
/// Of shoulders in the start with the arms down, radians.
const ARMS_DOWN: f64 = 1.0;

/// What is solved for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Free {
    /// The pose, the bones and the shape.
    All,
    /// The pose.
    Pose,
}

/// A body made ready to be fitted.
#[derive(Clone, Debug)]
pub struct BlsmFit<'a> {
    body: &'a BlsmBody,
    /// Numbers of the vertices that are fitted, ascending, and the body of these alone.
    sample: Vec<usize>,
    sampled: BlsmBody,
    /// The stage from which on each vertex of the sample counts, and each joint turns.
    stage_of_vertices: Vec<usize>,
    stage_of_joints: Vec<usize>,
    /// h.
    held: f64,
}

/// One stage of one fit.
struct Stage<'a> {
    targets: &'a [DVec3],
    number: usize,
    free: Free,
    steps: usize,
    converged: f64,
}

impl<'a> BlsmFit<'a> {
    /// Of a body; a coefficient that is 1 costs `held` square metres.
    pub fn new(body: &'a BlsmBody, held: f64) -> Self {
        let sample = sample(body, OF_JOINT);
        let stage_of_joints: Vec<usize> = (0..body.names.len()).map(|joint| stage_of(body, joint)).collect();
        let dominant = |vertex: &usize| {
            let largest = body.weights[*vertex].iter().max_by(|one, other| one.1.total_cmp(&other.1));
            largest.map_or(0, |(joint, _)| stage_of_joints[*joint])
        };
        let stage_of_vertices = sample.iter().map(dominant).collect();
        Self { sampled: body.chosen(&sample), body, sample, stage_of_vertices, stage_of_joints, held }
    }

    /// The parameters nearest to a registration (V), from `start` or, without one, from several.
    pub fn nearest(&self, registration: &[DVec3], free: Free, start: Option<&BlsmParameters>) -> BlsmParameters {
        let targets: Vec<DVec3> = self.sample.iter().map(|vertex| registration[*vertex]).collect();
        let last = Stage { targets: &targets, number: LAST_STAGE, free, steps: STEPS[1], converged: CONVERGED[1] };
        if let Some(start) = start {
            return self.descend(&last, start.clone()).0;
        }
        let first = first_turns(self.body, registration);
        let at_rest = BlsmParameters { atoms: self.body.rest().atoms, ..first.clone() };
        let arms_down = BlsmParameters { atoms: self.with_arms_down(&at_rest.atoms), ..at_rest.clone() };
        let mut best: Option<(BlsmParameters, f64)> = None;
        for (start, stages) in
            [(first, LAST_STAGE..LAST_STAGE + 1), (at_rest, 0..LAST_STAGE + 1), (arms_down, 0..LAST_STAGE + 1)]
        {
            let found = self.staged(&targets, free, start, stages);
            if best.as_ref().is_none_or(|(_, cost)| found.1 < *cost) {
                best = Some(found);
            }
        }
        best.map_or_else(|| self.body.rest(), |(best, _)| self.descend(&last, best).0)
    }

    /// The body.
    pub fn body(&self) -> &BlsmBody {
        self.body
    }

    /// h.
    pub(super) fn held(&self) -> f64 {
        self.held
    }

    /// What a registration (V) says of the columns `solved` at these parameters: H and g, without what holds coefficients.
    pub(super) fn of_frame(
        &self,
        registration: &[DVec3],
        parameters: &BlsmParameters,
        solved: &[usize],
    ) -> (DMatrix<f64>, DVector<f64>) {
        let targets: Vec<DVec3> = self.sample.iter().map(|vertex| registration[*vertex]).collect();
        let stage = Stage { targets: &targets, number: LAST_STAGE, free: Free::All, steps: 0, converged: 0.0 };
        self.equations(&stage, parameters, solved)
    }

    /// The mean distance of a vertex (V) of a registration, metres.
    pub fn distance(&self, parameters: &BlsmParameters, registration: &[DVec3]) -> f64 {
        let posed = self.body.posed(parameters).vertices;
        posed.iter().zip(registration).map(|(own, target)| own.distance(*target)).sum::<f64>() / posed.len() as f64
    }

    fn staged(
        &self,
        targets: &[DVec3],
        free: Free,
        start: BlsmParameters,
        stages: Range<usize>,
    ) -> (BlsmParameters, f64) {
        let mut found = (start, f64::MAX);
        for number in stages {
            let stage = Stage { targets, number, free, steps: STEPS[0], converged: CONVERGED[0] };
            found = self.descend(&stage, found.0);
        }
        found
    }

    fn with_arms_down(&self, atoms: &[f64]) -> Vec<f64> {
        let mut atoms = atoms.to_vec();
        for (place, atom) in self.body.atoms.list.iter().enumerate().filter(|(_, atom)| atom.axis == 2) {
            match self.body.names[atom.joint].as_str() {
                "left_shoulder" => atoms[place] = atom.coordinate(-ARMS_DOWN),
                "right_shoulder" => atoms[place] = atom.coordinate(ARMS_DOWN),
                _ => {}
            }
        }
        atoms
    }

    /// Levenberg-Marquardt in the columns of a stage, and what is left.
    fn descend(&self, stage: &Stage, start: BlsmParameters) -> (BlsmParameters, f64) {
        let columns = Columns::of(self.body);
        let solved = self.columns(stage);
        let mut found = start;
        let mut cost = self.cost(stage, &found);
        let mut damping = 1e-3;
        for _ in 0..stage.steps {
            let (mut matrix, mut gradient) = self.equations(stage, &found, &solved);
            self.hold(&found, &solved, (&mut matrix, &mut gradient));
            wall(&self.body.atoms, &found, &solved, (&mut matrix, &mut gradient));
            let before = cost;
            for _ in 0..TRIES {
                let mut damped = matrix.clone();
                (0..solved.len()).for_each(|at| damped[(at, at)] += damping * damped[(at, at)] + EPSILON);
                let tried = damped.cholesky().map(|factor| {
                    let mut step = vec![0.0; columns.count()];
                    let solution = factor.solve(&-&gradient);
                    solved.iter().zip(solution.iter()).for_each(|(column, value)| step[*column] = *value);
                    found.turned(&self.body.atoms, columns, &step)
                });
                if let Some(tried) = tried {
                    let its_cost = self.cost(stage, &tried);
                    if its_cost < cost {
                        (found, cost, damping) = (tried, its_cost, (damping * 0.1).max(1e-12));
                        break;
                    }
                }
                damping *= 10.0;
            }
            if before - cost <= stage.converged * before {
                break;
            }
        }
        (found, cost)
    }

    fn columns(&self, stage: &Stage) -> Vec<usize> {
        let columns = Columns::of(self.body);
        let turns = |(_, joint): &(usize, usize)| self.stage_of_joints[*joint] <= stage.number;
        let atoms = columns.atoms().zip(self.body.atoms.list.iter().map(|atom| atom.joint)).filter(turns);
        let others = if stage.free == Free::All { columns.bones().start..columns.count() } else { 0..0 };
        (0..6).chain(atoms.map(|(column, _)| column)).chain(others).collect()
    }

    fn counted(&self, stage: &Stage) -> impl Iterator<Item = usize> {
        let number = stage.number;
        (0..self.sample.len()).filter(move |at| self.stage_of_vertices[*at] <= number)
    }

    fn cost(&self, stage: &Stage, parameters: &BlsmParameters) -> f64 {
        let posed = self.sampled.posed(parameters).vertices;
        let distances = self.counted(stage).map(|at| posed[at].distance_squared(stage.targets[at]));
        let coefficients = parameters.bones.iter().chain(&parameters.shape);
        let cost = distances.sum::<f64>() + self.held * coefficients.map(|value| value * value).sum::<f64>();
        if cost.is_finite() { cost } else { f64::INFINITY }
    }

    /// H and g of the vertices in the columns that are solved for.
    fn equations(&self, stage: &Stage, parameters: &BlsmParameters, solved: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
        let columns = Columns::of(self.body);
        let posed = self.sampled.posed(parameters);
        let mut matrix = DMatrix::zeros(solved.len(), solved.len());
        let mut gradient = DVector::zeros(solved.len());
        let mut place_of = vec![None; columns.count()];
        solved.iter().enumerate().for_each(|(place, column)| place_of[*column] = Some(place));
        let mut entries = Vec::new();
        for at in self.counted(stage) {
            self.sampled.entries(&posed, at, &mut entries);
            let residual = posed.vertices[at] - stage.targets[at];
            entries.retain_mut(|(column, _)| match place_of[*column] {
                Some(place) => {
                    *column = place;
                    true
                }
                None => false,
            });
            for (index, (place, entry)) in entries.iter().enumerate() {
                gradient[*place] += entry.dot(residual);
                entries[index..].iter().for_each(|(other, with)| matrix[(*other, *place)] += entry.dot(*with));
            }
        }
        matrix.fill_upper_triangle_with_lower_triangle();
        (matrix, gradient)
    }

    /// Adds what holds coefficients.
    fn hold(
        &self,
        parameters: &BlsmParameters,
        solved: &[usize],
        (matrix, gradient): (&mut DMatrix<f64>, &mut DVector<f64>),
    ) {
        let coefficients = parameters.bones.iter().chain(&parameters.shape);
        for (column, value) in (Columns::of(self.body).bones().start..).zip(coefficients) {
            if let Ok(place) = solved.binary_search(&column) {
                matrix[(place, place)] += self.held;
                gradient[place] += self.held * value;
            }
        }
    }
}

/// Takes atoms out that are at a limit and pushed against it.
pub(super) fn wall(
    atoms: &Atoms,
    parameters: &BlsmParameters,
    solved: &[usize],
    (matrix, gradient): (&mut DMatrix<f64>, &mut DVector<f64>),
) {
    for (place, column) in solved.iter().enumerate() {
        let Some((atom, x)) = column.checked_sub(6).and_then(|at| Some((atoms.list.get(at)?, parameters.atoms[at])))
        else {
            continue;
        };
        if atom.is_at_limit(x) && gradient[place] * x < 0.0 {
            matrix.row_mut(place).fill(0.0);
            matrix.column_mut(place).fill(0.0);
            matrix[(place, place)] = 1.0;
            gradient[place] = 0.0;
        }
    }
}

/// The last stage, of all joints.
const LAST_STAGE: usize = 3;

/// The first stage in which a joint turns: 0 the trunk, 1 an arm, 2 a leg, 3 hands and the face.
fn stage_of(body: &BlsmBody, joint: usize) -> usize {
    let is_of = |words: &[&str]| words.iter().any(|word| body.names[joint].contains(word));
    if is_of(&["shoulder", "elbow", "wrist"]) {
        1
    } else if is_of(&["hip", "knee", "ankle", "foot"]) {
        2
    } else if is_of(&["hand", "thumb", "index", "middle", "ring", "pinky", "jaw", "eye"]) {
        3
    } else {
        0
    }
}

/// Of the vertices that follow each joint evenly many, in the order of their numbers.
pub(super) fn sample(body: &BlsmBody, of_joint: usize) -> Vec<usize> {
    let mut chosen = std::collections::BTreeSet::new();
    for joint in 0..body.names.len() {
        let follows =
            |vertex: &usize| body.weights[*vertex].iter().any(|(of, weight)| *of == joint && *weight > FOLLOWS);
        let following: Vec<usize> = (0..body.weights.len()).filter(follows).collect();
        chosen.extend(following.iter().step_by(following.len().div_ceil(of_joint).max(1)));
    }
    chosen.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blsm::derivatives::tests::{parameters, reference_body};
    use crate::reference::{largest_difference, reference, vectors};

    #[test]
    fn near_starts_lead_to_the_references_parameters() {
        let (body, _) = reference_body();
        let golden = reference("blsm_fit");
        let fit = BlsmFit { sample: (0..96).collect(), sampled: body.clone(), ..whole(&body) };
        for subject in 0..8 {
            let target = vectors(&golden["target"][288 * subject..288 * (subject + 1)]);
            let mut start = parameters(&golden, subject, "start_");
            (start.bones, start.shape) = (vec![0.0; 3], vec![0.0; 6]);
            let truth = parameters(&golden, subject, "");
            let found = fit.nearest(&target, Free::All, Some(&start));
            assert!(fit.distance(&found, &target) < 1e-6, "{subject}: {}", fit.distance(&found, &target));
            assert!(largest_difference(&found.bones, &truth.bones) < 1e-4, "{subject}: {:?}", found.bones);
            assert!(largest_difference(&found.shape, &truth.shape) < 1e-4, "{subject}");
            let angles = body.atoms.angles(&found.atoms);
            assert!(largest_difference(&angles, &body.atoms.angles(&truth.atoms)) < 1e-5, "{subject}");
        }
    }

    /// Every vertex counts from the first stage on.
    fn whole(body: &BlsmBody) -> BlsmFit<'_> {
        BlsmFit { stage_of_vertices: vec![0; 96], ..BlsmFit::new(body, 0.0) }
    }
}
