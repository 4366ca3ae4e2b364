//! A subject's template T and joints J: linear least squares at fixed poses (Osman 6.4-6.5; METHOD-BODY 3).
//!
//! minimise sum_f sum_v |M_fv T_v + sum_k W_vk D_fk J_k - r_fv|^2 + |T - U(T)|^2 + sum_k lambda_k |J_k - U(J)_k|^2, M_fv = sum_j w_vj G_fj,
//! D_fk = G_f,parent(k) - G_fk, W_vk = the weights of v from joint k down, r the registration less what correctives and translation do, U the
//! mirror. Of all frames only J x J tables of 3 x 3 products are kept, and one vector a vertex and a joint. Vertices are eliminated, pairs of the
//! mirror together; what nothing determines stays where it was (the shortest step). V vertices, J joints; metres.

use glam::{DMat3, DVec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::Mirror;

/// What holds each number to where it was, of a sum over frames that has about 1 for each.
const HELD: f64 = 1e-8;
/// How often it is let go by its own last step, so that nothing of it is left in what is determined.
const ROUNDS: usize = 3;
/// Vertices whose sums one task has.
const VERTICES: usize = 256;

/// A subject at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Identity {
    /// (V).
    pub template: Vec<DVec3>,
    /// (J).
    pub joints: Vec<DVec3>,
}

/// Skinning weights that are not zero (V), by joint and summed from joints down.
#[derive(Clone, Debug)]
pub struct SkinningRows {
    weights: Vec<Vec<(usize, f64)>>,
    below: Vec<Vec<(usize, f64)>>,
    parents: Vec<Option<usize>>,
}

impl SkinningRows {
    /// Of weights (V) and a tree (J).
    pub fn new(weights: &[Vec<(usize, f64)>], parents: &[Option<usize>]) -> Self {
        let sum = |row: &Vec<(usize, f64)>| {
            let mut below = vec![0.0; parents.len()];
            for (joint, weight) in row {
                std::iter::successors(Some(*joint), |joint| parents[*joint]).for_each(|above| below[above] += weight);
            }
            below.into_iter().enumerate().filter(|(_, weight)| *weight != 0.0).collect()
        };
        Self { below: weights.iter().map(sum).collect(), weights: weights.to_vec(), parents: parents.to_vec() }
    }

    /// M of a vertex, for turns G (J).
    pub fn turn(&self, vertex: usize, turns: &[DMat3]) -> DMat3 {
        self.weights[vertex].iter().map(|(joint, weight)| turns[*joint] * *weight).sum()
    }

    /// A registration (V) less what is none of template's and joints': the registration less the posed body, plus what they do to it now.
    pub fn targets(
        &self,
        identity: &Identity,
        positions: &[DVec3],
        turns: &[DMat3],
        registration: &[DVec3],
    ) -> Vec<DVec3> {
        let bends = self.bends(turns);
        let moved: Vec<DVec3> = bends.iter().zip(&identity.joints).map(|(bend, joint)| *bend * *joint).collect();
        let target = |vertex: usize| {
            let of_joints: DVec3 = self.below[vertex].iter().map(|(joint, below)| moved[*joint] * *below).sum();
            let linear = self.turn(vertex, turns) * identity.template[vertex] + of_joints;
            registration[vertex] - positions[vertex] + linear
        };
        (0..registration.len()).map(target).collect()
    }

    /// D (J), for turns G (J).
    fn bends(&self, turns: &[DMat3]) -> Vec<DMat3> {
        let above = |joint: usize| self.parents[joint].map_or(DMat3::IDENTITY, |parent| turns[parent]);
        (0..turns.len()).map(|joint| above(joint) - turns[joint]).collect()
    }
}

