//! A part cut out of a body: a head, a hand, a foot, as a model of its own (Osman 4.4-4.5; METHOD-BODY section 4).
//!
//! The joints that influence the part's vertices P are those with sum_P w_vj > 0 or a corrective there; those between them are kept too, so that
//! they are one tree under the lowest joint above all. That joint is the part's root: its rotation is the joint's in the whole body's
//! world. Then the part equals the whole on P in every pose, up to that one motion. J joints, V vertices; metres.

use std::collections::BTreeSet;

use glam::{DMat3, DQuat, Mat3A};
use xavatar_formats::{Error, Result};
use xavatar_vector::Scalar;

use super::skeleton::rotation;
use super::{Anatomy, BodyModel, Correctives, JointBasis, PartGroup, PoseAxisAngle, PoseBatch, Skeleton};

/// A part of a body, as a model, and where it came from.
#[derive(Clone, Debug)]
pub struct BodyPart {
    /// The part.
    pub model: BodyModel,
    /// Its vertices' places in the whole, ascending.
    pub vertices: Vec<usize>,
    /// Its joints' places in the whole, the root first.
    pub joints: Vec<usize>,
}

impl BodyModel {
    /// The part of the body that these vertices are. Correctives that move none of them by more than `negligible` (metres for a feature of one) are
    /// left out; with 0 nothing is lost.
    ///
    /// # Errors
    /// [`Error::Value`] if there are no vertices, or one that the body does not have.
    pub fn separated(&self, vertices: &[usize], negligible: f32) -> Result<BodyPart> {
        let vertices: Vec<usize> = vertices.iter().copied().collect::<BTreeSet<usize>>().into_iter().collect();
        if vertices.last().is_none_or(|last| *last >= self.vertex_count()) {
            let (found, expected) =
                (format!("{} vertices", vertices.len()), format!("some below {}", self.vertex_count()));
            return Err(Error::Value { name: "a part of a body".into(), found, expected });
        }
        let joints = self.joints_of(&vertices, negligible);
        let anatomy = &self.anatomy;
        let number: Vec<Option<u32>> = {
            let mut number = vec![None; self.vertex_count()];
            (0..).zip(&vertices).for_each(|(index, vertex)| number[*vertex] = Some(index));
            number
        };
        let face = |face: &[u32; 3]| {
            let corner = |corner: u32| number[corner as usize];
            Some([corner(face[0])?, corner(face[1])?, corner(face[2])?])
        };
        let count = anatomy.skeleton.joints.len();
        let of_joints = |row: &Vec<glam::DVec3>| joints.iter().map(|joint| row[*joint]).collect();
        let part = Anatomy {
            skeleton: self.part_skeleton(&joints),
            template: vertices.iter().map(|vertex| anatomy.template[*vertex]).collect(),
            faces: anatomy.faces.iter().filter_map(face).collect(),
            skinning_weights: vertices
                .iter()
                .flat_map(|vertex| joints.iter().map(move |joint| anatomy.skinning_weights[vertex * count + joint]))
                .collect(),
            shapes: anatomy.shapes.of_vertices(&vertices, 0..anatomy.shapes.count()),
            expressions: anatomy.expressions,
            joints: JointBasis {
                template: of_joints(&anatomy.joints.template),
                directions: anatomy.joints.directions.iter().map(of_joints).collect(),
            },
            correctives: self.part_correctives(&vertices, &joints),
            hands: Vec::new(),
        };
        Ok(BodyPart { model: Self::assemble(self.path(), part)?, vertices, joints })
    }

    /// The vertices that follow a joint or what hangs on it most, ascending.
    ///
    /// # Errors
    /// [`Error::Value`] if the skeleton has no such joint.
    pub fn vertices_from(&self, joint: &str) -> Result<Vec<usize>> {
        let skeleton = &self.anatomy.skeleton;
        let Some(first) = skeleton.joint(joint) else {
            let expected = format!("one of {}", skeleton.joints.join(", "));
            return Err(Error::Value { name: "a joint of the body".into(), found: joint.into(), expected });
        };
        let hangs = |joint: usize| {
            std::iter::successors(Some(joint), |joint| skeleton.parents[*joint]).any(|above| above == first)
        };
        let rows = self.anatomy.skinning_weights.chunks_exact(skeleton.joints.len());
        let share = |row: &[f32]| (0..row.len()).filter(|joint| hangs(*joint)).map(|joint| row[joint]).sum::<f32>();
        Ok(rows.enumerate().filter(|(_, row)| share(row) > 0.5).map(|(vertex, _)| vertex).collect())
    }

    /// The joints that a part keeps, ascending, the root first.
    fn joints_of(&self, vertices: &[usize], negligible: f32) -> Vec<usize> {
        let (parents, count) = (&self.anatomy.skeleton.parents, self.anatomy.skeleton.joints.len());
        let weighs =
            |joint: usize| vertices.iter().any(|vertex| self.anatomy.skinning_weights[vertex * count + joint] > 0.0);
        let corrects = |joint: usize| self.anatomy.correctives.strength(joint, vertices) > negligible;
        let influencing: Vec<usize> = (0..count).filter(|joint| weighs(*joint) || corrects(*joint)).collect();
        let above = |joint: usize| std::iter::successors(Some(joint), |joint| parents[*joint]);
        let is_above_all =
            |ancestor: usize| influencing.iter().all(|joint| above(*joint).any(|above| above == ancestor));
        let first = influencing.first().copied().unwrap_or_default();
        // What the root's own rotation corrects is lost with it: then its parent is the root.
        let root = above(first).find(|ancestor| is_above_all(*ancestor) && !corrects(*ancestor)).unwrap_or_default();
        let mut kept = BTreeSet::from([root]);
        for joint in influencing {
            kept.extend(above(joint).take_while(|joint| *joint != root));
        }
        kept.into_iter().collect()
    }

