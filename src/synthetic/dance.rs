//! The built-in motion: a dance that any avatar can do, so that one moves before its owner has a motion.
//!
//! Every angle is a sum of sines of whole multiples of the loop's phase, so that the last frame runs into the first without
//! a jump of any derivative. Arms, legs, spine, fingers, jaw, gaze and expression all move; the feet stay near the floor,
//! because hips and ankles undo what knees and pelvis do. Radians, metres; Y up, facing +Z, left is +X.

use std::f32::consts::TAU;
use std::path::Path;

use glam::Vec3;

use crate::Result;
use crate::body::smplx;
use crate::body::smplx::joint::{self, sides};
use crate::body::{BodyModel, HandPose, Pose, PoseAxisAngle, Skeleton};
use crate::data::{Clip, Motion, MotionOptions, PosedClip};

/// The name of the dance, where a motion's path is asked for.
pub const DANCE: &str = "dance";

/// Frames of one loop: four beats at 100 a minute.
const FRAMES: usize = 72;
/// Frames a second.
const RATE: f32 = 30.0;

/// From hip to knee, and from knee to ankle, of an adult, metres: how far bent knees lower the pelvis.
const LEG_BONE: f32 = 0.4;
/// How far the pelvis sways to each side, metres.
const SWAY: f32 = 0.05;
/// Between the thigh and the vertical of a stance, radians.
const STANCE: f32 = 0.12;
/// What closes the joints of a left finger, and of the thumb, three quarters of the way to a fist; about z, and about x, y, z.
const FINGER_CURL: [f32; 3] = [-0.95, -1.15, -0.8];
const THUMB_CURL: [f32; 3] = [0.15, 0.4, -0.05];

/// The built-in motion: 2.4 seconds of a dance in which every part of the body moves; the last frame runs into the first.
pub fn dance() -> Clip {
    let frames = frames();
    let report = vec![format!("motion: the built-in dance, {} frames at {RATE} per second", frames.len())];
    Clip { frames, frames_per_second: RATE, report, warnings: Vec::new() }
}

/// Reads a motion of any format ([`read_motion`](crate::data::read_motion)) and applies the options; [`DANCE`] is the built-in one, unless there
/// is such a file.
///
/// # Errors
/// Those of [`Clip::load`].
pub fn load_clip(path: &Path, options: &MotionOptions) -> Result<Clip> {
    if path.as_os_str() != DANCE || path.exists() {
        return Ok(Clip::load(path, options)?);
    }
    let motion = Motion {
        frames: frames(),
        frames_per_second: Some(RATE),
        source: "the built-in dance".into(),
        ..Motion::default()
    };
    Ok(Clip::of(motion, options)?)
}

/// Reads a motion for a skeleton ([`PosedClip::load`]); [`DANCE`] is the built-in one, unless there is such a file.
///
/// # Errors
/// Those of [`PosedClip::load`].
pub fn load_poses(
    path: &Path,
    options: &MotionOptions,
    skeleton: &Skeleton,
    body: Option<&BodyModel>,
) -> Result<PosedClip> {
    if path.as_os_str() != DANCE || path.exists() {
        return Ok(PosedClip::load(path, options, skeleton, body)?);
    }
    Ok(load_clip(path, options)?.onto(skeleton, body)?)
}

/// The frames of one loop.
fn frames() -> Vec<smplx::Parameters> {
    (0..FRAMES).map(|frame| pose(frame as f32 / FRAMES as f32)).collect()
}

