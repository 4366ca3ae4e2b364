//! The skinning of a block of points, forward and back: weights, blended transforms and Jacobians.
//!
//! A(x) = sum_j w_j(x) B_j, J = d(A(x) x~)/dx. Back to a network's parameters: cotangents of its weights, of J (normals), and of roots x_c,
//! which move with the weights at a fixed x_d: -J^-T x_c_bar on d_w (thesis ch. 4.2.3). To a grid's, the roots alone.
//! N points, J joints; metres.

use xavatar_deformer::{
    BoneTransform, Jacobian, blend_transforms, deform_backward, jacobians_backward, root_cotangents, skinning_jacobians,
};
use xavatar_network::{Backward, Real, SkinningTrace};

use super::{Kind, Skinning, SkinningGradient};
use crate::Result;

/// One thread's memory while it skins blocks of points.
#[derive(Debug)]
pub struct Blend<T> {
    trace: SkinningTrace<T>,
    weights: Vec<T>,
    /// Derivatives of the weights along x, y and z (N, 3, J).
    slopes: Vec<T>,
    transforms: Vec<BoneTransform<T>>,
    jacobians: Vec<Jacobian<T>>,
    weight_cotangents: Vec<T>,
    slope_cotangents: Vec<T>,
    image_cotangents: Vec<[T; 3]>,
    point_cotangents: Vec<[T; 3]>,
}

impl<T: Real> Default for Blend<T> {
    fn default() -> Self {
        Self {
            trace: SkinningTrace::default(),
            weights: Vec::new(),
            slopes: Vec::new(),
            transforms: Vec::new(),
            jacobians: Vec::new(),
            weight_cotangents: Vec::new(),
            slope_cotangents: Vec::new(),
            image_cotangents: Vec::new(),
            point_cotangents: Vec::new(),
        }
    }
}

impl<T> Blend<T> {
    /// The Jacobians of the block that was skinned last (N).
    pub fn jacobians(&self) -> &[Jacobian<T>] {
        &self.jacobians
    }
}

impl<T: Real> Skinning<T> {
    /// Skins a block of points (N): weights, their slopes, blended transforms and Jacobians.
    ///
    /// # Errors
    /// If there is not one bone transform per joint.
    pub fn blend(&self, blend: &mut Blend<T>, bones: &[BoneTransform<T>], points: &[[T; 3]]) -> Result<()> {
        let Blend { trace, weights, slopes, transforms, jacobians, .. } = blend;
        weights.resize(points.len() * bones.len(), T::zero());
        slopes.resize(3 * points.len() * bones.len(), T::zero());
        transforms.resize(points.len(), [T::zero(); 12]);
        jacobians.resize(points.len(), [[T::zero(); 3]; 3]);
        self.weights_and_gradients(trace, points, weights, slopes);
        blend_transforms(weights, bones, transforms)?;
        skinning_jacobians(transforms, slopes, bones, points, jacobians)?;
        Ok(())
    }

    /// The weights (N, J) of a block of points, for [`Skinning::weights_backward`]; none where the field does not follow weights.
    pub fn followed_weights<'b>(&self, blend: &'b mut Blend<T>, points: &[[T; 3]]) -> Option<&'b [T]> {
        let Kind::Network(field) = &self.kind else { return None };
        blend.weights.resize(points.len() * self.joints(), T::zero());
        field.forward(&mut blend.trace, points, &mut blend.weights);
        Some(&blend.weights)
    }

    /// Adds what cotangents of the block's [`Skinning::followed_weights`] (N, J) pull back to.
    pub fn weights_backward(&self, blend: &mut Blend<T>, cotangents: &[T], gradient: &mut SkinningGradient<T>) {
        if let (Kind::Network(field), SkinningGradient::Network(gradient)) = (&self.kind, gradient) {
            field.backward(&mut blend.trace, cotangents, None, Backward::Parameters, gradient);
        }
    }

    /// Adds what cotangents of the Jacobians (N) of the block that [`Skinning::blend`] skinned last pull back to; nothing on a grid.
    ///
    /// # Errors
    /// If the arrays disagree about the block.
    pub fn jacobians_backward(
        &self,
        blend: &mut Blend<T>,
        bones: &[BoneTransform<T>],
        points: &[[T; 3]],
        cotangents: &[Jacobian<T>],
        gradient: &mut SkinningGradient<T>,
    ) -> Result<()> {
        let (Kind::Network(field), SkinningGradient::Network(gradient)) = (&self.kind, gradient) else { return Ok(()) };
        let Blend { trace, slopes, weight_cotangents, slope_cotangents, point_cotangents, .. } = blend;
        clear(weight_cotangents, points.len() * bones.len(), T::zero());
        clear(slope_cotangents, 3 * points.len() * bones.len(), T::zero());
        clear(point_cotangents, points.len(), [T::zero(); 3]);
        jacobians_backward(slopes, bones, points, cotangents, weight_cotangents, slope_cotangents, point_cotangents)?;
        field.backward(trace, weight_cotangents, Some(slope_cotangents), Backward::Parameters, gradient);
        Ok(())
    }

    /// Adds what cotangents of roots x_c (N) pull back to, of which the first is root number `first` of its frame. Those of a grid are
    /// kept for [`Skinning::pull_back_roots`], which has the frame's warp.
    ///
    /// # Errors
    /// As [`Skinning::blend`].
    pub fn roots_backward(
        &self,
        blend: &mut Blend<T>,
        bones: &[BoneTransform<T>],
        (first, roots): (usize, &[[T; 3]]),
        cotangents: &[[T; 3]],
        gradient: &mut SkinningGradient<T>,
    ) -> Result<()> {
        match (&self.kind, gradient) {
            (Kind::Network(field), SkinningGradient::Network(gradient)) => {
                self.blend(blend, bones, roots)?;
                let Blend {
                    trace, transforms, jacobians, weight_cotangents, image_cotangents, point_cotangents, ..
                } = blend;
                clear(image_cotangents, roots.len(), [T::zero(); 3]);
                root_cotangents(jacobians, cotangents, image_cotangents)?;
                clear(weight_cotangents, roots.len() * bones.len(), T::zero());
                clear(point_cotangents, roots.len(), [T::zero(); 3]);
                deform_backward(transforms, bones, roots, image_cotangents, weight_cotangents, point_cotangents)?;
                field.backward(trace, weight_cotangents, None, Backward::Parameters, gradient);
            }
            (Kind::Grid(_), SkinningGradient::Grid { roots }) => roots.push((first, cotangents.to_vec())),
            _ => {}
        }
        Ok(())
    }
}

/// `length` times `value`, in memory that is kept.
fn clear<V: Copy>(values: &mut Vec<V>, length: usize, value: V) {
    values.clear();
    values.resize(length, value);
}