/// What the frames of a subject say of it.
pub struct IdentityMoments<'a> {
    rows: &'a SkinningRows,
    /// sum_f G_j^T G_l (J, J).
    turns: Vec<DMat3>,
    /// sum_f G_j^T D_k (J, J).
    crossed: Vec<DMat3>,
    /// sum_f D_k^T D_l (J, J).
    bends: Vec<DMat3>,
    /// sum_f M^T r (V).
    of_vertices: Vec<DVec3>,
    /// sum_f D_k^T sum_v W_vk r (J).
    of_joints: Vec<DVec3>,
}

impl<'a> IdentityMoments<'a> {
    /// Of no frames.
    pub fn new(rows: &'a SkinningRows) -> Self {
        let (vertices, joints) = (rows.weights.len(), rows.parents.len());
        let table = vec![DMat3::ZERO; joints * joints];
        Self {
            rows,
            turns: table.clone(),
            crossed: table.clone(),
            bends: table,
            of_vertices: vec![DVec3::ZERO; vertices],
            of_joints: vec![DVec3::ZERO; joints],
        }
    }

    /// Adds a frame: its joints' turns G (J), and the registration (V) less what is none of template's and joints'.
    pub fn add(&mut self, turns: &[DMat3], targets: &[DVec3]) {
        let joints = turns.len();
        let bends = self.rows.bends(turns);
        for one in 0..joints {
            for other in 0..joints {
                let place = one * joints + other;
                self.turns[place] += turns[one].transpose() * turns[other];
                self.crossed[place] += turns[one].transpose() * bends[other];
                self.bends[place] += bends[one].transpose() * bends[other];
            }
        }
        let mut pulls = vec![DVec3::ZERO; joints];
        for (vertex, target) in targets.iter().enumerate() {
            self.of_vertices[vertex] += self.rows.turn(vertex, turns).transpose() * *target;
            self.rows.below[vertex].iter().for_each(|(joint, weight)| pulls[*joint] += *target * *weight);
        }
        for (joint, pull) in pulls.into_iter().enumerate() {
            self.of_joints[joint] += bends[joint].transpose() * pull;
        }
    }

    /// The template and joints with the smallest sum, from those that they are near; symmetric as far as `mirror` says, each joint by its weight.
    /// A joint that is a metre from where it is at the start costs `joint_price` more, in metres^2: what few poses leave open is as it was.
    pub fn solve(&self, start: &Identity, mirror: Option<(&Mirror, &[f64])>, joint_price: f64) -> Identity {
        let mut found = start.clone();
        for _ in 0..ROUNDS {
            found = self.nearest(&found, mirror, (&start.joints, joint_price));
        }
        found
    }

    /// The smallest sum with a little for every step from `start`.
    fn nearest(&self, start: &Identity, mirror: Option<(&Mirror, &[f64])>, believed: (&[DVec3], f64)) -> Identity {
        let vertices = self.of_vertices.len();
        let blocks: Vec<Block> = (0..vertices)
            .into_par_iter()
            .filter_map(|vertex| {
                let twin = mirror.map_or(vertex, |(mirror, _)| mirror.vertices[vertex]);
                (vertex <= twin).then(|| self.block(vertex, twin, mirror.is_some(), start))
            })
            .collect();
        let (mut matrix, mut gradient) = self.reduced(&blocks, start, mirror);
        gradient += flat(believed.0) * believed.1;
        (0..gradient.len()).for_each(|place| matrix[(place, place)] += believed.1);
        let joints = solved(matrix, &gradient).unwrap_or_else(|| flat(&start.joints));
        let mut template = start.template.clone();
        for block in &blocks {
            let own = block.vertices_at(&joints);
            for (vertex, place) in block.vertices.iter().zip(own.as_slice().as_chunks::<3>().0) {
                template[*vertex] = DVec3::from_array(*place);
            }
        }
        Identity { template, joints: vectors(joints.as_slice()) }
    }

