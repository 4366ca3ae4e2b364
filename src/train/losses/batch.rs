//! What one frame's losses are computed from: points, known in canonical space, and what is wanted there. J bones; metres.

use xavatar_deformer::BoneTransform;

/// What one frame's losses are computed from, in canonical space.
#[derive(Clone, Debug, Default)]
pub struct CanonicalBatch<T> {
    /// c = [theta_b / pi, psi].
    pub condition: Vec<T>,
    /// Bone transforms, canonical to posed (J).
    pub bones: Vec<BoneTransform<T>>,
    /// P_off: canonical points.
    pub off_points: Vec<[T; 3]>,
    /// Of each: 1 inside and 0 outside for occupancy; else the signed distance, metres.
    pub off_targets: Vec<T>,
    /// P_on: canonical points.
    pub on_points: Vec<[T; 3]>,
    /// Of each: the unit normal of the deformed surface.
    pub on_normals: Vec<[T; 3]>,
    /// Of each: the colour in [0, 1].
    pub on_colours: Vec<[T; 3]>,
    /// Canonical points that no frame shows.
    pub anchors: Anchors<T>,
    /// Whether the off-surface cotangents reach the skinning field.
    pub implicit_gradient: bool,
}

/// What holds the fields where no frame does: points that are drawn in canonical space.
#[derive(Clone, Debug, Default)]
pub struct Anchors<T> {
    /// Points that are far from the surface whatever the frame, on a side that is known.
    pub far_points: Vec<[T; 3]>,
    /// Of each: what `off_targets` holds.
    pub far_targets: Vec<T>,
    /// Points on bones, all inside.
    pub bone_points: Vec<[T; 3]>,
    /// Joints, and the weights they should have.
    pub joint_weights: WeightTargets<T>,
    /// Vertices of hands and face, and the weights they should have.
    pub surface_weights: WeightTargets<T>,
    /// Points around and inside the body, and the weights of the nearest place on its surface.
    pub volume_weights: WeightTargets<T>,
    /// Points where the field should be a distance.
    pub eikonal_points: Vec<[T; 3]>,
}

/// Canonical points and the skinning weights they should have.
#[derive(Clone, Debug, Default)]
pub struct WeightTargets<T> {
    /// Canonical points (N).
    pub points: Vec<[T; 3]>,
    /// Weights (N, J).
    pub weights: Vec<T>,
}
