//! Poses to bodies: T(beta, psi, theta) = template + shapes [beta | psi] + correctives f(theta), then linear blend skinning
//! (thesis eq. 4.1-4.2), and the way there from the skeleton's canonical pose.
//!
//! Deformers map canonical -> posed: B_j = G_j(theta) G_j(theta_canonical)^-1, the canonical side without expression, so that all
//! frames of a subject share one canonical space. f are the entries of R(theta_j) - I, j >= 1. V vertices, J joints; metres, radians.

use glam::{Affine3A, Mat3, Mat3A, Vec3};
use rayon::prelude::*;

use super::batch::features;
use super::skeleton::rotation;
use super::{BodyModel, Pose};
use xavatar_formats::Result;

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
    /// The body in a pose.
    ///
    /// # Errors
    /// [`Error::Value`](xavatar_formats::Error::Value) if the pose is not of this model's skeleton, has more coefficients than the model, or numbers that are not
    /// finite.
    pub fn pose(&self, pose: &Pose) -> Result<PosedBody> {
        let rotations = self.joint_rotations(pose)?;
        let rest = self.rest_joints(&pose.shape, &pose.expression);
        let bone_transforms = self.skeleton().bone_transforms(&rest, &rotations);
        let mut vertices = self.shaped(pose, &rotations);
        skin(&mut vertices, self.skinning_weights(), &bone_transforms);
        let translation = pose.translation;
        vertices.iter_mut().for_each(|vertex| *vertex += translation);
        let place = |(transform, joint): (&Affine3A, &Vec3)| transform.transform_point3(*joint) + translation;
        let joints = bone_transforms.iter().zip(&rest).map(place).collect();
        Ok(PosedBody { vertices, joints, bone_transforms })
    }

    /// The vertices (V) before skinning: template, shape, expression and pose correctives.
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn rest_vertices(&self, pose: &Pose) -> Result<Vec<Vec3>> {
        Ok(self.shaped(pose, &self.joint_rotations(pose)?))
    }

    /// The transform of each joint (J) from the canonical pose of the same shape to the posed body, without translation.
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn canonical_to_posed(&self, pose: &Pose) -> Result<Vec<Affine3A>> {
        let rotations = self.joint_rotations(pose)?;
        let posed = self.skeleton().bone_transforms(&self.rest_joints(&pose.shape, &pose.expression), &rotations);
        let canonical = self.canonical_transforms(&pose.shape)?;
        Ok(posed.iter().zip(&canonical).map(|(posed, canonical)| *posed * canonical.inverse()).collect())
    }

    /// The body of a shape and an expression in canonical space (V): shaped and skinned, without pose correctives.
    ///
    /// Skinned on by [`canonical_to_posed`](Self::canonical_to_posed) with the frame's [`vertex_offsets`](Self::vertex_offsets)
    /// carried along, it is the posed body. (`pose` of the canonical pose has the correctives.)
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn canonical_vertices(&self, shape: &[f32], expression: &[f32]) -> Result<Vec<Vec3>> {
        let transforms = self.canonical_transforms(shape)?;
        let mut vertices = self.template().to_vec();
        self.anatomy.shapes.add_to(&mut vertices, &self.coefficients(shape, expression));
        skin(&mut vertices, self.skinning_weights(), &transforms);
        Ok(vertices)
    }

    /// The canonical positions of the joints (J) of a shape, without expression.
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn canonical_joints(&self, shape: &[f32]) -> Result<Vec<Vec3>> {
        let transforms = self.canonical_transforms(shape)?;
        let rest = self.rest_joints(shape, &[]);
        Ok(transforms.iter().zip(rest).map(|(transform, rest)| transform.transform_point3(rest)).collect())
    }

    /// What expression and pose correctives add to the shaped template, in the rest pose's frame (V).
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn vertex_offsets(&self, pose: &Pose) -> Result<Vec<Vec3>> {
        let rotations = self.joint_rotations(pose)?;
        let mut offsets = vec![Vec3::ZERO; self.vertex_count()];
        self.anatomy.shapes.add_to(&mut offsets, &self.coefficients(&[], &pose.expression));
        self.add_correctives(&mut offsets, pose, &rotations);
        Ok(offsets)
    }

    /// [`vertex_offsets`](Self::vertex_offsets) turned as the canonical pose turns each vertex (V): what a deformer adds to
    /// canonical points before it moves them.
    ///
    /// # Errors
    /// As [`pose`](Self::pose).
    pub fn canonical_offsets(&self, pose: &Pose) -> Result<Vec<Vec3>> {
        let mut turns = self.canonical_transforms(&pose.shape)?;
        turns.iter_mut().for_each(|transform| transform.translation = Vec3::ZERO.into());
        let mut offsets = self.vertex_offsets(pose)?;
        skin(&mut offsets, self.skinning_weights(), &turns);
        Ok(offsets)
    }

    fn shaped(&self, pose: &Pose, rotations: &[Mat3A]) -> Vec<Vec3> {
        let mut vertices = self.template().to_vec();
        self.anatomy.shapes.add_to(&mut vertices, &self.coefficients(&pose.shape, &pose.expression));
        self.add_correctives(&mut vertices, pose, rotations);
        vertices
    }

    /// Adds what a pose, with its joints' `rotations` (J), does to the vertices (V) beyond skinning.
    fn add_correctives(&self, vertices: &mut [Vec3], pose: &Pose, rotations: &[Mat3A]) {
        let Some(shapes) = self.anatomy.correctives.shapes() else { return };
        let axis_angles: Vec<[f32; 3]> = pose.rotations.iter().map(|rotation| rotation.0.to_array()).collect();
        let rows: Vec<[f32; 9]> = rotations.iter().map(|rotation| rotation.transpose().to_cols_array()).collect();
        let coefficients = self.coefficients(&pose.shape, &pose.expression);
        shapes.add_to(vertices, &features(&self.anatomy.correctives, &axis_angles, &rows, &coefficients));
    }

    fn canonical_transforms(&self, shape: &[f32]) -> Result<Vec<Affine3A>> {
        let rotations = self.joint_rotations(&self.skeleton().canonical_pose(shape))?;
        Ok(self.skeleton().bone_transforms(&self.rest_joints(shape, &[]), &rotations))
    }

    fn rest_joints(&self, shape: &[f32], expression: &[f32]) -> Vec<Vec3> {
        let coefficients = self.coefficients(shape, expression);
        let mut joints: Vec<Vec3> = self.anatomy.joints.template.iter().map(|joint| joint.as_vec3()).collect();
        for (direction, coefficient) in self.anatomy.joints.directions.iter().zip(coefficients) {
            joints.iter_mut().zip(direction).for_each(|(joint, moved)| *joint += moved.as_vec3() * coefficient);
        }
        joints
    }

    /// Shape, then expression, all that there are.
    pub(super) fn coefficients(&self, shape: &[f32], expression: &[f32]) -> Vec<f32> {
        let mut coefficients = vec![0.0; self.anatomy.shapes.count()];
        let (of_shape, of_expression) = coefficients.split_at_mut(self.shape_coefficients());
        of_shape.iter_mut().zip(shape).for_each(|(all, given)| *all = *given);
        of_expression.iter_mut().zip(expression).for_each(|(all, given)| *all = *given);
        coefficients
    }

    /// That a pose is one of this model.
    pub(super) fn check(&self, pose: &Pose) -> Result<()> {
        pose.check(self.skeleton(), self.shape_coefficients(), self.expression_coefficients())
    }

    /// The rotation matrix of each joint (J) relative to its parent.
    fn joint_rotations(&self, pose: &Pose) -> Result<Vec<Mat3A>> {
        self.check(pose)?;
        Ok(pose.rotations.iter().copied().map(rotation).collect())
    }
}

/// Linear blend skinning in place: the mean of the `transforms` (J) by each vertex's row of `weights` (V, J), applied to it.
pub fn skin(vertices: &mut [Vec3], weights: &[f32], transforms: &[Affine3A]) {
    let rows = weights.par_chunks_exact(transforms.len());
    vertices.par_iter_mut().zip(rows).with_min_len(512).for_each(|(vertex, weights)| {
        let mut blend = Affine3A::from_mat3_translation(Mat3::ZERO, Vec3::ZERO);
        for (transform, weight) in transforms.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
            blend.matrix3 += transform.matrix3 * *weight;
            blend.translation += transform.translation * *weight;
        }
        *vertex = blend.transform_point3(*vertex);
    });
}
