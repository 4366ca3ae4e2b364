//! Batches of poses to bodies, and exact derivatives back: what fitting, registration and learned bodies stand on.
//!
//! With c the coefficients, R_j the joints' rotations and f the correctives' features (METHOD-BODY section 0):
//!
//! T = template + shapes c + correctives f,   J = joints(c),   G_j = G_parent R_j,   p_j = p_parent + G_parent (J_j - J_parent),
//! v = sum_j w_vj (G_j T_v + p_j - G_j J_j) + translation.
//!
//! [`BodyModel::pose_batch`] computes v and p; [`PosedBatch::pullback`] takes cotangents of both back to rotations, coefficients and
//! translation. By hand, in f32 or f64; blocks of vertices in parallel, sums in a fixed order: a result does not depend on
//! threads. B frames, V vertices, J joints, K = S + E coefficients, F features; metres, radians.

mod chain;
mod constrained;
mod rotation;
mod surface;

use xavatar_formats::{Error, Result};
use xavatar_vector::Scalar;

pub(super) use self::chain::features;
pub use self::constrained::{ConstrainedBatch, HingeConvention, JointConstraints, JointFreedom, Limits};

use self::chain::Chain;
use self::rotation::Matrix3;
use self::surface::Surface;
use super::{BodyModel, Pose};

/// The poses of B frames as numbers; also their cotangents, which have the same form.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseBatch<T> {
    /// Axis-angle of each joint of each frame (B, J), absolute, radians.
    pub rotations: Vec<[T; 3]>,
    /// Shape, then expression coefficients (B, K).
    pub coefficients: Vec<T>,
    /// Added to every vertex and joint (B), metres.
    pub translations: Vec<[T; 3]>,
}

/// The bodies of B frames.
#[derive(Clone, Debug)]
pub struct PosedBatch<T> {
    /// Vertices (B, V), metres. May be taken out: nothing here reads them.
    pub vertices: Vec<[T; 3]>,
    /// Joints (B, J), metres. May be taken out as well.
    pub joints: Vec<[T; 3]>,
    /// The vertices before they are skinned (B, V).
    rest_vertices: Vec<[T; 3]>,
    /// Of each frame (B).
    chains: Vec<Chain<T>>,
}

impl<T: Scalar> PoseBatch<T> {
    /// Poses of `model` as a batch; coefficients that they leave out are zero.
    ///
    /// # Errors
    /// [`Error::Value`] if a pose is not of the model's skeleton, has more coefficients than the model, or is not finite.
    pub fn of<'a>(model: &BodyModel, poses: impl IntoIterator<Item = &'a Pose>) -> Result<Self> {
        let mut batch = Self { rotations: Vec::new(), coefficients: Vec::new(), translations: Vec::new() };
        let wide = |values: [f32; 3]| values.map(|value| T::of(f64::from(value)));
        for pose in poses {
            model.check(pose)?;
            batch.rotations.extend(pose.rotations.iter().map(|rotation| wide(rotation.0.to_array())));
            batch
                .coefficients
                .extend(model.coefficients(&pose.shape, &pose.expression).into_iter().map(|c| T::of(c.into())));
            batch.translations.push(wide(pose.translation.to_array()));
        }
        Ok(batch)
    }

    /// B.
    pub fn frames(&self) -> usize {
        self.translations.len()
    }

    fn check(&self, model: &BodyModel) -> Result<()> {
        let (frames, joints) = (self.frames(), model.skeleton().joints.len());
        let coefficients = model.shape_coefficients() + model.expression_coefficients();
        require_length("rotations", self.rotations.len(), frames * joints)?;
        require_length("coefficients", self.coefficients.len(), frames * coefficients)
    }
}

impl BodyModel {
    /// The bodies of a batch of poses.
    ///
    /// # Errors
    /// [`Error::Value`] if the batch's arrays do not fit the model. Numbers that are not finite are passed on.
    pub fn pose_batch<T: Scalar>(&self, batch: &PoseBatch<T>) -> Result<PosedBatch<T>> {
        batch.check(self)?;
        Ok(self.posed(Chain::of_batch(self, batch), batch))
    }

    /// The bodies of these chains, whose rotations may be others than the batch's.
    fn posed<T: Scalar>(&self, chains: Vec<Chain<T>>, batch: &PoseBatch<T>) -> PosedBatch<T> {
        let (vertices, rest_vertices) = Surface::new(self, batch).skinned(&chains, batch);
        let joints = chains
            .iter()
            .zip(&batch.translations)
            .flat_map(|(chain, translation)| chain.joints(*translation))
            .collect();
        PosedBatch { vertices, joints, rest_vertices, chains }
    }
}

