//! Some vertices of a body, posed, with the derivative of each along a direction by every unknown.
//!
//! v = sum_j w_j (G_j T + A_j) + t, T = template + S c + P f(R). For a turn of joint k, with W = sum w_j and Q = sum w_j (G_j T + A_j) over the joints j
//! from k down: d(n . v) = G_k^T ((Q - W p_k) x n) + (M^T n)^T P df, M = sum_j w_j G_j. For a coefficient: (M^T n) . S + sum_j w_j n . dA_j.
//! A joint that moves a vertex by less than [`NEGLIGIBLE`] has no column for it: hands' columns touch hands only.

use glam::{DMat3, DVec3};
use xavatar_body::{BodyModel, Correctives};

use super::chain::{Basis, Drive, Linkage, PosedChain};
use super::normal_equations::Row;

/// Correctives smaller than this are not differentiated, metres per unit of their feature.
const NEGLIGIBLE: f32 = 1e-5;

/// N vertices of a body.
#[derive(Clone, Debug)]
pub struct BodyPoints {
    points: Vec<Point>,
}

#[derive(Clone, Debug)]
struct Point {
    template: DVec3,
    /// Joints that it follows, with their weights.
    weights: Vec<(usize, f64)>,
    /// Joints whose turns move it, in ascending order.
    joints: Vec<usize>,
    /// By coefficient (K).
    directions: Vec<DVec3>,
    /// By joint, the correctives of its features.
    correctives: Vec<(usize, Vec<DVec3>)>,
    /// The corrective that a coefficient drives.
    of_coefficient: DVec3,
}

/// Where N vertices are, and what their derivatives need.
#[derive(Clone, Debug)]
pub struct PosedPoints {
    /// With the translation (N).
    pub positions: Vec<DVec3>,
    /// M: how each is turned from rest (N).
    pub turns: Vec<DMat3>,
    /// Q - W p_k of each joint of a vertex's (N, joints).
    levers: Vec<Vec<DVec3>>,
}

impl BodyPoints {
    /// These vertices of a body.
    pub fn of(model: &BodyModel, linkage: &Linkage, vertices: &[usize]) -> Self {
        let anatomy = model.anatomy();
        let joints = anatomy.skeleton.joints.len();
        let shapes: Vec<&[f32]> = anatomy.shapes.directions().collect();
        let correctives: Vec<&[f32]> = match &anatomy.correctives {
            Correctives::None => Vec::new(),
            Correctives::RotationEntries(shapes) | Correctives::Quaternions { shapes, .. } => {
                shapes.directions().collect()
            }
        };
        let at = |direction: &[f32], vertex: usize| match direction.is_empty() {
            true => DVec3::ZERO,
            false => DVec3::from_array([0, 1, 2].map(|axis| f64::from(direction[3 * vertex + axis]))),
        };
        let (per_joint, first) = linkage.drive.features();
        let point = |&vertex: &usize| {
            let of_vertex = &anatomy.skinning_weights[vertex * joints..(vertex + 1) * joints];
            let weights: Vec<(usize, f64)> = of_vertex
                .iter()
                .enumerate()
                .filter(|(_, w)| **w != 0.0)
                .map(|(joint, w)| (joint, f64::from(*w)))
                .collect();
            let of_joint = |joint: usize| -> Vec<DVec3> {
                let from = (joint - first) * per_joint;
                correctives[from..from + per_joint].iter().map(|direction| at(direction, vertex)).collect()
            };
            let matters = |offsets: &Vec<DVec3>| offsets.iter().any(|offset| offset.length() > f64::from(NEGLIGIBLE));
            let correctives: Vec<(usize, Vec<DVec3>)> = match per_joint {
                0 => Vec::new(),
                _ => (first..joints)
                    .map(|joint| (joint, of_joint(joint)))
                    .filter(|(_, offsets)| matters(offsets))
                    .collect(),
            };
            let mut moving: Vec<usize> = correctives.iter().map(|(joint, _)| *joint).collect();
            for (joint, _) in &weights {
                moving.extend(std::iter::successors(Some(*joint), |joint| linkage.parents[*joint]));
            }
            moving.sort_unstable();
            moving.dedup();
            Point {
                template: anatomy.template[vertex].as_dvec3(),
                weights,
                joints: moving,
                directions: shapes.iter().map(|direction| at(direction, vertex)).collect(),
                correctives,
                of_coefficient: last_corrective(linkage.drive)
                    .map_or(DVec3::ZERO, |_| corrective_of_coefficient(anatomy, vertex, at)),
            }
        };
        Self { points: vertices.iter().map(point).collect() }
    }

    /// Some of them, by their places among these.
    #[must_use]
    pub fn chosen(&self, places: &[usize]) -> Self {
        Self { points: places.iter().map(|place| self.points[*place].clone()).collect() }
    }

