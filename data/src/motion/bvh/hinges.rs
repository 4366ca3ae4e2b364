//! Which way knees and elbows bend: what a limb's turn about itself is, where the rest pose does not tell or tells wrongly.
//!
//! A knee moves the shin backward, an elbow of the T-pose the forearm forward. The mean over the frames of where the lower bone
//! goes, square to the upper one and in its axes, is compared with that. A limb that stays straight, or bends this way and
//! that, tells nothing.

use glam::DVec3;
use xavatar_body::smplx::joint;

use super::alignment::Axes;
use super::stance::Stance;
use xavatar_body::smplx::joint::sides::{ANKLES, KNEES};

/// A limb bends if it does by this much in some frame, a sine: 15 degrees.
const BENDS: f64 = 0.26;
/// And on the whole one way: the length of the mean by the mean of the lengths.
const ONE_WAY: f64 = 0.8;
/// Toes that are this far, degrees, from where the knee points in the mean are on a leg that is turned about itself.
const TOES_ASIDE: f64 = 60.0;

/// A joint that bends one way.
pub(super) struct Hinge {
    /// The joint above the hinge, whose bone turns about itself with what is below.
    pub(super) upper: usize,
    /// The joint of the hinge.
    pub(super) lower: usize,
    /// The upper bone's direction in its axes, and where the lower bone goes from it.
    along: DVec3,
    bends_to: DVec3,
    /// The angle, degrees, above which a rest pose is not believed: elbows of real recordings are far from exact.
    pub(super) believed: f64,
}

/// Knees and elbows.
pub(super) const HINGES: [Hinge; 4] = [
    Hinge::knee(joint::LEFT_HIP, joint::LEFT_KNEE),
    Hinge::knee(joint::RIGHT_HIP, joint::RIGHT_KNEE),
    Hinge::elbow(joint::LEFT_SHOULDER, joint::LEFT_ELBOW, DVec3::X),
    Hinge::elbow(joint::RIGHT_SHOULDER, joint::RIGHT_ELBOW, DVec3::NEG_X),
];

impl Hinge {
    const fn knee(upper: usize, lower: usize) -> Self {
        Self { upper, lower, along: DVec3::NEG_Y, bends_to: DVec3::NEG_Z, believed: 40.0 }
    }

    const fn elbow(upper: usize, lower: usize, along: DVec3) -> Self {
        Self { upper, lower, along, bends_to: DVec3::Z, believed: 70.0 }
    }

    /// By how much the upper bone's axes are to be turned about it, radians, for the lower one to bend the right way; `None` if
    /// the frames do not tell.
    pub(super) fn roll(&self, axes: &Axes, frames: &[Stance]) -> Option<f64> {
        let (mut sum, mut lengths, mut most) = (DVec3::ZERO, 0.0, 0.0f64);
        for stance in frames {
            let lower = axes.of(self.upper, stance).inverse() * stance.direction(self.lower)?;
            let aside = lower - self.along * lower.dot(self.along);
            sum += aside;
            lengths += aside.length();
            most = most.max(aside.length());
        }
        if most < BENDS || sum.length() < ONE_WAY * lengths {
            return None;
        }
        Some(angle_about(self.along, self.bends_to, sum))
    }
}

/// Joints about which limbs are turned as no body's are, in axes that would be right if the rest pose were; degrees.
pub(super) fn twists(axes: &Axes, frames: &[Stance]) -> Vec<(usize, f64)> {
    let hinges = HINGES.iter().filter_map(|hinge| Some((hinge.lower, hinge.roll(axes, frames)?, hinge.believed)));
    let ankles = ANKLES.into_iter().zip(KNEES).filter_map(|(ankle, knee)| {
        let toes = frames.iter().filter_map(|stance| {
            let toes = axes.of(knee, stance).inverse() * stance.direction(ankle)?;
            Some(DVec3::new(toes.x, 0.0, toes.z))
        });
        let sum: DVec3 = toes.sum();
        (sum.length() > BENDS * frames.len() as f64).then(|| (ankle, angle_about(DVec3::Y, DVec3::Z, sum), TOES_ASIDE))
    });
    let twists = hinges.chain(ankles).map(|(joint, angle, believed)| (joint, angle.to_degrees().abs(), believed));
    twists.filter(|(_, degrees, believed)| degrees > believed).map(|(joint, degrees, _)| (joint, degrees)).collect()
}

/// From one direction to another, both square to the axis that it is about.
fn angle_about(axis: DVec3, from: DVec3, to: DVec3) -> f64 {
    from.cross(to).dot(axis).atan2(from.dot(to))
}
