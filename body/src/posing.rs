//! Parameters to bodies: T(beta, psi, theta) = template + shapes [beta | psi] + correctives vec(R(theta_1..) - I), then
//! linear blend skinning (thesis eq. 4.1-4.2), and the canonical pose (A.3.3).
//!
//! The canonical pose is the T-pose but for hips turned +-pi/6 about z, jaw 0.2 about x and flat hands. Deformers map
//! canonical -> posed: B_j = G_j(theta) G_j(theta_canonical)^-1, the canonical side without expression, so that all frames
//! of a subject share one canonical space. V vertices, J joints; metres, radians.

use std::f32::consts::FRAC_PI_6;

use glam::{Affine3A, Mat3, Mat3A, Vec3};
use rayon::prelude::*;

use super::model::{BETAS, BodyModel, HAND_COMPONENTS, HandSpace, POSE_FEATURES};
use super::skeleton::{JOINTS, bone_transforms, rotation};
use super::{BodyParameters, HandPose, PoseAxisAngle};
use xavatar_formats::{Error, Result};

/// A body in the pose, shape and place of its parameters.
#[derive(Clone, Debug)]
pub struct PosedBody {
    /// Vertices (V) in the world, translation included.
    pub vertices: Vec<Vec3>,
    /// Joints (J) in the world, translation included.
    pub joints: Vec<Vec3>,
    /// Rest -> posed transform of each joint (J), translation *not* included.
    pub bone_transforms: Vec<Affine3A>,
}

impl BodyModel {
    /// The body of these parameters.
    ///
    /// # Errors
    /// [`Error::Value`] if a parameter is not finite or a PCA hand has more coefficients than the model components.
    pub fn pose(&self, parameters: &BodyParameters) -> Result<PosedBody> {
        let rotations = self.joint_rotations(parameters)?;
        let rest = self.rest_joints(&parameters.betas, &parameters.expression);
        let bone_transforms = bone_transforms(&rest, &rotations);
        let mut vertices = self.shaped(parameters, &rotations);
        skin(&mut vertices, &self.skinning_weights, &bone_transforms);
        let translation = parameters.transl;
        vertices.iter_mut().for_each(|vertex| *vertex += translation);
        let place = |(transform, joint): (&Affine3A, &Vec3)| transform.transform_point3(*joint) + translation;
        let joints = bone_transforms.iter().zip(&rest).map(place).collect();
        Ok(PosedBody { vertices, joints, bone_transforms })
    }

    /// The vertices (V) before skinning: template, shape, expression and pose correctives.
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn rest_vertices(&self, parameters: &BodyParameters) -> Result<Vec<Vec3>> {
        Ok(self.shaped(parameters, &self.joint_rotations(parameters)?))
    }

    /// The canonical pose for a shape, without expression.
    pub fn canonical_parameters(betas: &[f32; BETAS]) -> BodyParameters {
        let mut parameters = BodyParameters { betas: *betas, ..BodyParameters::default() };
        parameters.body_pose[0] = PoseAxisAngle(Vec3::Z * FRAC_PI_6);
        parameters.body_pose[1] = PoseAxisAngle(Vec3::Z * -FRAC_PI_6);
        parameters.jaw_pose = PoseAxisAngle(Vec3::X * 0.2);
        parameters
    }

    /// The transform of each joint (J) from the canonical pose of the same betas to the posed body, without translation.
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn canonical_to_posed(&self, parameters: &BodyParameters) -> Result<Vec<Affine3A>> {
        let rotations = self.joint_rotations(parameters)?;
        let posed = bone_transforms(&self.rest_joints(&parameters.betas, &parameters.expression), &rotations);
        let canonical = self.canonical_transforms(&parameters.betas)?;
        Ok(posed.iter().zip(&canonical).map(|(posed, canonical)| *posed * canonical.inverse()).collect())
    }

    /// The body of a shape and an expression in canonical space (V): shaped and skinned, without pose correctives.
    ///
    /// Skinned on by [`canonical_to_posed`](Self::canonical_to_posed) with the frame's [`vertex_offsets`](Self::vertex_offsets)
    /// carried along, it is the posed body. (`pose` of [`canonical_parameters`](Self::canonical_parameters) has the correctives.)
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn canonical_vertices(&self, betas: &[f32; BETAS], expression: &[f32; BETAS]) -> Result<Vec<Vec3>> {
        let transforms = self.canonical_transforms(betas)?;
        let mut vertices = self.template.clone();
        self.shapes.add_to(&mut vertices, &shape_coefficients(betas, expression));
        skin(&mut vertices, &self.skinning_weights, &transforms);
        Ok(vertices)
    }

    /// The canonical positions of the joints (J) of a shape, without expression.
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn canonical_joints(&self, betas: &[f32; BETAS]) -> Result<[Vec3; JOINTS]> {
        let transforms = self.canonical_transforms(betas)?;
        let rest = self.rest_joints(betas, &[0.0; BETAS]);
        Ok(std::array::from_fn(|joint| transforms[joint].transform_point3(rest[joint])))
    }

