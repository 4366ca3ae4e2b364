//! What a rig stands for, frame by frame and without its limits: every skinning weight, every offset.
//!
//! With a body model that of [`FixedTopology`]: x = sum_j w_j B_j (x_c + o) + translation. Where the warp carries no
//! expressions, o has those of the geometry field. Without a body model B_j is the skeleton's. V vertices, J joints, E expression coefficients; metres.

use glam::{Affine3A, Quat, Vec3, Vec3A};
use rayon::prelude::*;

use super::expressions::{displacements, unit_expression};
use super::influences::Influences;
use super::rig::{Joint, blend, skinning_transforms};
use super::skeleton::{joints, rotations};
use crate::avatar::{Avatar, FixedTopology, Subject};
use crate::body::{BodyModel, PartGroup, Pose, Skeleton};
use crate::fields::FieldEvaluator;
use crate::mesh::TriangleMesh;
use crate::{Error, InputError, Result};

/// A body model whose joints are this far from the avatar's is another one, metres.
const SAME_JOINT: f32 = 1e-3;

/// An avatar's canonical surface and its exact motion.
pub(super) struct Reference {
    /// With normals and colours.
    pub(super) mesh: TriangleMesh,
    pub(super) joints: Vec<Joint>,
    /// Skinning weights (V, J).
    pub(super) weights: Vec<f32>,
    /// Components of the canonical surface that were left out.
    pub(super) dropped_components: usize,
    all: Influences,
    betas: Vec<f32>,
    skeleton: Skeleton,
    /// In the avatar's canonical pose.
    body: Option<(BodyModel, FixedTopology)>,
    /// E.
    count: usize,
    /// The field's displacements by unit expressions (E, V); empty where the warp carries expressions.
    expressions: Vec<Vec<Vec3>>,
}

/// One frame of the exact motion.
pub(super) struct Frame {
    /// Canonical vertices with the frame's offsets (V).
    pub(super) points: Vec<Vec3>,
    /// The exact vertices in the world (V).
    pub(super) posed: Vec<Vec3>,
    /// How the skeleton moves.
    pub(super) motion: Motion,
}

/// How the skeleton moves in one frame.
pub(super) struct Motion {
    /// Local rotations of the joints (J).
    pub(super) rotations: Vec<Quat>,
    /// Where the root is.
    pub(super) root: Vec3,
    /// All of its coefficients (E).
    pub(super) expression: Vec<f32>,
}

impl Reference {
    pub(super) fn new(avatar: &Avatar, body: Option<&BodyModel>, resolution: usize) -> Result<Self> {
        let Subject { betas, skeleton, expressions: count, .. } = avatar.subject.clone();
        let body = match body {
            Some(body) => Some((own_body(avatar, body)?, FixedTopology::new(avatar, body, resolution)?)),
            None => None,
        };
        let (mesh, weights, dropped_components) = match &body {
            Some((_, fixed)) => (fixed.canonical().clone(), fixed.weights().to_vec(), fixed.dropped_components()),
            None => {
                let extraction = avatar.extract_unconditioned(resolution)?;
                let weights = skinning_weights(avatar, &extraction.mesh.vertices);
                (extraction.mesh, weights, extraction.dropped_components)
            }
        };
        let warp_has_expressions = body.is_some() && avatar.fields.skinning.carries_blend_shapes();
        let expressions = match warp_has_expressions {
            true => Vec::new(),
            false => displacements(avatar, &mesh.vertices),
        };
        let most = Influences::most(&weights, skeleton.joints.len());
        Ok(Self {
            joints: joints(&skeleton, &avatar.subject.joints),
            all: Influences::strongest(&weights, skeleton.joints.len(), most.max(1)),
            mesh,
            weights,
            dropped_components,
            betas,
            skeleton,
            body,
            count,
            expressions,
        })
    }

    /// The most joints that hold a vertex.
    pub(super) fn most_influences(&self) -> usize {
        self.all.count
    }

    /// J.
    pub(super) fn joint_count(&self) -> usize {
        self.skeleton.joints.len()
    }

    /// The names of the body's parts.
    pub(super) fn parts(&self) -> Vec<String> {
        self.skeleton.parts.iter().map(PartGroup::title).collect()
    }

    /// E: how many expression coefficients the avatar has.
    pub(super) fn expression_count(&self) -> usize {
        self.count
    }

