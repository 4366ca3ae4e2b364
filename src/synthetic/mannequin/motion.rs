//! The mannequin's takes: parameters that pass through key poses, evenly in time.
//!
//! Rotation vectors, hands, jaw and expression are interpolated linearly between key poses. Radians.

use glam::Vec3;

use super::model::closed_hand;
use super::recipe::{KeyPose, Recipe, joint_index, malformed, twin};
use crate::body::{BodyParameters, HandPose, JOINTS, PoseAxisAngle};
use crate::formats::Result;

/// Turns of the eyes per turn of the head: the gaze leads.
const GAZE: f32 = 0.5;

/// A sequence of key poses.
pub(super) struct Take {
    poses: Vec<Pose>,
    betas: [f32; 10],
    fist: [[f32; 45]; 2],
    relaxed: f32,
}

/// A point between key poses.
#[derive(Clone)]
struct Pose {
    turns: [Vec3; 23],
    hands: [f32; 2],
    expression: [f32; 10],
}

impl Take {
    /// The take through the poses with these names.
    pub(super) fn of(recipe: &Recipe, names: &[String]) -> Result<Self> {
        let poses = names.iter().map(|name| Pose::named(recipe, name)).collect::<Result<Vec<_>>>()?;
        let fist = [1.0, -1.0].map(|sign| closed_hand(&recipe.hands, sign));
        Ok(Self { poses, betas: recipe.motion.betas, fist, relaxed: recipe.hands.relaxed })
    }

    /// The parameters at `time` from 0 to 1; hands are relative to the mean, as in X-Humans.
    pub(super) fn parameters(&self, time: f32) -> BodyParameters {
        let place = time.clamp(0.0, 1.0) * (self.poses.len() - 1) as f32;
        let first = (place as usize).min(self.poses.len() - 2);
        let pose = self.poses[first].towards(&self.poses[first + 1], place - first as f32);
        let hand = |side: usize| {
            let closed = self.fist[side].map(|angle| angle * (pose.hands[side] - self.relaxed));
            HandPose::RelativeToMean(std::array::from_fn(|joint| PoseAxisAngle(Vec3::from_slice(&closed[joint * 3..]))))
        };
        let gaze = PoseAxisAngle(Vec3::new(0.0, pose.turns[15].y * GAZE, 0.0));
        BodyParameters {
            betas: self.betas,
            expression: pose.expression,
            global_orient: PoseAxisAngle(pose.turns[0]),
            body_pose: std::array::from_fn(|joint| PoseAxisAngle(pose.turns[joint + 1])),
            jaw_pose: PoseAxisAngle(pose.turns[22]),
            left_eye_pose: gaze,
            right_eye_pose: gaze,
            left_hand_pose: hand(0),
            right_hand_pose: hand(1),
            transl: Vec3::ZERO,
        }
    }
}

impl Pose {
    fn named(recipe: &Recipe, name: &str) -> Result<Self> {
        let (mirrored, written) = name.strip_prefix('~').map_or((false, name), |written| (true, written));
        let key = recipe.poses.get(written);
        let pose = Self::of(recipe, key.ok_or_else(|| malformed(written, "absent", "a pose of a take"))?)?;
        Ok(if mirrored { pose.mirrored() } else { pose })
    }

    fn of(recipe: &Recipe, key: &KeyPose) -> Result<Self> {
        let mut turns = [Vec3::ZERO; 23];
        turns[0] = Vec3::Y * key.yaw;
        turns[22] = Vec3::X * key.jaw;
        for (name, turn) in &key.turns {
            let joint = joint_index(name)?;
            *turns.get_mut(joint).ok_or_else(|| malformed(name, "a hand joint", "a body joint"))? = Vec3::from(*turn);
        }
        let mut expression = [0.0; 10];
        for (name, amount) in &key.expression {
            let index = recipe.expressions.iter().position(|known| known.name == *name);
            let slot = index.and_then(|index| expression.get_mut(index));
            *slot.ok_or_else(|| malformed(name, "unknown", "the name of an expression"))? = *amount;
        }
        Ok(Self { turns, hands: key.hands, expression })
    }

    fn mirrored(&self) -> Self {
        let mirror = |joint: usize| self.turns[twin(joint)] * Vec3::new(1.0, -1.0, -1.0);
        let turns = std::array::from_fn(mirror);
        Self { turns, hands: [self.hands[1], self.hands[0]], expression: self.expression }
    }

    fn towards(&self, next: &Self, share: f32) -> Self {
        let between = |from: f32, to: f32| from + (to - from) * share;
        Self {
            turns: std::array::from_fn(|joint| self.turns[joint].lerp(next.turns[joint], share)),
            hands: std::array::from_fn(|side| between(self.hands[side], next.hands[side])),
            expression: std::array::from_fn(|index| between(self.expression[index], next.expression[index])),
        }
    }
}

/// How far each joint is turned, radians; hands and eyes are left at 0.
pub(super) fn joint_angles(parameters: &BodyParameters) -> [f32; JOINTS] {
    std::array::from_fn(|joint| match joint {
        1..=21 => parameters.body_pose[joint - 1].0.length(),
        _ => 0.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirrored_pose_is_the_mirror_image_of_the_body() {
        let subject = crate::synthetic::BuiltInSubject::new().unwrap();
        let recipe = Recipe::embedded().unwrap();
        let take = Take::of(&recipe, &["wave".into(), "~wave".into()]).unwrap();
        let [pose, mirrored] = [0.0, 1.0].map(|time| subject.model().pose(&take.parameters(time)).unwrap().joints);
        for joint in 0..JOINTS {
            let image = pose[twin(joint)] * Vec3::new(-1.0, 1.0, 1.0);
            // The right side of the skin is meshed on its own: shaped joints agree to a fraction of a triangle.
            assert!(mirrored[joint].distance(image) < 2e-3, "joint {joint}");
        }
    }

    #[test]
    fn a_take_passes_through_its_poses_without_jumps() {
        let recipe = Recipe::embedded().unwrap();
        let take = Take::of(&recipe, &recipe.motion.train).unwrap();
        let mut before = take.parameters(0.0);
        for step in 1..=1000 {
            let now = take.parameters(step as f32 / 1000.0);
            let jump = now.body_pose.iter().zip(&before.body_pose).map(|(a, b)| a.0.distance(b.0));
            assert!(jump.fold(0.0, f32::max) < 0.06);
            before = now;
        }
        assert_eq!(take.parameters(1.0), take.parameters(7.0));
    }

    #[test]
    fn poses_that_do_not_exist_are_named() {
        let recipe = Recipe::embedded().unwrap();
        let error = Take::of(&recipe, &["stand".into(), "~fly".into()]).err().unwrap();
        assert!(error.to_string().contains("fly is absent"), "{error}");
    }
}