impl<T: Scalar> PosedBatch<T> {
    /// How a joint is turned in the world, row by row.
    pub(super) fn turn_of(&self, frame: usize, joint: usize) -> [T; 9] {
        self.chains[frame].turns[joint]
    }

    /// Where a joint is at rest.
    pub(super) fn rest_joint(&self, frame: usize, joint: usize) -> [T; 3] {
        self.chains[frame].rest[joint]
    }

    /// The cotangents of the poses, given those of `vertices` (B, V) and `joints` (B, J): the gradient of any function of the bodies,
    /// given its gradient in their vertices and joints. `model` and `batch` are those that made the bodies.
    ///
    /// # Errors
    /// [`Error::Value`] if an array has another length.
    pub fn pullback(
        &self,
        model: &BodyModel,
        batch: &PoseBatch<T>,
        vertices: &[[T; 3]],
        joints: &[[T; 3]],
    ) -> Result<PoseBatch<T>> {
        let frames = self.frame_cotangents(model, batch, vertices, joints)?;
        let mut cotangent = PoseBatch {
            rotations: Vec::with_capacity(batch.rotations.len()),
            coefficients: Vec::with_capacity(batch.coefficients.len()),
            translations: Vec::with_capacity(frames.len()),
        };
        for (frame, of) in frames.into_iter().enumerate() {
            let axis_angles = batch.frame_rotations(frame);
            let rotations = self.chains[frame].axis_angle_pullback(model, axis_angles, of.rotations, &of.features);
            cotangent.rotations.extend(rotations);
            cotangent.coefficients.extend(of.coefficients);
            cotangent.translations.push(of.translation);
        }
        Ok(cotangent)
    }

    /// The cotangents of what each frame's chain was made of (B), given those of `vertices` (B, V) and `joints` (B, J).
    fn frame_cotangents(
        &self,
        model: &BodyModel,
        batch: &PoseBatch<T>,
        vertices: &[[T; 3]],
        joints: &[[T; 3]],
    ) -> Result<Vec<FrameCotangents<T>>> {
        batch.check(model)?;
        require_length("cotangents of vertices", vertices.len(), self.rest_vertices.len())?;
        require_length("cotangents of joints", joints.len(), batch.rotations.len())?;
        let surface = Surface::new(model, batch);
        let (bones, drives) = surface.pullback(&self.chains, &self.rest_vertices, vertices);
        let frames = batch.frames();
        let (vertex_count, joint_count) = (vertices.len() / frames.max(1), joints.len() / frames.max(1));
        let of_frame = |(frame, chain): (usize, &Chain<T>)| {
            let of_vertices = &vertices[frame * vertex_count..(frame + 1) * vertex_count];
            let of_joints = &joints[frame * joint_count..(frame + 1) * joint_count];
            let (rotations, rest_joints) = chain.pullback(model, &bones[frame], of_joints);
            FrameCotangents {
                rotations,
                features: surface.feature_cotangents(&drives, frame).to_vec(),
                coefficients: surface.coefficient_cotangents(&drives, frame, &rest_joints),
                translation: sum(of_vertices.iter().chain(of_joints)),
            }
        };
        Ok(self.chains.iter().enumerate().map(of_frame).collect())
    }
}

/// Cotangents of what a frame is made of.
struct FrameCotangents<T> {
    /// Of the joints' matrices (J).
    rotations: Vec<Matrix3<T>>,
    /// Of the correctives' features (F).
    features: Vec<T>,
    /// (K).
    coefficients: Vec<T>,
    translation: [T; 3],
}

impl<T: Scalar> PoseBatch<T> {
    fn frame_rotations(&self, frame: usize) -> &[[T; 3]] {
        let joints = self.rotations.len() / self.frames().max(1);
        &self.rotations[frame * joints..(frame + 1) * joints]
    }

    fn frame_coefficients(&self, frame: usize) -> &[T] {
        let count = self.coefficients.len() / self.frames().max(1);
        &self.coefficients[frame * count..(frame + 1) * count]
    }
}

fn require_length(name: &str, found: usize, expected: usize) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    Err(Error::Value { name: name.into(), found: found.to_string(), expected: expected.to_string() })
}

fn sum<'a, T: Scalar>(vectors: impl Iterator<Item = &'a [T; 3]>) -> [T; 3] {
    vectors.fold([T::zero(); 3], |sum, vector| [0, 1, 2].map(|axis| sum[axis] + vector[axis]))
}

fn add<T: Scalar>(sum: &mut [T], values: &[T]) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += *value);
}
