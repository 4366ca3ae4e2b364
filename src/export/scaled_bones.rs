//! A BLSM body, whose bones have sizes of their own, as plain nodes with scales (METHOD-BODY 9.1).
//!
//! Node j has the scale a_j / a_p and the translation O_j b_j / a_p, with b_j the scale of the bone that ends at j, a_j that of what follows j, p the
//! parent: its place in the world is then [a_j M_j | P_j]. The mesh is bound at rest with bones of scale 1.

use glam::{Affine3A, Quat, Vec3};

use super::influences::Influences;
use super::rig::{Animation, Joint, RiggedMesh};
use crate::learned::blsm::{BlsmBody, BlsmParameters};
use crate::mesh::TriangleMesh;

/// Joints that hold a vertex: a trained body has no more.
const INFLUENCES: usize = 8;

impl RiggedMesh {
    /// A body that goes through frames (T), with the bones and the shape of the first; at rest without frames.
    #[must_use]
    pub fn of_scaled_bones(body: &BlsmBody, frames: &[BlsmParameters], frames_per_second: f32) -> Self {
        let rest = body.rest();
        let person = frames.first().unwrap_or(&rest);
        let scales = body.scales(&person.bones);
        let skeleton = &body.skeleton;
        let size = |joint: usize| scales[skeleton.matter[joint]];
        let joint = |(index, place): (usize, glam::DVec3)| {
            let parent = skeleton.parents[index];
            let above = parent.map_or(1.0, size);
            // The root's bone, from the origin, has the scale 1.
            let length = if parent.is_some() { scales[index] } else { 1.0 };
            Joint {
                name: body.names[index].clone(),
                part: 0,
                parent,
                translation: (skeleton.offsets[index] * (length / above)).as_vec3(),
                scale: (size(index) / above) as f32,
                rotation: Quat::IDENTITY,
                inverse_bind: Affine3A::from_translation(-place.as_vec3()),
            }
        };
        let joints = skeleton.rest().into_iter().enumerate().map(joint).collect();
        let width = body.names.len();
        let mut weights = vec![0.0; body.weights.len() * width];
        for (row, own) in weights.chunks_exact_mut(width).zip(&body.weights) {
            own.iter().for_each(|(joint, weight)| row[*joint] = *weight as f32);
        }
        let influences = Influences::strongest(&weights, width, INFLUENCES);
        let vertices = body.shaped(person).iter().map(|place| place.as_vec3()).collect();
        let mut animation = Animation::new(frames_per_second);
        for frame in if frames.is_empty() { std::slice::from_ref(&rest) } else { frames } {
            let mut rotations = body.atoms.rotations(&body.atoms.angles(&frame.atoms));
            rotations.iter_mut().take(1).for_each(|root| *root = frame.turn * *root);
            let before: Option<Vec<Quat>> = animation.rotations.last().cloned();
            let turned = |(index, rotation): (usize, &glam::DMat3)| {
                let turn = glam::DQuat::from_mat3(rotation).as_quat().normalize();
                // On the side of the frame before, so that blending goes the short way.
                let is_near = before.as_ref().is_none_or(|before| before[index].dot(turn) >= 0.0);
                if is_near { turn } else { -turn }
            };
            animation.rotations.push(rotations.iter().enumerate().map(turned).collect());
            let root: Vec3 = (frame.translation + skeleton.offsets.first().copied().unwrap_or_default()).as_vec3();
            animation.root_translations.push(root);
        }
        Self {
            mesh: TriangleMesh { vertices, faces: body.faces.clone(), ..TriangleMesh::default() },
            joints,
            parts: vec!["body".into()],
            influences: INFLUENCES,
            skin_joints: influences.joints,
            skin_weights: influences.weights,
            morphs: Vec::new(),
            animation,
            root: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learned::blsm::BlsmPopulation;
    use crate::synthetic::BuiltInSubject;

    #[test]
    fn nodes_with_scales_move_the_body_as_it_moves_itself() {
        let subject = BuiltInSubject::new().unwrap();
        let population = BlsmPopulation { subjects: 1, poses: 4, noise: 0.0, seed: 4 };
        let body = population.body(subject.model());
        let frames: Vec<BlsmParameters> = (0..4).map(|frame| population.parameters(&body, 0, frame)).collect();
        let rigged = RiggedMesh::of_scaled_bones(&body, &frames, 30.0);
        assert!(rigged.joints.iter().any(|joint| (joint.scale - 1.0).abs() > 0.01));
        for (index, frame) in frames.iter().enumerate() {
            let expected = body.posed(frame).vertices;
            let found = rigged.posed(index);
            let distances = found.iter().zip(expected).map(|(found, expected)| found.as_dvec3().distance(expected));
            let farthest = distances.fold(0.0, f64::max);
            assert!(farthest < 1e-5, "{index}: {farthest}");
        }
        let still = RiggedMesh::of_scaled_bones(&body, &[], 30.0);
        assert!(still.posed(0)[0].as_dvec3().distance(body.posed(&body.rest()).vertices[0]) < 1e-5);
    }
}
