//! Avatar files of version 2, which knew no skeleton but SMPL-X's, and the meshes that the program of their time made of them.

use std::path::PathBuf;

use glam::Vec3;
use xavatar::avatar::Avatar;
use xavatar::body::smplx::{self, joint};
use xavatar::body::{HandPose, PoseAxisAngle};
use xavatar::mesh::{TriangleMesh, read_mesh};
use xavatar::synthetic::BuiltInSubject;

fn file(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "fixtures", "avatars", name].iter().collect()
}

fn assert_same(found: &TriangleMesh, name: &str) {
    let expected = read_mesh(file(name)).unwrap().mesh;
    assert_eq!(found.faces, expected.faces, "{name}");
    for (found, expected) in found.vertices.iter().zip(&expected.vertices) {
        assert!(found.distance(*expected) < 1e-5, "{name}: {found}, was {expected}");
    }
}

#[test]
fn version_2_gives_the_meshes_that_it_gave() {
    let avatar = Avatar::load(&file("version_2.safetensors")).unwrap();
    assert_eq!(&avatar.subject.skeleton, smplx::skeleton());
    let canonical = avatar.subject.skeleton.canonical_pose(&avatar.subject.betas);
    assert_same(&avatar.extract_canonical(&canonical, 32).unwrap().mesh, "version_2_canonical.ply");

    let mut pose = smplx::Parameters { transl: Vec3::new(0.1, 1.0, -0.2), ..smplx::Parameters::default() };
    let mut turn = |joint: usize, turn: Vec3| pose.body_pose[joint - 1] = PoseAxisAngle(turn);
    turn(joint::LEFT_KNEE, Vec3::X * 0.8);
    turn(joint::LEFT_SHOULDER, Vec3::Z * -0.6);
    turn(joint::RIGHT_ELBOW, Vec3::Y * 0.5);
    let mut fingers = [PoseAxisAngle::default(); joint::HAND];
    fingers[0] = PoseAxisAngle(Vec3::Z * -0.7);
    pose.left_hand_pose = HandPose::Flat(fingers);
    pose.global_orient = PoseAxisAngle(Vec3::Y * 0.4);
    pose.jaw_pose = PoseAxisAngle(Vec3::X * 0.2);
    pose.expression = vec![0.5];
    let subject = BuiltInSubject::new().unwrap();
    let pose = subject.model().resolve(&pose.into()).unwrap();
    let posed = avatar.extract_posed(subject.model(), subject.part_labels(), &pose, 40).unwrap();
    assert_same(&posed.mesh, "version_2_posed.ply");
}

// Fields that are networks are told the pose: what they are told has the width that it had.
#[test]
fn version_2_of_networks_is_the_same_avatar_in_a_new_file() {
    let old = Avatar::load(&file("version_2_networks.safetensors")).unwrap();
    assert_eq!(old.condition().width(), 73);
    let folder = tempfile::tempdir().unwrap();
    let new = folder.path().join("avatar.safetensors");
    old.save(&new).unwrap();
    let new = Avatar::load(&new).unwrap();
    assert_eq!(new.subject, old.subject);
    assert_eq!(new.fields.geometry.mlp.parameters(), old.fields.geometry.mlp.parameters());
}