/// The pose at `time` of the loop, of period 1.
fn pose(time: f32) -> smplx::Parameters {
    let phase = TAU * time;
    // The whole loop, half of it (two beats), and the beat.
    let [slow, swing, beat] = [1.0, 2.0, 4.0].map(|multiple| phase * multiple);
    let sway = swing.sin();
    let mut body = [Vec3::ZERO; joint::LEFT_HAND.start];

    let bend = 0.38 + 0.16 * beat.cos();
    let turn = 0.12 * slow.sin();
    let lean = SWAY * sway / (2.0 * LEG_BONE);
    for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
        // A foot is up while the weight is on the other side.
        let lift = (0.5 - 0.5 * sign * sway).powi(4);
        let out = sign * STANCE - lean;
        body[sides::HIPS[side]] = Vec3::new(-0.5 * bend - 0.55 * lift, -turn, out);
        body[sides::KNEES[side]] = Vec3::X * (bend + 0.95 * lift);
        body[sides::ANKLES[side]] = Vec3::new(-0.5 * bend - 0.3 * lift, 0.0, -out);
    }

    let roll = 0.07 * sway;
    body[joint::SPINE1] = Vec3::new(0.06, -turn, roll);
    body[joint::SPINE2] = Vec3::new(0.04 + 0.04 * beat.sin(), 0.10 * slow.cos(), roll);
    body[joint::SPINE3] = Vec3::new(0.03 * beat.sin(), 0.14 * slow.cos(), -0.5 * roll);
    body[joint::NECK] = Vec3::new(0.05 - 0.05 * beat.sin(), -0.08 * slow.cos(), -0.5 * roll);
    body[joint::HEAD] = Vec3::new(0.08 * beat.cos(), 0.30 * (slow + 0.6).sin(), -0.10 * sway);

    for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
        // A wave that runs down each arm, the two arms half a loop apart.
        let raise = |lag: f32| (slow * 2.0 + if sign > 0.0 { 0.0 } else { TAU / 4.0 } - lag).sin();
        let mirrored = |turn: Vec3| turn * Vec3::new(1.0, sign, sign);
        body[sides::COLLARS[side]] = mirrored(Vec3::new(0.0, 0.0, 0.06 + 0.10 * raise(0.0)));
        body[sides::SHOULDERS[side]] = mirrored(Vec3::new(-0.1, -0.35 - 0.2 * slow.cos(), -0.35 + 0.55 * raise(0.0)));
        body[sides::ELBOWS[side]] = mirrored(Vec3::new(0.0, -0.75 + 0.35 * raise(0.9), 0.25 * raise(0.9)));
        body[sides::WRISTS[side]] = mirrored(Vec3::new(0.0, 0.0, 0.45 * raise(1.8)));
    }

    let [left_hand, right_hand] = [1.0, -1.0].map(|sign| hand(swing + if sign > 0.0 { 0.0 } else { TAU / 4.0 }, sign));
    body[joint::PELVIS] = Vec3::Y * turn;
    body[joint::JAW] = Vec3::X * (0.11 + 0.09 * beat.cos());
    let gaze = Vec3::Y * (0.12 * (slow + 1.2).sin());
    (body[joint::LEFT_EYE], body[joint::RIGHT_EYE]) = (gaze, gaze);
    let knees_lower = 2.0 * LEG_BONE * (1.0 - (0.5 * bend).cos());
    let mut expression =
        vec![0.5 + 0.5 * slow.sin(), 0.8 * sway, 0.6 * slow.cos(), 0.4 * beat.sin(), 0.4 * swing.cos()];
    expression.resize(smplx::EXPRESSIONS, 0.0);
    let pose = Pose {
        rotations: body.map(PoseAxisAngle).into(),
        shape: Vec::new(),
        expression,
        translation: Vec3::new(SWAY * sway, -knees_lower, 0.0),
    };
    smplx::Parameters { left_hand_pose: left_hand, right_hand_pose: right_hand, ..smplx::Parameters::from(&pose) }
}

/// A hand whose fingers close one after the other; `sign` -1 is the right one.
fn hand(phase: f32, sign: f32) -> HandPose {
    let closed = |finger: usize| 0.5 - 0.5 * (phase - 0.5 * finger as f32).cos();
    HandPose::Flat(std::array::from_fn(|joint| {
        // The model's order is index, middle, little, ring, thumb; the wave runs from the index to the little finger.
        let turn = match joint / 3 {
            4 => Vec3::from(THUMB_CURL) * closed(0),
            finger => Vec3::Z * FINGER_CURL[joint % 3] * closed([0, 1, 3, 2][finger]),
        };
        PoseAxisAngle(turn * Vec3::new(1.0, sign, sign))
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every rotation of a pose, and its other parameters.
    fn numbers(parameters: &smplx::Parameters) -> Vec<f32> {
        let hand = |hand: &HandPose| match hand {
            HandPose::Flat(joints) => joints.to_vec(),
            _ => panic!("the dance's hands are absolute"),
        };
        let rotations =
            parameters.before_hands().chain(hand(&parameters.left_hand_pose)).chain(hand(&parameters.right_hand_pose));
        let components = rotations.flat_map(|rotation| rotation.0.to_array());
        components.chain(parameters.expression.clone()).chain(parameters.transl.to_array()).collect()
    }

    fn largest_difference(first: &smplx::Parameters, second: &smplx::Parameters) -> f32 {
        let pairs = numbers(first).into_iter().zip(numbers(second));
        pairs.map(|(first, second)| (first - second).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn the_dance_is_a_smooth_loop() {
        assert!(largest_difference(&pose(0.0), &pose(1.0)) < 1e-4);
        let frames = frames();
        for (index, frame) in frames.iter().enumerate() {
            let next = &frames[(index + 1) % frames.len()];
            // 0.25 rad a frame is a fast dancer's wrist.
            assert!(largest_difference(frame, next) < 0.25, "a jump after frame {index}");
        }
    }

    #[test]
    fn every_part_of_the_body_moves() {
        let frames = frames();
        let range = |value: fn(&smplx::Parameters) -> f32| {
            let values: Vec<f32> = frames.iter().map(value).collect();
            values.iter().copied().fold(f32::MIN, f32::max) - values.iter().copied().fold(f32::MAX, f32::min)
        };
        let finger = |parameters: &smplx::Parameters| numbers(parameters)[3 * joint::LEFT_HAND.start + 2];
        type Value = fn(&smplx::Parameters) -> f32;
        let parts: [(Value, f32); 6] = [
            (|pose| pose.body_pose[joint::LEFT_KNEE - 1].0.x, 0.5),
            (|pose| pose.body_pose[joint::RIGHT_SHOULDER - 1].0.z, 0.8),
            (|pose| pose.body_pose[joint::HEAD - 1].0.y, 0.4),
            (|pose| pose.jaw_pose.0.x, 0.1),
            (|pose| pose.expression[0], 0.8),
            (|pose| pose.transl.x, 0.05),
        ];
        for (index, (value, least)) in parts.into_iter().enumerate() {
            assert!(range(value) > least, "part {index}");
        }
        assert!(range(finger) > 0.8);
    }
}