    /// N.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The vertices in a pose.
    pub fn posed(&self, linkage: &Linkage, chain: &PosedChain) -> PosedPoints {
        let mut posed = PosedPoints { positions: Vec::new(), turns: Vec::new(), levers: Vec::new() };
        let driving = last_corrective(linkage.drive).map_or(0.0, |index| chain.coefficients[index]);
        // Sums over each joint's subtree; zero outside a point's joints.
        let joints = linkage.parents.len();
        let (mut moments, mut masses) = (vec![DVec3::ZERO; joints], vec![0.0; joints]);
        for point in &self.points {
            let rest = point.rest(chain, driving);
            let mut position = chain.translation;
            let mut turn = DMat3::ZERO;
            for (joint, weight) in &point.weights {
                let moment = (chain.turns[*joint] * rest + chain.shifts[*joint]) * *weight;
                moments[*joint] += moment;
                masses[*joint] += weight;
                position += moment;
                turn += chain.turns[*joint] * *weight;
            }
            for joint in point.joints.iter().rev() {
                if let Some(parent) = linkage.parents[*joint] {
                    let (moment, mass) = (moments[*joint], masses[*joint]);
                    moments[parent] += moment;
                    masses[parent] += mass;
                }
            }
            let lever = |joint: &usize| moments[*joint] - chain.positions[*joint] * masses[*joint];
            posed.levers.push(point.joints.iter().map(lever).collect());
            posed.positions.push(position);
            posed.turns.push(turn);
            for joint in &point.joints {
                (moments[*joint], masses[*joint]) = (DVec3::ZERO, 0.0);
                if let Some(parent) = linkage.parents[*joint] {
                    (moments[parent], masses[parent]) = (DVec3::ZERO, 0.0);
                }
            }
        }
        posed
    }

    /// Makes `row` the derivative of n . v of vertex `index` by the unknowns; `posed` is of the same frame.
    pub fn row(&self, basis: Basis<'_>, posed: &PosedPoints, index: usize, n: DVec3, row: &mut Row) {
        let Basis { linkage, chain, unknowns } = basis;
        row.clear();
        let extents = linkage.extents();
        let point = &self.points[index];
        let at_rest = posed.turns[index].transpose() * n;
        let mut correctives = point.correctives.iter().peekable();
        for (joint, lever) in point.joints.iter().zip(&posed.levers[index]) {
            let own = correctives.next_if(|(of, _)| of == joint);
            let first = extents.turn(*joint);
            if unknowns.place(first).is_none() {
                continue;
            }
            let mut turned = (chain.turns[*joint].transpose() * lever.cross(n)).to_array();
            for (offset, slope) in own.iter().flat_map(|(_, offsets)| offsets).zip(&chain.feature_slopes[*joint]) {
                let along = at_rest.dot(*offset);
                turned.iter_mut().zip(slope).for_each(|(sum, slope)| *sum += along * slope);
            }
            turned.iter().enumerate().for_each(|(axis, value)| row.push(unknowns, first + axis, *value));
        }
        extents.translation().zip(n.to_array()).for_each(|(column, value)| row.push(unknowns, column, value));
        let driven = last_corrective(linkage.drive);
        for (coefficient, direction) in point.directions.iter().enumerate() {
            let column = extents.coefficient(coefficient);
            if unknowns.place(column).is_none() {
                continue;
            }
            let offset = if driven == Some(coefficient) { *direction + point.of_coefficient } else { *direction };
            let of_bones: f64 = point
                .weights
                .iter()
                .map(|(joint, weight)| weight * n.dot(chain.shift_slopes[*joint][coefficient]))
                .sum();
            row.push(unknowns, column, at_rest.dot(offset) + of_bones);
        }
    }
}

impl Point {
    /// T.
    fn rest(&self, chain: &PosedChain, driving: f64) -> DVec3 {
        let shaped =
            self.directions.iter().zip(&chain.coefficients).map(|(direction, coefficient)| *direction * *coefficient);
        let corrected = self.correctives.iter().flat_map(|(joint, offsets)| {
            offsets.iter().zip(&chain.features[*joint]).map(|(offset, feature)| *offset * *feature)
        });
        self.template + shaped.chain(corrected).sum::<DVec3>() + self.of_coefficient * driving
    }
}

/// The coefficient that drives a corrective.
fn last_corrective(drive: Drive) -> Option<usize> {
    match drive {
        Drive::Quaternions { coefficient, .. } => coefficient,
        Drive::Nothing | Drive::RotationEntries => None,
    }
}

/// The last corrective, which a coefficient drives.
fn corrective_of_coefficient(
    anatomy: &xavatar_body::Anatomy,
    vertex: usize,
    at: impl Fn(&[f32], usize) -> DVec3,
) -> DVec3 {
    match &anatomy.correctives {
        Correctives::Quaternions { shapes, .. } => {
            shapes.directions().last().map_or(DVec3::ZERO, |last| at(last, vertex))
        }
        Correctives::None | Correctives::RotationEntries(_) => DVec3::ZERO,
    }
}
