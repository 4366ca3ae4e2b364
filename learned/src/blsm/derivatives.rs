//! Exact derivatives of a posed body, forward a vertex at a time and in reverse.
//!
//! The root's turn is differentiated by a small turn w from the left, exp(hat(w)) R. A turn w of joint j moves what is below it by w x (y - P_j),
//! so in reverse a joint's pull is the torque of all forces below it: forces and torques are summed once up the tree, and atoms, bones and the root
//! read them there.

use std::ops::Range;

use glam::{DMat3, DVec3};

use super::{Atoms, BlsmBody, BlsmParameters, PosedBlsm};

/// Where parameters are among all numbers: translation, turn, atoms, bones, shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Columns {
    /// A.
    pub atoms: usize,
    /// K.
    pub bones: usize,
    /// S.
    pub shapes: usize,
}

impl Columns {
    /// Of a body.
    pub fn of(body: &BlsmBody) -> Self {
        Self { atoms: body.atoms.count(), bones: body.bone_basis.len(), shapes: body.shape_basis.len() }
    }

    /// How many there are.
    pub fn count(self) -> usize {
        6 + self.atoms + self.bones + self.shapes
    }

    /// Those of the atoms.
    pub fn atoms(self) -> Range<usize> {
        6..6 + self.atoms
    }

    /// Those of the bones.
    pub fn bones(self) -> Range<usize> {
        self.atoms().end..self.atoms().end + self.bones
    }

    /// Those of the shape.
    pub fn shape(self) -> Range<usize> {
        self.bones().end..self.count()
    }
}

impl BlsmParameters {
    /// Moved by a step in all columns.
    #[must_use]
    pub fn moved(&self, columns: Columns, step: &[f64]) -> Self {
        let plus = |numbers: &[f64], range: Range<usize>| {
            numbers.iter().zip(&step[range]).map(|(number, step)| number + step).collect()
        };
        let turn = DVec3::from_slice(&step[3..6]);
        Self {
            turn: DMat3::from_quat(glam::DQuat::from_scaled_axis(turn)) * self.turn,
            translation: self.translation + DVec3::from_slice(&step[..3]),
            atoms: plus(&self.atoms, columns.atoms()),
            bones: plus(&self.bones, columns.bones()),
            shape: plus(&self.shape, columns.shape()),
        }
    }

    /// As [`moved`](Self::moved) by a step that is in the atoms' angles, up to their limits.
    #[must_use]
    pub fn turned(&self, atoms: &Atoms, columns: Columns, step: &[f64]) -> Self {
        let own = atoms.list.iter().zip(&self.atoms).zip(&step[columns.atoms()]);
        let turned =
            own.map(|((atom, x), step)| if *step == 0.0 { *x } else { atom.coordinate(atom.angle(*x) + step) });
        Self { atoms: turned.collect(), ..self.moved(columns, step) }
    }
}

impl BlsmBody {
    /// The derivatives of a vertex by the columns that it depends on, ascending, by atoms' angles in place of their coordinates; `entries` is
    /// emptied first.
    pub fn entries(&self, posed: &PosedBlsm, vertex: usize, entries: &mut Vec<(usize, DVec3)>) {
        entries.clear();
        let columns = Columns::of(self);
        let PosedBlsm { skeleton, shaped, axes, .. } = posed;
        let joints = skeleton.turns.len();
        // Of what is below each joint: the weights, and the weighted places.
        let (mut weights, mut places) = (vec![0.0; joints], vec![DVec3::ZERO; joints]);
        let mut by_bone = vec![DVec3::ZERO; joints];
        let mut linear = DMat3::ZERO;
        for (joint, weight) in &self.weights[vertex] {
            let place = skeleton.moved(*joint, shaped[vertex]) * *weight;
            let above = std::iter::successors(Some(*joint), |joint| self.skeleton.parents[*joint]);
            above.for_each(|joint| (weights[joint], places[joint]) = (weights[joint] + weight, places[joint] + place));
            let turn = skeleton.turns[*joint] * *weight;
            by_bone[self.skeleton.matter[*joint]] += turn * (shaped[vertex] - skeleton.rest[*joint]);
            linear += turn * skeleton.sizes[*joint];
        }
        entries.extend(DVec3::AXES.into_iter().enumerate());
        let arm = |joint: usize| places[joint] - skeleton.places[joint] * weights[joint];
        entries.extend(DVec3::AXES.into_iter().enumerate().map(|(axis, along)| (3 + axis, along.cross(arm(0)))));
        let turned = self.atoms.list.iter().zip(axes).zip(columns.atoms());
        let turned = turned.filter(|((atom, _), _)| weights[atom.joint] != 0.0);
        entries.extend(turned.map(|((atom, axis), column)| (column, axis.cross(arm(atom.joint)))));
        for (joint, parent) in self.skeleton.parents.iter().enumerate() {
            if let Some(parent) = parent.filter(|_| weights[joint] != 0.0) {
                by_bone[joint] += skeleton.turns[parent] * self.skeleton.offsets[joint] * weights[joint];
            }
        }
        let by_bone: Vec<(usize, DVec3)> =
            by_bone.into_iter().enumerate().filter(|(_, moved)| *moved != DVec3::ZERO).collect();
        for ((mode, flesh), column) in self.bone_basis.iter().zip(&self.bone_correctives).zip(columns.bones()) {
            let of_scales: DVec3 = by_bone.iter().map(|(bone, moved)| *moved * mode[*bone]).sum();
            let of_flesh = flesh.get(vertex).map_or(DVec3::ZERO, |offset| linear * *offset);
            if of_scales + of_flesh != DVec3::ZERO {
                entries.push((column, of_scales + of_flesh));
            }
        }
        let shapes = self.shape_basis.iter().zip(columns.shape());
        entries.extend(shapes.map(|(flesh, column)| (column, linear * flesh[vertex])));
    }

