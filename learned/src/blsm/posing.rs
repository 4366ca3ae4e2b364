//! Poses of other bodies on a BLSM body: the same angles, other bones (METHOD-BODY 9.5).

use glam::DMat3;
use xavatar_body::Pose;
use xavatar_register::linear::so3;

use super::{BlsmBody, BlsmParameters};

impl BlsmBody {
    /// The parameters of a pose of a skeleton with the same joints, on these bones and this shape, and the largest angle that the atoms cannot turn,
    /// radians.
    pub fn in_pose(&self, pose: &Pose, bones: &[f64], shape: &[f64]) -> (BlsmParameters, f64) {
        let turns = pose.rotations.iter().map(|rotation| so3::exp(rotation.0.as_dvec3()));
        let rotations: Vec<DMat3> = turns.collect();
        let (atoms, cut) = self.atoms.of_rotations(&rotations);
        let turn = rotations.first().copied().unwrap_or(DMat3::IDENTITY);
        let translation = pose.translation.as_dvec3();
        (BlsmParameters { turn, translation, atoms, bones: bones.to_vec(), shape: shape.to_vec() }, cut)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::blsm::Atoms;
    use crate::blsm::derivatives::tests::reference_body;
    use xavatar_body::{PoseAxisAngle, smpl};

    #[test]
    fn a_pose_keeps_its_angles_on_other_bones() {
        let (mut body, _) = reference_body();
        body.names = smpl::skeleton().joints.clone();
        body.atoms = Atoms::of(&body.names);
        let knee = 4;
        let mut rotations = vec![PoseAxisAngle::default(); 24];
        rotations[0].0.y = 0.7;
        rotations[knee].0.x = 0.9;
        let pose = Pose { rotations, translation: glam::Vec3::new(1.0, 2.0, 3.0), ..Pose::default() };
        let (parameters, cut) = body.in_pose(&pose, &[1.0, 0.0, 0.0], &[0.0; 6]);
        assert!(cut < 1e-6, "{cut}");
        let skeleton = body.posed(&parameters).skeleton;
        let turned = skeleton.turns[1].transpose() * skeleton.turns[knee];
        assert!(so3::log(&turned).distance(DVec3::new(0.9, 0.0, 0.0)) < 1e-3);
        assert!(skeleton.places[0].distance(DVec3::new(1.0, 2.0, 3.0) + body.skeleton.offsets[0]) < 1e-6);
        let mut forward = pose;
        forward.rotations[knee].0.x = -0.9;
        let (_, cut) = body.in_pose(&forward, &[0.0; 3], &[0.0; 6]);
        assert!((cut - 0.9).abs() < 1e-6, "a knee does not bend forward: {cut}");
    }
}
