//! One frame's warp d(x_c) = A(x_c) x~: what the search inverts.
//!
//! [`ExactWarp`] asks the field for its weights at every point; [`crate::BakedWarp`] looks A up on a grid. Metres.

mod implicit;
mod normals;
pub(crate) mod skinning;
#[cfg(test)]
pub(crate) mod softmax_field;

pub use implicit::root_cotangents;
pub use normals::{GradientSide, deformed_normals, deformed_normals_backward};
pub use skinning::{blend_transforms, deform, deform_backward, jacobians_backward, skinning_jacobians};

use xavatar_network::{Real, SkinningWeights};

use crate::affine::expect_finite_bones;
use crate::warp::skinning::{blend, blend_jacobians};
use crate::{BoneTransform, Error, Jacobian, Result, StartBoxes};

/// A posed frame as a map of canonical points. N points.
///
/// Shared between threads; each thread brings its own workspace. A point's result depends on that point alone.
pub trait Warp<T: Real>: Sync {
    /// Scratch memory of one thread, kept between calls so that none of them allocates.
    type Workspace: Default + Send;

    /// How many points one call is best given: full matrix products for a network, small enough for the second-level cache.
    const BATCH: usize = 512;

    /// The frame's bone transforms, canonical to posed (J).
    fn bones(&self) -> &[BoneTransform<T>];

    /// Where starts may be of use; none if that is not known.
    fn start_boxes(&self) -> Option<&StartBoxes<'_, T>> {
        None
    }

    /// Whether a root at this point is of interest.
    fn matters(&self, _point: [T; 3]) -> bool {
        true
    }

    /// Writes the blended transform A at each point (N).
    fn transforms(&self, workspace: &mut Self::Workspace, points: &[[T; 3]], transforms: &mut [BoneTransform<T>]);

    /// Writes A (N) and the Jacobian of x -> A(x) x~ (N).
    fn transforms_and_jacobians(
        &self,
        workspace: &mut Self::Workspace,
        points: &[[T; 3]],
        transforms: &mut [BoneTransform<T>],
        jacobians: &mut [Jacobian<T>],
    );
}

/// Linear blend skinning with the weights of a field, evaluated where they are asked for.
#[derive(Debug)]
pub struct ExactWarp<'a, T, S> {
    field: &'a S,
    bones: &'a [BoneTransform<T>],
}

impl<'a, T: Real, S: SkinningWeights<T>> ExactWarp<'a, T, S> {
    /// The warp of one frame.
    ///
    /// # Errors
    /// If the field has not one weight per bone, or a bone transform is not finite.
    pub fn new(field: &'a S, bones: &'a [BoneTransform<T>]) -> Result<Self> {
        expect_finite_bones(bones)?;
        if field.joints() != bones.len() {
            return Err(Error::Skeleton {
                name: "the skinning field's number of joints",
                found: field.joints().to_string(),
                expected: format!("{}, one per bone transform", bones.len()),
            });
        }
        Ok(Self { field, bones })
    }
}

/// Scratch memory of an [`ExactWarp`]: that of its field, the weights (N, J) and their gradients (N, 3, J).
#[derive(Debug, Default)]
pub struct ExactWorkspace<T, F> {
    field: F,
    weights: Vec<T>,
    gradients: Vec<T>,
}

impl<T: Real, S: SkinningWeights<T>> Warp<T> for ExactWarp<'_, T, S> {
    type Workspace = ExactWorkspace<T, S::Workspace>;

    fn bones(&self) -> &[BoneTransform<T>] {
        self.bones
    }

    fn transforms(&self, workspace: &mut Self::Workspace, points: &[[T; 3]], transforms: &mut [BoneTransform<T>]) {
        let weights = first(&mut workspace.weights, points.len() * self.bones.len());
        self.field.weights(&mut workspace.field, points, weights);
        blend(weights, self.bones, transforms);
    }

    fn transforms_and_jacobians(
        &self,
        workspace: &mut Self::Workspace,
        points: &[[T; 3]],
        transforms: &mut [BoneTransform<T>],
        jacobians: &mut [Jacobian<T>],
    ) {
        let joints = self.bones.len();
        let weights = first(&mut workspace.weights, points.len() * joints);
        let gradients = first(&mut workspace.gradients, 3 * points.len() * joints);
        self.field.weights_and_gradients(&mut workspace.field, points, weights, gradients);
        blend(weights, self.bones, transforms);
        blend_jacobians(transforms, gradients, self.bones, points, jacobians);
    }
}

/// The first `length` elements of a buffer that only ever grows.
fn first<T: Real>(buffer: &mut Vec<T>, length: usize) -> &mut [T] {
    if buffer.len() < length {
        buffer.resize(length, T::zero());
    }
    &mut buffer[..length]
}