    /// The exact motion in this pose, in the avatar's own shape.
    pub(super) fn frame(&self, pose: &Pose) -> Result<Frame> {
        let pose = self.settled(pose)?;
        let motion = self.motion_of(&pose);
        let mut points = match &self.body {
            Some((_, fixed)) => fixed.displaced(&pose)?.into_iter().map(Vec3::from_array).collect(),
            None => self.mesh.vertices.clone(),
        };
        for (offsets, amount) in self.expressions.iter().zip(&pose.expression).filter(|(_, amount)| **amount != 0.0) {
            points.iter_mut().zip(offsets).for_each(|(point, offset)| *point += *offset * *amount);
        }
        let transforms = match &self.body {
            Some((body, _)) => {
                let mut transforms = body.canonical_to_posed(&pose)?;
                transforms.iter_mut().for_each(|transform| transform.translation += Vec3A::from(pose.translation));
                transforms
            }
            None => skinning_transforms(&self.joints, &motion.rotations, motion.root),
        };
        let posed = skin(&self.all, &transforms, &points);
        Ok(Frame { points, posed, motion })
    }

    /// How the skeleton moves in this pose, in the avatar's own shape.
    pub(super) fn motion(&self, pose: &Pose) -> Result<Motion> {
        Ok(self.motion_of(&self.settled(pose)?))
    }

    fn motion_of(&self, pose: &Pose) -> Motion {
        let root = self.joints[0].translation + pose.translation;
        Motion { rotations: rotations(&pose.rotations), root, expression: pose.expression.clone() }
    }

    /// The pose in the avatar's shape, with all of its coefficients.
    fn settled(&self, pose: &Pose) -> Result<Pose> {
        let mut pose = pose.in_shape(&self.betas);
        pose.check(&self.skeleton, self.betas.len(), self.count)?;
        pose.expression.resize(self.count, 0.0);
        Ok(pose)
    }

    /// What a unit of each expression coefficient does in the canonical pose (E, V): offsets of the surface, and joints that
    /// an expression moves.
    pub(super) fn expressions(&self) -> Result<Vec<Vec<Vec3>>> {
        let canonical = self.skeleton.canonical_pose(&self.betas);
        let resting = self.frame(&canonical)?.posed;
        let unit = |coefficient: usize| {
            let moved = self.frame(&Pose { expression: unit_expression(coefficient), ..canonical.clone() })?.posed;
            Ok(moved.iter().zip(&resting).map(|(to, from)| *to - *from).collect())
        };
        (0..self.count).map(unit).collect()
    }
}

/// What is wrong with a frame of a motion, with its number.
pub(super) fn in_motion(error: Error, index: usize) -> Error {
    error.in_frame(format!("{} of the motion", index + 1))
}

/// Linear blend skinning of points (V).
pub(super) fn skin(influences: &Influences, transforms: &[Affine3A], points: &[Vec3]) -> Vec<Vec3> {
    let skinned = |vertex: usize| {
        let (joints, weights) = influences.row(vertex);
        blend(transforms, joints, weights).transform_point3(points[vertex])
    };
    (0..points.len()).into_par_iter().with_min_len(512).map(skinned).collect()
}

fn skinning_weights(avatar: &Avatar, vertices: &[Vec3]) -> Vec<f32> {
    let points: Vec<[f32; 3]> = vertices.iter().map(Vec3::to_array).collect();
    FieldEvaluator::new(&avatar.fields, &avatar.condition().none()).weights(&points)
}

/// The body that an avatar was trained with, in the avatar's canonical pose.
fn own_body(avatar: &Avatar, body: &BodyModel) -> Result<BodyModel> {
    let body = body.in_canonical_pose_of(&avatar.subject.skeleton)?;
    let joints = body.canonical_joints(&avatar.subject.betas)?;
    let distances = joints.iter().zip(&avatar.subject.joints).map(|(body, avatar)| body.distance(*avatar));
    let farthest = distances.fold(0.0, f32::max);
    if farthest < SAME_JOINT {
        return Ok(body);
    }
    Err(Error::from(InputError::Mismatch {
        path: body.path().into(),
        found: format!("a body model whose joints are up to {:.1} mm from the avatar's", 1000.0 * farthest),
        expected: "the model that the avatar was trained with".into(),
        remedy: format!("pass that model, of gender {}, or none", avatar.subject.gender).into(),
    }))
}
