//! A mesh, the skeleton that moves it, the shapes that change it, and a clip that does both: arrays, no formats.

use glam::{Affine3A, Quat, Vec3};
use rayon::prelude::*;

use crate::mesh::TriangleMesh;

/// A skinned mesh with morph targets and an animation clip. V vertices, J joints, K influences a vertex, M morphs, T frames;
/// metres, Y up, facing +Z.
///
/// A vertex p in frame t is drawn at
///
/// ```text
/// q     = p + sum_m a_tm d_m                                the morphs, weights a_tm = animation.morph_weights[t * M + m]
/// G_j   = G_parent(j) [c_j R_tj | l_j],  G_0 = [R_t0 | s_t] R: animation.rotations[t], l_j, c_j: joints[j].translation, .scale
///                                                           s: animation.root_translations[t]
/// x     = sum_k w_k (G_b(k) joints[b(k)].inverse_bind) q    b: skin_joints, w: skin_weights of the vertex
/// ```
///
/// with [R | l] the rotation R followed by the translation l. [`posed`](Self::posed) does this. Normals turn with the blended
/// matrix of their vertex; morphs leave them as they are. R_tj are the skeleton's own rotations, so any of its poses drives the rig.
#[derive(Clone, Debug)]
pub struct RiggedMesh {
    /// The mesh in its bind pose, the avatar's canonical pose: vertices (V), faces, normals and colours.
    pub mesh: TriangleMesh,
    /// The skeleton (J), parents before their children.
    pub joints: Vec<Joint>,
    /// The names of the body's parts, for people.
    pub parts: Vec<String>,
    /// K.
    pub influences: usize,
    /// The joints that hold each vertex (V, K), the strongest first; 0 where the weight is 0.
    pub skin_joints: Vec<u8>,
    /// How strongly (V, K); each row sums to 1.
    pub skin_weights: Vec<f32>,
    /// Morph targets (M): expressions first, then the clip's correctives, then facial actions.
    pub morphs: Vec<Morph>,
    /// The animation.
    pub animation: Animation,
    /// The name of a node at the origin above the skeleton, for programs that move the figure by it.
    pub root: Option<String>,
}

/// A joint of the skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// The skeleton's name for it.
    pub name: String,
    /// The part of the body that it moves: a place in [`RiggedMesh::parts`].
    pub part: usize,
    /// The joint it hangs on; none for the root, which is the first.
    pub parent: Option<usize>,
    /// Where it is in its parent's frame (the root: in the world), metres; the same in every pose.
    pub translation: Vec3,
    /// How large what follows it is beside what follows its parent; 1 but for bodies whose bones have sizes of their own.
    pub scale: f32,
    /// Its local rotation in the bind pose.
    pub rotation: Quat,
    /// World -> joint in the bind pose.
    pub inverse_bind: Affine3A,
}

/// A shape that is added to the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Morph {
    /// `expression_0` and on for the body model's expression coefficients, `corrective_0` and on for the clip's; facial actions by ARKit's names.
    pub name: String,
    /// What a weight of 1 adds to each vertex in the bind pose (V), metres.
    pub offsets: Vec<Vec3>,
}

/// An animation of the skeleton and the morphs.
#[derive(Clone, Debug, PartialEq)]
pub struct Animation {
    /// What it is called.
    pub name: String,
    /// How fast the frames follow each other.
    pub frames_per_second: f32,
    /// Local rotations of the joints (T), unit quaternions; consecutive ones are on one side, so that blending goes the short way.
    pub rotations: Vec<Vec<Quat>>,
    /// Translation of the root (T), metres; takes the place of its `Joint::translation`.
    pub root_translations: Vec<Vec3>,
    /// Weights of the morphs (T, M).
    pub morph_weights: Vec<f32>,
}

impl Morph {
    /// Whether it is that of an expression coefficient.
    #[must_use]
    pub fn is_expression(&self) -> bool {
        self.name.starts_with("expression_")
    }
}

impl Animation {
    /// T.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.rotations.len()
    }
}

impl RiggedMesh {
    /// What moves vertices in a frame of the clip (J): G_j InvBind_j.
    ///
    /// # Panics
    /// If the clip has no such frame.
    #[must_use]
    pub fn skinning_transforms(&self, frame: usize) -> Vec<Affine3A> {
        skinning_transforms(&self.joints, &self.animation.rotations[frame], self.animation.root_translations[frame])
    }

    /// The vertices (V) in a frame of the clip.
    ///
    /// # Panics
    /// If the clip has no such frame.
    #[must_use]
    pub fn posed(&self, frame: usize) -> Vec<Vec3> {
        let transforms = self.skinning_transforms(frame);
        let weights = &self.animation.morph_weights[frame * self.morphs.len()..][..self.morphs.len()];
        let mut vertices = self.mesh.vertices.clone();
        morph(&mut vertices, &self.morphs, weights);
        let rows = self.skin_joints.par_chunks(self.influences).zip(self.skin_weights.par_chunks(self.influences));
        vertices.par_iter_mut().zip(rows).for_each(|(vertex, (joints, weights))| {
            *vertex = blend(&transforms, joints, weights).transform_point3(*vertex)
        });
        vertices
    }
}

/// G_j InvBind_j (J) of a pose.
pub(super) fn skinning_transforms(joints: &[Joint], rotations: &[Quat], root: Vec3) -> Vec<Affine3A> {
    let mut placed: Vec<Affine3A> = Vec::with_capacity(joints.len());
    for (joint, rotation) in joints.iter().zip(rotations) {
        placed.push(match joint.parent {
            None => sized(joint, *rotation, root),
            Some(parent) => placed[parent] * sized(joint, *rotation, joint.translation),
        });
    }
    placed.iter().zip(joints).map(|(placed, joint)| *placed * joint.inverse_bind).collect()
}

fn sized(joint: &Joint, rotation: Quat, place: Vec3) -> Affine3A {
    Affine3A::from_scale_rotation_translation(Vec3::splat(joint.scale), rotation, place)
}

/// Adds the `morphs` (M), each times its weight, to `vertices` (V).
pub(super) fn morph(vertices: &mut [Vec3], morphs: &[Morph], weights: &[f32]) {
    for (morph, weight) in morphs.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
        vertices
            .par_iter_mut()
            .zip(&morph.offsets)
            .with_min_len(4096)
            .for_each(|(vertex, offset)| *vertex += *offset * *weight);
    }
}

/// The mean of transforms by a vertex's weights.
pub(super) fn blend(transforms: &[Affine3A], joints: &[u8], weights: &[f32]) -> Affine3A {
    let mut sum = Affine3A::ZERO;
    for (joint, weight) in joints.iter().zip(weights) {
        let transform = &transforms[usize::from(*joint)];
        sum.matrix3 += transform.matrix3 * *weight;
        sum.translation += transform.translation * *weight;
    }
    sum
}
