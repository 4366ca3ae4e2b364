//! One canonical mesh, skinned forward to every pose: x_d = sum_j w_j(x_c) B_j (x_c + o), its faces the same in all frames.
//!
//! Weights, their gradients and the fields' colours are evaluated once, so that a frame costs a blend a vertex. The surface is
//! that under the zero condition, which training has seen as often as `fields.condition_dropout` says. What a pose hides, as
//! where a hand lies on the hip, is still in the mesh: for pictures and metrics extract every pose with [`super::Animator`].
//! V vertices, J joints; metres.

use glam::Vec3;
use rayon::prelude::*;
use xavatar_deformer::{BoneTransform, GradientSide};
use xavatar_deformer::{Jacobian, blend_transforms, deform, deformed_normals, skinning_jacobians};

use super::{Avatar, arrays};
use crate::Result;
use crate::body::{BodyModel, Pose};
use crate::fields::{BLOCK_ROWS, BodyPlaces, FieldEvaluator, bone_rows};
use crate::mesh::TriangleMesh;

/// A canonical mesh that is skinned from frame to frame.
pub struct FixedTopology {
    body: BodyModel,
    betas: Vec<f32>,
    /// J.
    joints: usize,
    /// The canonical mesh, with normals and colours.
    canonical: TriangleMesh,
    points: Vec<[f32; 3]>,
    /// Where on the body its offsets are taken; none if the avatar was trained without them.
    places: Option<BodyPlaces>,
    normals: Vec<[f32; 3]>,
    /// Skinning weights (V, J).
    weights: Vec<f32>,
    /// Their derivatives along x, y and z (V, 3, J).
    gradients: Vec<f32>,
    dropped_components: usize,
}

impl FixedTopology {
    /// Extracts the canonical surface with `resolution` cells along the longest side, and its skinning.
    ///
    /// # Errors
    /// If the body is of another skeleton; as [`Avatar::extract_canonical`].
    pub fn new(avatar: &Avatar, body: &BodyModel, resolution: usize) -> Result<Self> {
        let body = body.in_canonical_pose_of(&avatar.subject.skeleton)?;
        let extraction = avatar.extract_unconditioned(resolution)?;
        let canonical = extraction.mesh;
        let points = arrays(&canonical.vertices);
        let normals = arrays(canonical.normals.as_deref().unwrap_or_default());
        let joints = avatar.subject.skeleton.joints.len();
        let (weights, gradients) =
            FieldEvaluator::new(&avatar.fields, &avatar.condition().none()).weights_and_gradients(&points);
        let places = match avatar.fields.skinning.carries_blend_shapes() {
            true => Some(BodyPlaces::nearest(&body, &avatar.subject.betas, &canonical.vertices)?.0),
            false => None,
        };
        let (betas, dropped_components) = (avatar.subject.betas.clone(), extraction.dropped_components);
        Ok(Self { body, betas, joints, canonical, points, places, normals, weights, gradients, dropped_components })
    }

    /// The canonical mesh (V), with the normals and colours of the canonical pose.
    pub fn canonical(&self) -> &TriangleMesh {
        &self.canonical
    }

    /// Smaller components of the canonical surface that were left out.
    pub fn dropped_components(&self) -> usize {
        self.dropped_components
    }

    /// Skinning weights of the canonical vertices (V, J), row-major; each row sums to 1.
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// The canonical vertices (V) with the frame's offsets of the body model, which an avatar trained with them has: x_c + o.
    ///
    /// # Errors
    /// If the pose does not fit the body model.
    pub fn displaced(&self, pose: &Pose) -> Result<Vec<[f32; 3]>> {
        let mut points = self.points.clone();
        if let Some(places) = &self.places {
            let offsets = places.offsets(&self.body.canonical_offsets(&pose.in_shape(&self.betas))?);
            let offsets = offsets.as_flattened();
            points.as_flattened_mut().iter_mut().zip(offsets).for_each(|(point, offset)| *point += offset);
        }
        Ok(points)
    }

    /// The mesh in a pose, in the avatar's own shape and in the world. It has the faces and colours of the canonical mesh.
    ///
    /// # Errors
    /// If the pose does not fit the body model.
    pub fn pose(&self, pose: &Pose) -> Result<TriangleMesh> {
        let pose = pose.in_shape(&self.betas);
        let bones = bone_rows(&self.body.canonical_to_posed(&pose)?);
        let points = self.displaced(&pose)?;
        let mut vertices = vec![Vec3::ZERO; points.len()];
        let mut normals = vec![Vec3::ZERO; points.len()];
        let places = vertices.par_chunks_mut(BLOCK_ROWS).zip(normals.par_chunks_mut(BLOCK_ROWS));
        places.enumerate().try_for_each_init(Skinner::default, |skinner, (block, (vertices, normals))| {
            skinner.skin(&self.block(&points, block), &bones)?;
            for (vertex, deformed) in vertices.iter_mut().zip(&skinner.deformed) {
                *vertex = Vec3::from_array(*deformed) + pose.translation;
            }
            for (normal, deformed) in normals.iter_mut().zip(&skinner.normals) {
                *normal = Vec3::from_array(*deformed);
            }
            Ok::<(), crate::Error>(())
        })?;
        let TriangleMesh { faces, colouring, .. } = self.canonical.clone();
        Ok(TriangleMesh { vertices, faces, normals: Some(normals), colouring })
    }

    fn block<'b>(&'b self, points: &'b [[f32; 3]], block: usize) -> Block<'b> {
        let first = block * BLOCK_ROWS;
        let rows = first..(first + BLOCK_ROWS).min(points.len());
        Block {
            points: &points[rows.clone()],
            normals: &self.normals[rows.clone()],
            weights: &self.weights[rows.start * self.joints..rows.end * self.joints],
            gradients: &self.gradients[3 * rows.start * self.joints..3 * rows.end * self.joints],
        }
    }
}

/// Consecutive vertices and their skinning.
struct Block<'a> {
    points: &'a [[f32; 3]],
    normals: &'a [[f32; 3]],
    weights: &'a [f32],
    gradients: &'a [f32],
}

/// One thread's memory while it skins.
#[derive(Default)]
struct Skinner {
    transforms: Vec<BoneTransform<f32>>,
    jacobians: Vec<Jacobian<f32>>,
    deformed: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

impl Skinner {
    /// Canonical vertices -> blended transforms -> deformed vertices and normals.
    fn skin(&mut self, block: &Block, bones: &[BoneTransform<f32>]) -> Result<()> {
        let count = block.points.len();
        self.transforms.resize(count, [0.0; 12]);
        self.jacobians.resize(count, [[0.0; 3]; 3]);
        self.deformed.resize(count, [0.0; 3]);
        self.normals.resize(count, [0.0; 3]);
        let points = block.points;
        blend_transforms(block.weights, bones, &mut self.transforms)?;
        deform(&self.transforms, points, &mut self.deformed)?;
        skinning_jacobians(&self.transforms, block.gradients, bones, points, &mut self.jacobians)?;
        deformed_normals(block.normals, &self.jacobians, GradientSide::Outward, &mut self.normals)?;
        Ok(())
    }
}
