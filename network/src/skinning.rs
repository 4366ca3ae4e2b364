//! Skinning weights as a field over canonical space.

use crate::Real;

/// Anything that gives every canonical point a convex combination of J bones. N points, J joints.
///
/// Implementations are shared between threads; each thread brings its own workspace.
pub trait SkinningWeights<T: Real>: Sync {
    /// Scratch memory of one thread, kept between calls so that none of them allocates.
    type Workspace: Default + Send;

    /// J.
    fn joints(&self) -> usize;

    /// Writes the weights w(x) of each point, (N, J).
    fn weights(&self, workspace: &mut Self::Workspace, points: &[[T; 3]], weights: &mut [T]);

    /// Writes the weights (N, J) and their derivatives along x, y and z (N, 3, J).
    fn weights_and_gradients(
        &self,
        workspace: &mut Self::Workspace,
        points: &[[T; 3]],
        weights: &mut [T],
        gradients: &mut [T],
    );
}