    /// The derivative by all columns of a function whose derivatives by the vertices (V) and the joints (J) are known.
    pub fn pullback(
        &self,
        parameters: &BlsmParameters,
        posed: &PosedBlsm,
        by_vertices: &[DVec3],
        by_joints: &[DVec3],
    ) -> Vec<f64> {
        let columns = Columns::of(self);
        let PosedBlsm { skeleton, shaped, axes, .. } = posed;
        let mut forces = by_joints.to_vec();
        let mut torques: Vec<DVec3> =
            skeleton.places.iter().zip(by_joints).map(|(place, force)| place.cross(*force)).collect();
        let mut by_bone = vec![0.0; forces.len()];
        let mut by_flesh = Vec::with_capacity(shaped.len());
        for ((row, place), force) in self.weights.iter().zip(shaped).zip(by_vertices) {
            let mut linear = DMat3::ZERO;
            for (joint, weight) in row {
                let pull = *force * *weight;
                forces[*joint] += pull;
                torques[*joint] += skeleton.moved(*joint, *place).cross(pull);
                let turn = skeleton.turns[*joint];
                by_bone[self.skeleton.matter[*joint]] += pull.dot(turn * (*place - skeleton.rest[*joint]));
                linear += turn * (skeleton.sizes[*joint] * weight);
            }
            by_flesh.push(linear.transpose() * *force);
        }
        for joint in (0..forces.len()).rev() {
            if let Some(parent) = self.skeleton.parents[joint] {
                let (force, torque) = (forces[joint], torques[joint]);
                forces[parent] += force;
                torques[parent] += torque;
                by_bone[joint] += force.dot(skeleton.turns[parent] * self.skeleton.offsets[joint]);
            }
        }
        let torque = |joint: usize| torques[joint] - skeleton.places[joint].cross(forces[joint]);
        let mut gradient = [forces[0].to_array(), torque(0).to_array()].concat();
        for ((atom, axis), x) in self.atoms.list.iter().zip(axes).zip(&parameters.atoms) {
            gradient.push(axis.dot(torque(atom.joint)) * atom.slope(*x));
        }
        let along =
            |flesh: &Vec<DVec3>| -> f64 { flesh.iter().zip(&by_flesh).map(|(offset, pull)| offset.dot(*pull)).sum() };
        for (mode, flesh) in self.bone_basis.iter().zip(&self.bone_correctives) {
            let of_scales: f64 = mode.iter().zip(&by_bone).map(|(entry, pull)| entry * pull).sum();
            gradient.push(of_scales + along(flesh));
        }
        gradient.extend(self.shape_basis.iter().map(along));
        debug_assert_eq!(gradient.len(), columns.count());
        gradient
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::collections::HashMap;

    use super::*;
    use crate::blsm::{Atom, Atoms, ScaledSkeleton};
    use crate::reference::{indices, largest_difference, reference, vectors};
    use xavatar_register::linear::so3;

    /// The body of the reference.
    pub(crate) fn reference_body() -> (BlsmBody, HashMap<String, Vec<f64>>) {
        let golden = reference("blsm_forward");
        let parents = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21_i64];
        let parents = parents.map(|parent| usize::try_from(parent).ok()).to_vec();
        let atom = |at: usize| Atom {
            joint: golden["atom_joint"][at] as usize,
            axis: golden["atom_axis"][at] as usize,
            low: golden["low"][at],
            high: golden["high"][at],
        };
        let row = |row: &[f64]| row.iter().copied().enumerate().filter(|(_, weight)| *weight != 0.0).collect();
        let each = |name: &str| golden[name].chunks_exact(96 * 3).map(vectors).collect::<Vec<_>>();
        let body = BlsmBody {
            names: (0..24).map(|joint| format!("joint_{joint:02}")).collect(),
            skeleton: ScaledSkeleton {
                parents,
                offsets: vectors(&golden["offsets"]),
                matter: indices(&golden["matter"]),
            },
            atoms: Atoms { list: (0..47).map(atom).collect(), joints: 24 },
            template: vectors(&golden["template"]),
            faces: vec![[0, 1, 2]],
            weights: golden["weights"].chunks_exact(24).map(row).collect(),
            bone_mean: golden["bone_mean"].clone(),
            bone_basis: golden["bone_basis"].chunks_exact(24).map(<[f64]>::to_vec).collect(),
            bone_correctives: each("bone_correctives"),
            shape_basis: each("shape_basis"),
        };
        (body, golden)
    }

