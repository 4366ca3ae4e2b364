//! Registered poses refined by the avatar that is learned from them: a body that lies some millimetres off, in each frame another way,
//! blurs what the frames teach together.
//!
//! Each frame's pose is fitted to its captured surface ([`PoseFit`]). What the corrections of all frames have in common is not applied: the
//! avatar's own shape takes it up, so that it is right in other poses too, which nobody refines. Joints of faces and of hands stay, for these are
//! not learned from scans alone. J joints, F frames; metres, radians.

use std::fmt;

use glam::{DMat3, DVec3, Vec3};
use rand_chacha::ChaCha8Rng;
use xavatar_register::linear::{Extents, FramePose, so3};

use super::TrainingSpec;
use super::drawn::{Origin, PosedSamples};
use crate::Result;
use crate::body::{Pose, PoseAxisAngle, Role};
use crate::data::Capture;
use crate::fields::{CapturedPoints, Fields, FittedPose, PoseFit, Poser, median};

/// A pose that takes a registered one's place.
#[derive(Clone, Debug, PartialEq)]
pub struct RefinedPose {
    /// The rotation of each joint (J).
    pub rotations: Vec<PoseAxisAngle>,
    /// Translation added to every vertex, metres.
    pub translation: Vec3,
}

impl RefinedPose {
    /// The registered pose with this one's turns and translation.
    pub(super) fn of(&self, registered: &Pose) -> Pose {
        Pose { rotations: self.rotations.clone(), translation: self.translation, ..registered.clone() }
    }
}

/// What a refinement did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// Median distance of the captured surfaces from the avatar's before, metres.
    pub before: f64,
    /// And after.
    pub after: f64,
}

impl fmt::Display for Refined {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { before, after } = self;
        write!(formatter, "surfaces {:.2} mm from the avatar's, then {:.2} mm (median)", 1e3 * before, 1e3 * after)
    }
}

/// Refines the poses of a training's frames.
pub(super) struct PoseRefiner<'a> {
    spec: TrainingSpec<'a>,
    poser: Poser,
    fit: PoseFit<'a>,
    registered: Vec<FramePose>,
    fitted: Vec<FittedPose>,
}

impl<'a> PoseRefiner<'a> {
    /// Of frames, none of which is fitted yet; `poser` is for surfaces.
    pub fn new(spec: TrainingSpec<'a>, poser: Poser) -> Self {
        let fit = PoseFit::new(spec.body, |role| !matches!(role, Role::Hands | Role::Face));
        Self { spec, poser, fit, registered: Vec::new(), fitted: Vec::new() }
    }

    /// Fits the next frame's pose, from `now` on, to points that `random` draws.
    pub fn add(
        &mut self,
        fields: &Fields<f32>,
        (capture, registered): (Capture, &Pose),
        now: &Pose,
        mut random: ChaCha8Rng,
    ) -> Result<()> {
        self.poser.bake(&fields.skinning)?;
        let frame = self.spec.prepare(capture.posed(now.clone()))?;
        let captured = captured(frame.supervision.draw(self.spec.config, &mut random), now.translation);
        self.fitted.push(self.fit.fit((&self.poser, fields), &captured, registered, now)?);
        self.registered.push(FramePose::of(registered, self.extents()));
        Ok(())
    }

    /// What the poses of the frames (F) are refined to, and what that did; forgets them.
    pub fn finish(&mut self) -> (Vec<RefinedPose>, Refined) {
        let (registered, fitted) = (std::mem::take(&mut self.registered), std::mem::take(&mut self.fitted));
        let extents = self.extents();
        let corrections: Vec<Correction> = registered
            .iter()
            .zip(&fitted)
            .map(|(registered, fitted)| Correction::between(registered, &FramePose::of(&fitted.pose, extents)))
            .collect();
        let common = Correction::mean(&corrections);
        let pose =
            |(correction, registered): (&Correction, &FramePose)| correction.without(&common).applied(registered);
        let median_of = |distance: fn(&FittedPose) -> f64| median(fitted.iter().map(distance).collect());
        let refined = Refined { before: median_of(|fitted| fitted.before), after: median_of(|fitted| fitted.after) };
        (corrections.iter().zip(&registered).map(pose).collect(), refined)
    }