    fn part_skeleton(&self, joints: &[usize]) -> Skeleton {
        let whole = &self.anatomy.skeleton;
        let number = |joint: usize| joints.iter().position(|kept| *kept == joint);
        let numbers = |of: &[usize]| of.iter().filter_map(|joint| number(*joint)).collect::<Vec<usize>>();
        let part = |group: &PartGroup| {
            let own = numbers(&group.joints);
            let starts = numbers(&group.starts);
            let detail = group.detail.clone().map(|detail| super::Detail { joints: numbers(&detail.joints), ..detail });
            (!own.is_empty()).then(|| PartGroup {
                starts: if starts.is_empty() { own.clone() } else { starts },
                detail: detail.filter(|detail| !detail.joints.is_empty()),
                joints: own,
                ..group.clone()
            })
        };
        let starts = numbers(&whole.starts);
        let mut canonical: Vec<PoseAxisAngle> = joints.iter().map(|joint| whole.canonical[*joint]).collect();
        let above = std::iter::successors(Some(joints[0]), |joint| whole.parents[*joint]);
        let turn = above.fold(Mat3A::IDENTITY, |turn, joint| rotation(whole.canonical[joint]) * turn);
        canonical[0] = PoseAxisAngle(glam::Quat::from_mat3a(&turn).to_scaled_axis());
        Skeleton {
            family: format!("part of {}", whole.family),
            joints: joints.iter().map(|joint| whole.joints[*joint].clone()).collect(),
            parents: (0..joints.len())
                .map(|joint| if joint == 0 { None } else { number(whole.parents[joints[joint]]?) })
                .collect(),
            parts: whole.parts.iter().filter_map(part).collect(),
            starts: if starts.is_empty() { (0..joints.len()).collect() } else { starts },
            canonical,
            conditioning: numbers(&whole.conditioning).into_iter().filter(|joint| *joint != 0).collect(),
        }
    }

    fn part_correctives(&self, vertices: &[usize], joints: &[usize]) -> Correctives {
        let of = |shapes: &super::BlendShapes, columns: Vec<usize>| shapes.of_vertices(vertices, columns);
        // The root of a part drives none, unless it is the body's.
        let of_joints = |first: usize| joints[first..].iter().copied();
        match &self.anatomy.correctives {
            Correctives::None => Correctives::None,
            Correctives::RotationEntries(shapes) => {
                let columns = of_joints(1).flat_map(|joint| 9 * (joint - 1)..9 * joint).collect();
                Correctives::RotationEntries(of(shapes, columns))
            }
            Correctives::Quaternions { first_joint, coefficient, shapes } => {
                let first = if joints[0] == 0 { *first_joint } else { 1 };
                let of_quaternions =
                    of_joints(first).flat_map(|joint| 4 * (joint - first_joint)..4 * (joint - first_joint + 1));
                let columns = of_quaternions.chain(coefficient.map(|_| shapes.count() - 1)).collect();
                Correctives::Quaternions { first_joint: first, coefficient: *coefficient, shapes: of(shapes, columns) }
            }
        }
    }
}

impl Correctives {
    /// How far the features of a joint move any of these vertices at most, metres for a feature of one.
    fn strength(&self, joint: usize, vertices: &[usize]) -> f32 {
        let (shapes, columns) = match self {
            Self::None => return 0.0,
            Self::RotationEntries(shapes) => (shapes, (joint > 0).then(|| 9 * (joint - 1)..9 * joint)),
            Self::Quaternions { first_joint, shapes, .. } => {
                let place = joint.checked_sub(*first_joint);
                (shapes, place.map(|place| 4 * place..4 * (place + 1)))
            }
        };
        columns.map_or(0.0, |columns| shapes.largest_offset(columns, vertices))
    }
}

impl BodyPart {
    /// The poses of the part that are those of the whole body.
    ///
    /// # Errors
    /// [`Error::Value`] if the batch is not of the whole body.
    pub fn poses<T: Scalar>(&self, whole: &BodyModel, batch: &PoseBatch<T>) -> Result<PoseBatch<T>> {
        let count = whole.skeleton().joints.len();
        let posed = whole.pose_batch(batch)?;
        let mut poses =
            PoseBatch { rotations: Vec::new(), coefficients: batch.coefficients.clone(), translations: Vec::new() };
        let root = self.joints[0];
        for (frame, rotations) in batch.rotations.chunks_exact(count).enumerate() {
            let turn = posed.turn_of(frame, root).map(T::wide);
            let turn = DQuat::from_mat3(&DMat3::from_cols_array(&turn).transpose()).to_scaled_axis();
            poses.rotations.push(turn.to_array().map(T::of));
            poses.rotations.extend(self.joints[1..].iter().map(|joint| rotations[*joint]));
            let (place, rest) = (posed.joints[frame * count + root], posed.rest_joint(frame, root));
            poses.translations.push([0, 1, 2].map(|axis| place[axis] - rest[axis]));
        }
        Ok(poses)
    }
}

#[cfg(test)]
#[path = "separation_tests.rs"]
mod tests;