    /// Parameters of one row of a reference.
    pub(crate) fn parameters(golden: &HashMap<String, Vec<f64>>, row: usize, prefix: &str) -> BlsmParameters {
        let part = |name: &str, width: usize| golden[name][width * row..width * (row + 1)].to_vec();
        let vector = |name: &str| DVec3::from_slice(&part(&format!("{prefix}{name}"), 3));
        BlsmParameters {
            turn: so3::exp(vector("global_orient")),
            translation: vector("transl"),
            atoms: part(&format!("{prefix}x"), 47),
            bones: part("bone_coefficients", 3),
            shape: part("shape_coefficients", 6),
        }
    }

    fn flat(points: &[DVec3]) -> Vec<f64> {
        points.iter().flat_map(|point| point.to_array()).collect()
    }

    /// d exp(r + dr) = exp(hat(L dr)) exp(r).
    fn left_jacobian(axis_angle: DVec3) -> DMat3 {
        so3::right_jacobian_inverse(-axis_angle).inverse()
    }

    #[test]
    fn poses_and_derivatives_are_the_references() {
        let (body, golden) = reference_body();
        let pulls = vectors(&golden["c_vertices"]);
        for pose in 0..4 {
            let parameters = parameters(&golden, pose, "");
            let posed = body.posed(&parameters);
            let part = |name: &str, width: usize| &golden[name][width * pose..width * (pose + 1)];
            assert!(largest_difference(&posed.scales, part("bone_scales", 24)) < 1e-14);
            assert!(largest_difference(&flat(&posed.shaped), part("shaped", 288)) < 1e-14);
            assert!(largest_difference(&flat(&posed.skeleton.places), part("joints", 72)) < 1e-13);
            assert!(largest_difference(&flat(&posed.vertices), part("vertices", 288)) < 1e-13);
            let by_joints: Vec<DVec3> = posed.skeleton.places.iter().map(|place| *place * 2.0).collect();
            let gradient = body.pullback(&parameters, &posed, &pulls, &by_joints);
            let columns = Columns::of(&body);
            assert!(largest_difference(&gradient[..3], part("d_transl", 3)) < 1e-11);
            assert!(largest_difference(&gradient[columns.atoms()], part("d_x", 47)) < 1e-11);
            assert!(largest_difference(&gradient[columns.bones()], part("d_bone_coefficients", 3)) < 1e-11);
            assert!(largest_difference(&gradient[columns.shape()], part("d_shape_coefficients", 6)) < 1e-11);
            let orient = DVec3::from_slice(&golden["global_orient"][3 * pose..]);
            let turned = left_jacobian(orient).transpose() * DVec3::from_slice(&gradient[3..6]);
            assert!(largest_difference(&turned.to_array(), part("d_global_orient", 3)) < 1e-11);
        }
    }

    // v(p + h e_i) - v(p - h e_i) = 2 h row_i + O(h^3), atoms by their angles.
    #[test]
    fn entries_are_those_of_finite_differences() {
        const STEP: f64 = 1e-5;
        let (body, golden) = reference_body();
        let parameters = parameters(&golden, 1, "");
        let (posed, columns) = (body.posed(&parameters), Columns::of(&body));
        let mut rows = vec![vec![DVec3::ZERO; columns.count()]; 96];
        let mut entries = Vec::new();
        for (vertex, row) in rows.iter_mut().enumerate() {
            body.entries(&posed, vertex, &mut entries);
            assert!(entries.is_sorted_by_key(|(column, _)| *column));
            entries.iter().for_each(|(column, entry)| row[*column] = *entry);
        }
        for column in 0..columns.count() {
            let moved = |size: f64| {
                let mut step = vec![0.0; columns.count()];
                step[column] = size;
                body.posed(&parameters.turned(&body.atoms, columns, &step)).vertices
            };
            for ((row, above), below) in rows.iter().zip(moved(STEP)).zip(moved(-STEP)) {
                let numeric = (above - below) / (2.0 * STEP);
                assert!(numeric.distance(row[column]) < 1e-7, "{column}: {numeric} {}", row[column]);
            }
        }
    }
}