    fn extents(&self) -> Extents {
        self.fit.extents()
    }
}

/// The points of a draw that are the captured surface's own; hands may be the registered body's.
fn captured(samples: PosedSamples, translation: Vec3) -> CapturedPoints {
    let PosedSamples { on_points, on_labels, on_origins, .. } = samples;
    let drawn = on_points.into_iter().zip(on_labels).zip(on_origins);
    let own = drawn.filter(|(_, origin)| matches!(origin, Origin::Depth(_)));
    let (points, labels) = own.map(|((point, label), _)| (Vec3::from_array(point) + translation, label)).unzip();
    CapturedPoints { points, labels }
}

/// How far a pose is from the registered one.
struct Correction {
    /// Of each joint, about its own axes (J).
    turns: Vec<DVec3>,
    /// Along the axes of the registered root.
    shift: DVec3,
}

impl Correction {
    fn between(registered: &FramePose, pose: &FramePose) -> Self {
        let turn = |(from, to): (&DMat3, &DMat3)| so3::log(&(from.transpose() * *to));
        Self {
            turns: registered.rotations.iter().zip(&pose.rotations).map(turn).collect(),
            shift: registered.rotations[0].transpose() * (pose.translation - registered.translation),
        }
    }

    fn mean(corrections: &[Self]) -> Self {
        let count = corrections.len().max(1) as f64;
        let mut sum = Self { turns: Vec::new(), shift: DVec3::ZERO };
        for correction in corrections {
            sum.turns.resize(correction.turns.len(), DVec3::ZERO);
            sum.turns.iter_mut().zip(&correction.turns).for_each(|(sum, turn)| *sum += *turn / count);
            sum.shift += correction.shift / count;
        }
        sum
    }

    fn without(&self, common: &Self) -> Self {
        let turns = self.turns.iter().zip(&common.turns).map(|(turn, common)| *turn - *common);
        Self { turns: turns.collect(), shift: self.shift - common.shift }
    }

    fn applied(&self, registered: &FramePose) -> RefinedPose {
        let turned = registered.rotations.iter().zip(&self.turns).map(|(rotation, turn)| *rotation * so3::exp(*turn));
        RefinedPose {
            rotations: turned.map(|rotation| PoseAxisAngle(so3::log(&rotation).as_vec3())).collect(),
            translation: (registered.translation + registered.rotations[0] * self.shift).as_vec3(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Two frames that are off in opposite ways, and both in a third, which is the avatar's own.
    #[test]
    fn what_all_corrections_have_in_common_is_not_applied() {
        let pose = |turns: [DVec3; 2], translation: DVec3| FramePose {
            rotations: turns.map(so3::exp).to_vec(),
            translation,
            expression: Vec::new(),
        };
        let registered = pose([DVec3::new(0.0, 0.5, 0.0), DVec3::new(0.2, 0.0, -0.3)], DVec3::new(0.1, 1.0, 0.0));
        let (common, own) = (DVec3::new(0.02, 0.0, 0.0), DVec3::new(0.0, 0.0, 0.03));
        let corrected = |sign: f64| {
            let turn = common + own * sign;
            Correction { turns: vec![DVec3::ZERO, turn], shift: turn * 0.1 }
        };
        let corrections = [corrected(1.0), corrected(-1.0)];
        let common = Correction::mean(&corrections);
        for (correction, sign) in corrections.iter().zip([1.0, -1.0]) {
            let refined = correction.without(&common).applied(&registered);
            let expected = registered.rotations[1] * so3::exp(own * sign);
            let turn = so3::exp(refined.rotations[1].0.as_dvec3());
            assert!((turn - expected).to_cols_array().iter().all(|entry| entry.abs() < 1e-6));
            let shift = registered.rotations[0] * own * (0.1 * sign);
            assert!(refined.translation.as_dvec3().distance(registered.translation + shift) < 1e-6);
        }
    }
}