    /// A vertex, with its twin if it has one.
    fn block(&self, vertex: usize, twin: usize, is_mirrored: bool, start: &Identity) -> Block {
        let vertices = if vertex == twin { vec![vertex] } else { vec![vertex, twin] };
        let size = 3 * vertices.len();
        let (mut matrix, mut right) = (DMatrix::zeros(size, size), DVector::zeros(size));
        let mut columns: Vec<(usize, DMatrix<f64>)> = Vec::new();
        let joints = self.of_joints.len();
        for (place, vertex) in vertices.iter().enumerate() {
            let weights = &self.rows.weights[*vertex];
            let pairs = weights.iter().flat_map(|one| weights.iter().map(move |other| (one, other)));
            let own: DMat3 = pairs.map(|(one, other)| self.turns[one.0 * joints + other.0] * (one.1 * other.1)).sum();
            add(&mut matrix, 3 * place, 3 * place, &(own + DMat3::from_diagonal(DVec3::splat(HELD))));
            let pulled = self.of_vertices[*vertex] + start.template[*vertex] * HELD;
            pulled.to_array().iter().enumerate().for_each(|(axis, value)| right[3 * place + axis] += value);
            for (joint, below) in &self.rows.below[*vertex] {
                let crossed: DMat3 =
                    weights.iter().map(|(of, weight)| self.crossed[of * joints + joint] * (weight * below)).sum();
                let at = columns.iter().position(|(column, _)| column == joint).unwrap_or_else(|| {
                    columns.push((*joint, DMatrix::zeros(size, 3)));
                    columns.len() - 1
                });
                add(&mut columns[at].1, 3 * place, 0, &crossed);
            }
        }
        if is_mirrored {
            symmetry(&mut matrix, 1.0, 0, 3 * (vertices.len() - 1));
        }
        let inverse = matrix.try_inverse().unwrap_or_else(|| DMatrix::zeros(size, size));
        Block { vertices, inverse, right, columns }
    }

    /// The equations of the joints alone (3 J).
    fn reduced(
        &self,
        blocks: &[Block],
        start: &Identity,
        mirror: Option<(&Mirror, &[f64])>,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let joints = self.of_joints.len();
        let part = |blocks: &[Block]| {
            let mut matrix = DMatrix::zeros(3 * joints, 3 * joints);
            let mut gradient = DVector::zeros(3 * joints);
            for block in blocks {
                for (one, column) in &block.columns {
                    let weighed = &block.inverse * column;
                    for (other, across) in &block.columns {
                        let product = across.transpose() * &weighed;
                        let mut place = matrix.view_mut((3 * other, 3 * one), (3, 3));
                        place -= product;
                    }
                    let mut place = gradient.rows_mut(3 * one, 3);
                    place -= weighed.transpose() * &block.right;
                }
                for vertex in &block.vertices {
                    let below = &self.rows.below[*vertex];
                    for (one, first) in below {
                        for (other, second) in below {
                            add(
                                &mut matrix,
                                3 * one,
                                3 * other,
                                &(self.bends[one * joints + other] * (first * second)),
                            );
                        }
                    }
                }
            }
            (matrix, gradient)
        };
        let parts: Vec<_> = blocks.par_chunks(VERTICES).map(part).collect();
        let mut matrix = DMatrix::identity(3 * joints, 3 * joints) * HELD;
        let mut gradient = flat(&self.of_joints) + flat(&start.joints) * HELD;
        for (part, of_part) in parts {
            matrix += part;
            gradient += of_part;
        }
        if let Some((mirror, weights)) = mirror {
            for (joint, weight) in weights.iter().enumerate() {
                let twin = mirror.joints[joint];
                if joint <= twin {
                    symmetry(&mut matrix, *weight, 3 * joint, 3 * twin);
                }
            }
        }
        (matrix, gradient)
    }
}

/// One or two vertices that are eliminated together.
struct Block {
    vertices: Vec<usize>,
    inverse: DMatrix<f64>,
    right: DVector<f64>,
    /// What each joint does in their equations.
    columns: Vec<(usize, DMatrix<f64>)>,
}

