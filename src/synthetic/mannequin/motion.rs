//! The mannequin's takes: parameters that pass through key poses, evenly in time.
//!
//! Rotation vectors, hands, jaw and expression are interpolated linearly between key poses. Radians.

use glam::Vec3;

use super::model::closed_hand;
use super::recipe::{KeyPose, Recipe, joint_index, malformed, twin};
use crate::body::{self, Fingers, HandPose, PoseAxisAngle, smplx};
use crate::formats::Result;

/// Turns of the eyes per turn of the head: the gaze leads.
const GAZE: f32 = 0.5;

/// A sequence of key poses.
pub(super) struct Take {
    poses: Vec<Pose>,
    betas: Vec<f32>,
    fist: [Fingers; 2],
    relaxed: f32,
    /// The joint that the gaze follows.
    head: usize,
}

/// A point between key poses.
#[derive(Clone)]
struct Pose {
    /// Of every joint; those of hands and eyes are zero.
    turns: Vec<Vec3>,
    hands: [f32; 2],
    expression: Vec<f32>,
}

impl Take {
    /// The take through the poses with these names.
    pub(super) fn of(recipe: &Recipe, names: &[String]) -> Result<Self> {
        let poses = names.iter().map(|name| Pose::named(recipe, name)).collect::<Result<Vec<_>>>()?;
        let fist = [1.0, -1.0].map(|sign| closed_hand(&recipe.hands, sign));
        let (betas, relaxed, head) = (recipe.motion.betas.clone(), recipe.hands.relaxed, joint_index("head")?);
        Ok(Self { poses, betas, fist, relaxed, head })
    }

    /// The parameters at `time` from 0 to 1; hands are relative to the mean, as in X-Humans.
    pub(super) fn parameters(&self, time: f32) -> smplx::Parameters {
        let place = time.clamp(0.0, 1.0) * (self.poses.len() - 1) as f32;
        let first = (place as usize).min(self.poses.len() - 2);
        let pose = self.poses[first].towards(&self.poses[first + 1], place - first as f32);
        let hand = |side: usize| {
            let share = pose.hands[side] - self.relaxed;
            HandPose::RelativeToMean(self.fist[side].map(|turn| PoseAxisAngle(turn.0 * share)))
        };
        let gaze = PoseAxisAngle(Vec3::new(0.0, pose.turns[self.head].y * GAZE, 0.0));
        let rotations = pose.turns.iter().copied().map(PoseAxisAngle).collect();
        let (shape, expression) = (self.betas.clone(), pose.expression.clone());
        smplx::Parameters {
            left_eye_pose: gaze,
            right_eye_pose: gaze,
            left_hand_pose: hand(0),
            right_hand_pose: hand(1),
            ..smplx::Parameters::from(&body::Pose { rotations, shape, expression, translation: Vec3::ZERO })
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
        let skeleton = smplx::skeleton();
        let mut turns = vec![Vec3::ZERO; skeleton.joints.len()];
        turns[0] = Vec3::Y * key.yaw;
        turns[joint_index("jaw")?] = Vec3::X * key.jaw;
        for (name, turn) in &key.turns {
            let joint = joint_index(name)?;
            if !skeleton.conditioning.contains(&joint) {
                return Err(malformed(name, "a joint of root, face or hands", "a body joint"));
            }
            turns[joint] = Vec3::from(*turn);
        }
        let mut expression = vec![0.0; smplx::EXPRESSIONS];
        for (name, amount) in &key.expression {
            let index = recipe.expressions.iter().position(|known| known.name == *name);
            let slot = index.and_then(|index| expression.get_mut(index));
            *slot.ok_or_else(|| malformed(name, "unknown", "the name of an expression"))? = *amount;
        }
        Ok(Self { turns, hands: key.hands, expression })
    }

    fn mirrored(&self) -> Self {
        let mirror = |joint: usize| self.turns[twin(joint)] * Vec3::new(1.0, -1.0, -1.0);
        let turns = (0..self.turns.len()).map(mirror).collect();
        Self { turns, hands: [self.hands[1], self.hands[0]], expression: self.expression.clone() }
    }

    fn towards(&self, next: &Self, share: f32) -> Self {
        let between = |from: f32, to: f32| from + (to - from) * share;
        Self {
            turns: self.turns.iter().zip(&next.turns).map(|(from, to)| from.lerp(*to, share)).collect(),
            hands: std::array::from_fn(|side| between(self.hands[side], next.hands[side])),
            expression: self.expression.iter().zip(&next.expression).map(|(from, to)| between(*from, *to)).collect(),
        }
    }
}

/// How far each joint of the body is turned, radians (J); root, face and hands are left at 0.
pub(super) fn joint_angles(pose: &body::Pose) -> Vec<f32> {
    let mut angles = vec![0.0; pose.rotations.len()];
    smplx::skeleton().conditioning.iter().for_each(|joint| angles[*joint] = pose.rotations[*joint].0.length());
    angles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirrored_pose_is_the_mirror_image_of_the_body() {
        let subject = crate::synthetic::BuiltInSubject::new().unwrap();
        let recipe = Recipe::embedded().unwrap();
        let take = Take::of(&recipe, &["wave".into(), "~wave".into()]).unwrap();
        let model = subject.model();
        let [pose, mirrored] = [0.0, 1.0].map(|time| {
            let pose = model.resolve(&take.parameters(time).into()).unwrap();
            model.pose(&pose).unwrap().joints
        });
        for joint in 0..pose.len() {
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
