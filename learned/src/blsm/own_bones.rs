//! A person's own bones and flesh, told apart by how joints move (METHOD-BODY 9.4 a, d).
//!
//! v = L T + m is linear in a vertex's flesh T; p are the poses of all frames and the bones, D = dv / dp. Flesh would take the blame for bones, so a step of
//! Gauss and Newton eliminates each vertex's: (sum D^T D - C^T N^-1 C) d = -(sum D^T r - C^T N^-1 sum L^T r), N = sum_f L^T L, C = sum_f L^T D. Then flesh
//! itself. Some frames are enough for bones.

use std::ops::Range;

use glam::{DMat3, DVec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::fit::{sample, wall};
use super::people_bones::SaidOfBones;
use super::{BlsmBody, BlsmFit, BlsmParameters, Columns, Free, PosedBlsm};
use crate::core::Factor;

/// Steps from nothing, and from where a person was.
const STEPS: [usize; 2] = [6, 3];
/// In which coefficients of a few modes are found.
const MODE_STEPS: usize = 2;
/// How often flesh and poses of some frames alone are found, each with the other.
const REFITS: usize = 2;
/// Vertices of each joint that bones are found by at first; then all are: of the trunk, where little turns, every one counts.
const OF_JOINT: usize = 64;
/// Frames that bones are found in, at most.
const FRAMES: usize = 8;
/// What a free bone's coefficient of 1 costs while flesh is unknown, metres^2: much.
const HELD: f64 = 1e-4;
/// What a coordinate of a registration is off by at least, metres.
const LEAST_NOISE: f64 = 1e-4;
/// What holds flesh that no frame says anything of, and an unknown, of its own square.
const UNSEEN: f64 = 1e-9;
const DAMPING: f64 = 1e-7;
/// Vertices whose sums one task has.
const VERTICES: usize = 512;

/// One person.
#[derive(Clone, Debug)]
pub(super) struct Person {
    /// The parameters of each frame, all with the same bones and shape.
    pub frames: Vec<BlsmParameters>,
    /// The flesh at rest (V).
    pub flesh: Vec<DVec3>,
    /// What the registrations say of the coefficients of bones, when these were last found.
    pub said: SaidOfBones,
}

impl Person {
    /// Of registrations (F, V) on a body whose bones are free; from `start`, or from nothing.
    pub fn of(free: &BlsmBody, registrations: &[Vec<DVec3>], start: Option<Self>) -> Self {
        let (steps, of_joint) = if start.is_some() { (STEPS[1], usize::MAX) } else { (STEPS[0], OF_JOINT) };
        let mut person = start.unwrap_or_else(|| Self {
            frames: BlsmFit::new(free, HELD).person(registrations, None),
            flesh: free.template.clone(),
            said: SaidOfBones::nothing(free.bone_basis.len()),
        });
        person.frames.iter_mut().for_each(|frame| frame.shape.clear());
        person.find_bones(free, registrations, steps, of_joint);
        person
    }

    /// Finds coefficients of a body's modes, from those that frames have, with poses and flesh.
    pub fn find_modes(&mut self, body: &BlsmBody, registrations: &[Vec<DVec3>]) {
        self.find_bones(body, registrations, MODE_STEPS, OF_JOINT);
    }

    /// Finds bones, as coefficients of a body's modes, with poses and flesh, by so many vertices of each joint.
    fn find_bones(&mut self, body: &BlsmBody, registrations: &[Vec<DVec3>], steps: usize, of_joint: usize) {
        let mut own = body.without_flesh();
        let count = registrations.len().min(FRAMES);
        let chosen: Vec<usize> = (0..count).map(|index| index * registrations.len() / count).collect();
        self.flesh = own.with_flesh(&self.flesh).flesh(registrations, &self.frames);
        let sampled = sample(&own, of_joint);
        for _ in 0..steps {
            own.template.clone_from(&self.flesh);
            if let Some(said) = own.step_beside_flesh(registrations, &mut self.frames, &chosen, &sampled) {
                self.said = said;
            }
            self.flesh = own.flesh(registrations, &self.frames);
        }
        self.refit(&own, registrations);
    }

    /// The same person in some of the frames, with the flesh of these alone and poses that go with it.
    pub fn within(&self, body: &BlsmBody, registrations: &[Vec<DVec3>], frames: Range<usize>) -> Self {
        let own = body.without_flesh();
        let mut person = Self { frames: self.frames[frames].to_vec(), ..self.clone() };
        (0..REFITS).for_each(|_| person.refit(&own, registrations));
        person.flesh = own.with_flesh(&person.flesh).flesh(registrations, &person.frames);
        person
    }

    /// Finds flesh and poses again at the bones that frames have, of a body without shapes and correctives.
    pub fn refit(&mut self, own: &BlsmBody, registrations: &[Vec<DVec3>]) {
        self.flesh = own.with_flesh(&self.flesh).flesh(registrations, &self.frames);
        let own = own.with_flesh(&self.flesh);
        let fit = BlsmFit::new(&own, 0.0);
        let frames = self.frames.par_iter().zip(registrations);
        self.frames = frames.map(|(start, frame)| fit.nearest(frame, Free::Pose, Some(start))).collect();
    }
}

impl BlsmBody {
    /// Without shapes, and with modes that move bones alone.
    fn without_flesh(&self) -> Self {
        Self { shape_basis: Vec::new(), bone_correctives: vec![Vec::new(); self.bone_basis.len()], ..self.clone() }
    }

    fn with_flesh(&self, flesh: &[DVec3]) -> Self {
        Self { template: flesh.to_vec(), ..self.clone() }
    }

    /// Moves the poses of some frames, and the bones of all, whatever the flesh of some vertices is; what the frames say of the coefficients of bones, which have unit
    /// variance. Nothing is moved if the equations cannot be solved.
    fn step_beside_flesh(
        &self,
        registrations: &[Vec<DVec3>],
        frames: &mut [BlsmParameters],
        chosen: &[usize],
        sampled: &[usize],
    ) -> Option<SaidOfBones> {
        let columns = Columns::of(self);
        let posing = columns.bones().start;
        let poses = chosen.len() * posing;
        let count = poses + columns.bones;
        let place = |frame: usize, column: usize| match column.checked_sub(posing) {
            None => frame * posing + column,
            Some(bone) => poses + bone,
        };
        let posed: Vec<PosedBlsm> = chosen.iter().map(|frame| self.posed(&frames[*frame])).collect();
        let of_vertices = |vertices: &[usize]| {
            let mut sums = Sums::of(count);
            let mut entries = Vec::new();
            let mut crossed = vec![DVec3::ZERO; count];
            for vertex in vertices {
                crossed.fill(DVec3::ZERO);
                let (mut normal, mut pull) = (DMat3::from_diagonal(DVec3::splat(UNSEEN)), DVec3::ZERO);
                for (at, (posed, frame)) in posed.iter().zip(chosen).enumerate() {
                    self.entries(posed, *vertex, &mut entries);
                    entries.iter_mut().for_each(|(column, _)| *column = place(at, *column));
                    let linear = self.linear(posed, *vertex);
                    let residual = posed.vertices[*vertex] - registrations[*frame][*vertex];
                    normal += linear.transpose() * linear;
                    pull += linear.transpose() * residual;
                    sums.add(&entries, &entries, residual, 1.0);
                    sums.squares += residual.length_squared();
                    entries.iter().for_each(|(column, entry)| crossed[*column] += linear.transpose() * *entry);
                }
                let inverse = normal.inverse();
                let crossed: Vec<(usize, DVec3)> = some(&crossed).collect();
                let eliminated: Vec<(usize, DVec3)> = crossed.iter().map(|(at, of)| (*at, inverse * *of)).collect();
                sums.add(&eliminated, &crossed, pull, -1.0);
                sums.squares -= pull.dot(inverse * pull);
            }
            sums
        };
        let parts: Vec<Sums> = sampled.par_chunks(VERTICES).map(of_vertices).collect();
        let mut sums = Sums::of(count);
        parts.into_iter().for_each(|part| sums.join(part));
        let Sums { mut matrix, mut gradient, squares } = sums;
        matrix.fill_upper_triangle_with_lower_triangle();
        for (at, frame) in chosen.iter().enumerate() {
            // Columns of a frame's atoms, and others' that are none.
            let own: Vec<usize> = (0..count).map(|column| column.checked_sub(at * posing).unwrap_or(count)).collect();
            let own: Vec<usize> = own.iter().map(|column| if *column < posing { *column } else { count }).collect();
            wall(&self.atoms, &frames[*frame], &own, (&mut matrix, &mut gradient));
        }
        (0..poses).for_each(|at| matrix[(at, at)] += DAMPING * matrix[(at, at)] + UNSEEN);
        let known = 3 * chosen.len().saturating_sub(1) * sampled.len();
        let noise = (squares / known.saturating_sub(count).max(1) as f64).max(LEAST_NOISE * LEAST_NOISE);
        // Poses are eliminated: what is left of bones is what all frames say of them.
        let factor = Factor::of(&matrix.view((0, 0), (poses, poses)).into_owned())?;
        let across = matrix.view((0, poses), (poses, columns.bones)).into_owned();
        let follows = factor.solve_all(&across);
        let of_poses = factor.solve(&gradient.rows(0, poses).into_owned());
        let of_bones = matrix.view((poses, poses), (columns.bones, columns.bones)) - across.transpose() * &follows;
        let pulls = gradient.rows(poses, columns.bones) - across.transpose() * &of_poses;
        let bones = DVector::from_vec(frames.first().map_or_else(Vec::new, |frame| frame.bones.clone()));
        let said = SaidOfBones { vector: (&of_bones * &bones - pulls) / noise, matrix: of_bones / noise };
        let wanted = said.most_probable()?;
        let step = -of_poses - follows * (&wanted - bones);
        for (at, frame) in chosen.iter().enumerate() {
            let own = [&step.as_slice()[at * posing..(at + 1) * posing], &vec![0.0; columns.bones]].concat();
            frames[*frame] = frames[*frame].turned(&self.atoms, columns, &own);
        }
        frames.iter_mut().for_each(|frame| frame.bones = wanted.as_slice().to_vec());
        Some(said)
    }

    /// A person's flesh at rest (V), beyond this body's correctives and shape; what no frame says is the body's.
    pub(super) fn flesh(&self, registrations: &[Vec<DVec3>], frames: &[BlsmParameters]) -> Vec<DVec3> {
        let posed: Vec<PosedBlsm> = frames.par_iter().map(|frame| self.posed(frame)).collect();
        let of_vertex = |vertex: usize| {
            let (mut normal, mut pull) = (DMat3::from_diagonal(DVec3::splat(UNSEEN)), DVec3::ZERO);
            for (posed, frame) in posed.iter().zip(registrations) {
                let linear = self.linear(posed, vertex);
                normal += linear.transpose() * linear;
                pull += linear.transpose() * (frame[vertex] - posed.vertices[vertex]);
            }
            self.template[vertex] + normal.inverse() * pull
        };
        (0..self.template.len()).into_par_iter().map(of_vertex).collect()
    }

    /// dv / dT of a vertex.
    fn linear(&self, posed: &PosedBlsm, vertex: usize) -> DMat3 {
        let turned =
            |(joint, weight): &(usize, f64)| posed.skeleton.turns[*joint] * (posed.skeleton.sizes[*joint] * weight);
        self.weights[vertex].iter().map(turned).sum()
    }
}

/// What vertices say of all unknowns: H, below its diagonal, g, and the squares that their flesh leaves.
struct Sums {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    squares: f64,
}

impl Sums {
    fn of(count: usize) -> Self {
        Self { matrix: DMatrix::zeros(count, count), gradient: DVector::zeros(count), squares: 0.0 }
    }

    fn join(&mut self, other: Self) {
        self.matrix += other.matrix;
        self.gradient += other.gradient;
        self.squares += other.squares;
    }

    /// Adds products of entries, which are in the order of their columns.
    fn add(&mut self, entries: &[(usize, DVec3)], others: &[(usize, DVec3)], residual: DVec3, sign: f64) {
        for (index, (column, entry)) in entries.iter().enumerate() {
            self.gradient[*column] += sign * entry.dot(residual);
            for (row, other) in &others[index..] {
                self.matrix[(*row, *column)] += sign * entry.dot(*other);
            }
        }
    }
}

/// Entries that are not zero, with their places.
fn some(entries: &[DVec3]) -> impl Iterator<Item = (usize, DVec3)> {
    entries.iter().copied().enumerate().filter(|(_, entry)| *entry != DVec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blsm::Atoms;
    use crate::blsm::derivatives::tests::{parameters, reference_body};
    use xavatar_body::smpl;

    // A step at the truth stays there, whatever the body's own flesh was.
    #[test]
    fn bones_are_a_persons_own_whatever_the_flesh() {
        let (mut truth, golden) = reference_body();
        truth.names = smpl::skeleton().joints.clone();
        truth.atoms = Atoms { joints: 24, ..truth.atoms };
        let mut frames: Vec<BlsmParameters> = (0..4).map(|row| parameters(&golden, row, "")).collect();
        let bones = vec![0.5, -1.0, 0.7];
        frames.iter_mut().for_each(|frame| (frame.bones, frame.shape) = (bones.clone(), Vec::new()));
        truth.shape_basis.clear();
        let registrations: Vec<Vec<DVec3>> = frames.iter().map(|frame| truth.posed(frame).vertices).collect();
        let flesh = truth.flesh(&registrations, &frames);
        assert!(flesh.iter().zip(&truth.template).all(|(found, expected)| found.distance(*expected) < 1e-6));
        // Bones and flesh that are wrong, at the right poses.
        let mut body = truth.clone();
        body.template.iter_mut().for_each(|place| *place *= 1.03);
        let mut found = frames.clone();
        found.iter_mut().for_each(|frame| frame.bones = vec![0.3, -0.8, 0.6]);
        let sampled = sample(&body, OF_JOINT);
        for _ in 0..60 {
            body.step_beside_flesh(&registrations, &mut found, &[0, 1, 2, 3], &sampled).unwrap();
            body.template = body.flesh(&registrations, &found);
        }
        let distance = |of: &[f64]| of.iter().zip(&bones).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
        assert!(distance(&found[0].bones) < 0.05, "{:?}", found[0].bones);
    }
}