impl Block {
    /// Where they are, for these joints.
    fn vertices_at(&self, joints: &DVector<f64>) -> DVector<f64> {
        let mut right = self.right.clone();
        self.columns.iter().for_each(|(joint, column)| right -= column * joints.rows(3 * joint, 3));
        &self.inverse * right
    }
}

/// Adds weight (|a - F b|^2 + |b - F a|^2), F the mirror, of the points at rows `one` and `other`; or weight |a - F a|^2 of one.
fn symmetry(matrix: &mut DMatrix<f64>, weight: f64, one: usize, other: usize) {
    let mirror = [-1.0, 1.0, 1.0];
    for (axis, sign) in mirror.into_iter().enumerate() {
        if one == other {
            matrix[(one + axis, one + axis)] += weight * (1.0_f64 - sign).powi(2);
            continue;
        }
        for place in [one, other] {
            matrix[(place + axis, place + axis)] += 2.0 * weight;
        }
        matrix[(one + axis, other + axis)] -= 2.0 * weight * sign;
        matrix[(other + axis, one + axis)] -= 2.0 * weight * sign;
    }
}

fn add(matrix: &mut DMatrix<f64>, row: usize, column: usize, values: &DMat3) {
    for (across, axis) in values.to_cols_array_2d().iter().enumerate() {
        axis.iter().enumerate().for_each(|(down, value)| matrix[(row + down, column + across)] += value);
    }
}

fn solved(matrix: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    Some(matrix.cholesky()?.solve(right)).filter(|solution| solution.iter().all(|value| value.is_finite()))
}

fn flat(points: &[DVec3]) -> DVector<f64> {
    DVector::from_iterator(3 * points.len(), points.iter().flat_map(|point| point.to_array()))
}

fn vectors(values: &[f64]) -> Vec<DVec3> {
    values.as_chunks::<3>().0.iter().map(|value| DVec3::from_array(*value)).collect()
}

#[cfg(test)]
mod tests {
    use xavatar_register::linear::so3;

    use super::*;
    use crate::reference::{indices, largest_difference, reference, vectors};

    const PARENTS: [Option<usize>; 8] = [None, Some(0), Some(1), Some(2), Some(1), Some(4), Some(0), Some(6)];

    fn rows(values: &[f64]) -> Vec<Vec<(usize, f64)>> {
        values.chunks_exact(8).map(|row| row.iter().copied().enumerate().collect()).collect()
    }

    fn turns(pose: &[DVec3]) -> Vec<DMat3> {
        let mut turns: Vec<DMat3> = Vec::new();
        for (joint, turn) in pose.iter().enumerate() {
            turns.push(PARENTS[joint].map_or(DMat3::IDENTITY, |parent| turns[parent]) * so3::exp(*turn));
        }
        turns
    }

    #[test]
    fn template_and_joints_are_the_references() {
        let golden = reference("avatar_template");
        let weights = SkinningRows::new(&rows(&golden["weights"]), &PARENTS);
        let turns = turns(&vectors(&golden["pose"]));
        let targets: Vec<DVec3> = vectors(&golden["registration"])
            .into_iter()
            .zip(vectors(&golden["corrective"]))
            .enumerate()
            .map(|(vertex, (target, corrective))| target - weights.turn(vertex, &turns) * corrective)
            .collect();
        let mut moments = IdentityMoments::new(&weights);
        moments.add(&turns, &targets);
        let mirror = Mirror { vertices: indices(&golden["pair_vertices"]), joints: indices(&golden["pair_joints"]) };
        let start = Identity { template: vectors(&golden["template0"]), joints: vectors(&golden["joints0"]) };
        let found = moments.solve(&start, Some((&mirror, &[1.0; 8])), 0.0);
        for (found, expected) in [(&found.template, "template"), (&found.joints, "joints")] {
            let difference =
                largest_difference(&found.iter().flat_map(|p| p.to_array()).collect::<Vec<_>>(), &golden[expected]);
            assert!(difference < 1e-6, "{expected}: {difference}");
        }
    }
}
