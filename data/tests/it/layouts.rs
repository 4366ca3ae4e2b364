//! Files of body parameters made in tests: poses told apart by a number, and what must come out of them.

use std::path::Path;

use glam::{Quat, Vec3};
use serde_json::{Value, json};
use xavatar_body::smplx;
use xavatar_data::{Clip, Motion, read_motion};

use crate::clip;
use crate::kinematics::{name, of_parameters};

/// SMPL's pelvis at rest, as the reader knows it.
pub const SMPL_PELVIS: Vec3 = Vec3::new(0.0, -0.23, 0.028);

/// That every joint is turned as the reference's, to a tenth of a degree.
pub fn assert_is_reference(found: &Clip, what: &str) {
    let expected = clip("reference.npz");
    assert_eq!(found.frames.len(), expected.frames.len(), "{what}");
    for (index, (found, expected)) in found.frames.iter().zip(&expected.frames).enumerate() {
        let (turns, wanted) = (of_parameters(found), of_parameters(expected));
        for joint in 0..turns.len() {
            let off = turns[joint].angle_between(wanted[joint]).to_degrees();
            assert!(off < 0.1, "{what}, frame {index}, {}: {off:.2} degrees off", name(joint));
        }
    }
}

/// Whether a line has these words.
pub fn says(lines: &[impl ToString], words: &str) -> bool {
    lines.iter().any(|line| line.to_string().contains(words))
}

/// What is read of a file of this name and content.
pub fn saved<T>(name: &str, bytes: &[u8], read: impl Fn(&Path) -> T) -> T {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path)
}

/// A file of nested dicts and lists, as pickles have them, in JSON.
pub fn nested(value: &Value) -> xavatar_formats::Result<Motion> {
    saved("motion.json", value.to_string().as_bytes(), |path| read_motion(path))
}

/// A pose of `joints` joints with the root, told apart by `seed`.
pub fn pose(seed: usize, joints: usize) -> Vec<f32> {
    (0..3 * joints).map(|place| ((seed * 165 + place) % 97) as f32 / 100.0 - 0.48).collect()
}

/// The rotation of a joint in a pose.
pub fn vector(numbers: &[f32], joint: usize) -> Vec3 {
    Vec3::from_slice(&numbers[3 * joint..])
}

/// A rotation as a matrix, row by row.
pub fn matrix(vector: Vec3) -> Value {
    let turn = glam::Mat3::from_quat(Quat::from_scaled_axis(vector)).transpose();
    json!([turn.x_axis.to_array(), turn.y_axis.to_array(), turn.z_axis.to_array()])
}

/// That a frame's body is the pose's.
pub fn assert_body(frame: &smplx::Parameters, pose: &[f32], root: Vec3) {
    assert!((frame.global_orient.0 - root).length() < 1e-5, "{:?}", frame.global_orient);
    for joint in 1..22 {
        assert!((frame.body_pose[joint - 1].0 - vector(pose, joint)).length() < 1e-5, "{}", name(joint));
    }
}