    /// What expression and pose correctives add to the shaped template, in the rest pose's frame (V).
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn vertex_offsets(&self, parameters: &BodyParameters) -> Result<Vec<Vec3>> {
        let rotations = self.joint_rotations(parameters)?;
        let mut offsets = vec![Vec3::ZERO; self.vertex_count()];
        self.shapes.add_to(&mut offsets, &shape_coefficients(&[0.0; BETAS], &parameters.expression));
        self.pose_correctives.add_to(&mut offsets, &pose_features(&rotations));
        Ok(offsets)
    }

    /// [`vertex_offsets`](Self::vertex_offsets) turned as the canonical pose turns each vertex (V): what a deformer adds to
    /// canonical points before it moves them.
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn canonical_offsets(&self, parameters: &BodyParameters) -> Result<Vec<Vec3>> {
        let mut turns = self.canonical_transforms(&parameters.betas)?;
        turns.iter_mut().for_each(|transform| transform.translation = Vec3::ZERO.into());
        let mut offsets = self.vertex_offsets(parameters)?;
        skin(&mut offsets, &self.skinning_weights, &turns);
        Ok(offsets)
    }

    fn shaped(&self, parameters: &BodyParameters, rotations: &[Mat3A; JOINTS]) -> Vec<Vec3> {
        let mut vertices = self.template.clone();
        self.shapes.add_to(&mut vertices, &shape_coefficients(&parameters.betas, &parameters.expression));
        self.pose_correctives.add_to(&mut vertices, &pose_features(rotations));
        vertices
    }

    fn canonical_transforms(&self, betas: &[f32; BETAS]) -> Result<Vec<Affine3A>> {
        let rotations = self.joint_rotations(&Self::canonical_parameters(betas))?;
        Ok(bone_transforms(&self.rest_joints(betas, &[0.0; BETAS]), &rotations))
    }

    fn rest_joints(&self, betas: &[f32; BETAS], expression: &[f32; BETAS]) -> [Vec3; JOINTS] {
        let coefficients = shape_coefficients(betas, expression);
        std::array::from_fn(|joint| {
            let shapes = self.joint_shapes[joint].iter().zip(coefficients);
            shapes.fold(self.joint_template[joint], |position, (direction, coefficient)| {
                position + *direction * coefficient
            })
        })
    }

    /// The rotation of each joint (J) relative to its parent, whatever convention the hands came in: all absolute.
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn joint_poses(&self, parameters: &BodyParameters) -> Result<[PoseAxisAngle; JOINTS]> {
        let left = self.left_hand.rotations("left_hand_pose", &parameters.left_hand_pose)?;
        let right = self.right_hand.rotations("right_hand_pose", &parameters.right_hand_pose)?;
        parameters.joint_poses(&left, &right)
    }

    fn joint_rotations(&self, parameters: &BodyParameters) -> Result<[Mat3A; JOINTS]> {
        Ok(self.joint_poses(parameters)?.map(rotation))
    }
}

/// Linear blend skinning in place: the mean of the `transforms` (J) by each vertex's row of `weights` (V, J), applied to it.
pub fn skin(vertices: &mut [Vec3], weights: &[f32], transforms: &[Affine3A]) {
    let rows = weights.par_chunks_exact(JOINTS);
    vertices.par_iter_mut().zip(rows).with_min_len(512).for_each(|(vertex, weights)| {
        let mut blend = Affine3A::from_mat3_translation(Mat3::ZERO, Vec3::ZERO);
        for (transform, weight) in transforms.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
            blend.matrix3 += transform.matrix3 * *weight;
            blend.translation += transform.translation * *weight;
        }
        *vertex = blend.transform_point3(*vertex);
    });
}

impl HandSpace {
    /// The absolute rotations of the hand's 15 joints.
    fn rotations(&self, name: &str, pose: &HandPose) -> Result<[PoseAxisAngle; 15]> {
        let mut values = self.mean;
        match pose {
            HandPose::Flat(rotations) => return Ok(*rotations),
            HandPose::RelativeToMean(rotations) => {
                for (joint, rotation) in rotations.iter().enumerate() {
                    for axis in 0..3 {
                        values[joint * 3 + axis] += rotation.0[axis];
                    }
                }
            }
            HandPose::Pca(coefficients) => {
                if coefficients.len() > self.components.len() {
                    return Err(Error::Value {
                        name: name.into(),
                        found: format!("{} PCA coefficients", coefficients.len()),
                        expected: format!("at most {}, the components of the model", self.components.len()),
                    });
                }
                for (coefficient, component) in coefficients.iter().zip(&self.components) {
                    for index in 0..HAND_COMPONENTS {
                        values[index] += coefficient * component[index];
                    }
                }
            }
        }
        Ok(std::array::from_fn(|joint| PoseAxisAngle(Vec3::from_slice(&values[joint * 3..]))))
    }
}

fn shape_coefficients(betas: &[f32; BETAS], expression: &[f32; BETAS]) -> [f32; 2 * BETAS] {
    std::array::from_fn(|shape| if shape < BETAS { betas[shape] } else { expression[shape - BETAS] })
}

/// The entries, row by row, of R(theta_j) - I for all joints but the root.
fn pose_features(rotations: &[Mat3A; JOINTS]) -> [f32; POSE_FEATURES] {
    std::array::from_fn(|feature| {
        let (joint, row, column) = (1 + feature / 9, feature % 9 / 3, feature % 3);
        rotations[joint].col(column)[row] - if row == column { 1.0 } else { 0.0 }
    })
}
