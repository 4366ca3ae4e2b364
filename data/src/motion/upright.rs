//! Which way is up in a motion: what the user declares, what the format says, what the body shows; and what to say about it.
//!
//! A format or a file that says it is believed: who lies in it stays lying. Where neither does, a body that stands for the whole
//! clip shows it. A motion whose body is head down or lies after that is said to be so: it may be right.

use glam::{Quat, Vec3};

use super::conventions::{Coordinates, UpAxis};
use super::{Motion, MotionOptions, Warning};
use xavatar_body::smplx;
use xavatar_formats::Choice;

/// A body that stands for most of a clip has the mean of its own up axis this close to one axis of the world (a cosine).
const STANDS: f32 = 0.8;
/// And this far from the others: below, the axis is not that one.
const LIES: f32 = 0.3;
/// The axes that worlds without a word about it have up.
const USUAL: [UpAxis; 3] = [UpAxis::Y, UpAxis::Z, UpAxis::MinusY];
/// A body is head down if its own up points down by more than this, a cosine.
const HEAD_DOWN: f32 = -0.5;

impl Motion {
    /// The axis along which the body stands, head up, for most of the motion; `None` if it lies, bends or tumbles.
    pub(super) fn standing_axis(&self) -> Option<UpAxis> {
        let mean = self.frames.iter().map(body_up).sum::<Vec3>() / self.frames.len().max(1) as f32;
        USUAL.into_iter().find(|axis| mean.dot(axis.direction()) > STANDS)
    }

    /// The standing axis, if it is clearly not the one that the format should have.
    fn contradicting_axis(&self) -> Option<UpAxis> {
        let axis = self.standing_axis()?;
        let is_other = axis.direction().dot(self.up.direction()) < LIES;
        is_other.then_some(axis)
    }

    /// Sets the up axis to the declared or the detected one; the line of the report about it.
    pub(super) fn settle_up(&mut self, options: &MotionOptions) -> String {
        let standing = self.contradicting_axis();
        let usual = self.up;
        let (axis, reason) = match (options.up, options.coordinates, standing) {
            (Some(declared), ..) => (declared, "declared".to_owned()),
            (None, Some(Coordinates::Camera), _) => {
                (UpAxis::MinusY, "declared to be the camera's coordinates".to_owned())
            }
            (None, _, Some(standing)) if !self.up_is_certain => (
                standing,
                format!("the body stands along it, though {usual} is this format's; declare {usual} if it is right"),
            ),
            (None, Some(Coordinates::World), None)
                if self.coordinates != Some(Coordinates::World) && usual == UpAxis::MinusY =>
            {
                (UpAxis::Y, "declared to be a world's coordinates".to_owned())
            }
            _ if self.up_reason.is_empty() => (usual, "by the format".to_owned()),
            _ => (usual, self.up_reason.clone()),
        };
        self.up = axis;
        let turned = if axis == UpAxis::Y { "" } else { "; turned to Y" };
        format!("up axis: {axis} ({reason}){turned}")
    }

    /// That nothing tells which way is up in a motion that is as its file has it.
    pub(super) fn doubt_about_axis(&self, options: &MotionOptions) -> Option<Warning> {
        let is_told = self.up_is_certain || options.up.is_some() || options.coordinates.is_some();
        (!is_told && self.standing_axis().is_none()).then(|| {
            let axis = self.up;
            let message =
                format!("which way is up shows neither in the file nor by a body that stands; {axis} is taken");
            Warning::choosing(Choice::UpAxis, message)
        })
    }

    /// What should be looked at in a motion that is Y up, after all.
    pub(super) fn doubts_about_up(&self) -> Option<Warning> {
        const REMEDY: &str = "if that is wrong, declare the file's up axis, or that it is in a camera's coordinates";
        let count = self.frames.len();
        let is_head_down = |frame: &smplx::Parameters| body_up(frame).y < HEAD_DOWN;
        let head_down = self.frames.iter().filter(|frame| is_head_down(frame)).count();
        let message = if 2 * head_down > count || self.frames.last().is_some_and(is_head_down) {
            format!("the body is head down in {head_down} of {count} frames; {REMEDY}")
        } else {
            let lying = self.contradicting_axis()?;
            format!("the body lies, along the axis {lying} once Y is up, for most of the {count} frames; {REMEDY}")
        };
        Some(Warning::choosing(Choice::UpAxis, message))
    }
}

/// Which way a body's pelvis points that in the T-pose points up.
fn body_up(frame: &smplx::Parameters) -> Vec3 {
    Quat::from_scaled_axis(frame.global_orient.0) * Vec3::Y
}

#[cfg(test)]
mod tests {
    use super::*;
    use xavatar_body::PoseAxisAngle;

    fn motion(up: UpAxis, turn: Vec3) -> Motion {
        let frame = smplx::Parameters { global_orient: PoseAxisAngle(turn), ..Default::default() };
        Motion { frames: vec![frame], up, ..Motion::default() }
    }

    const QUARTER: f32 = std::f32::consts::FRAC_PI_2;

    #[test]
    fn a_standing_body_shows_which_axis_is_up() {
        let (along_z, along_y) = (Vec3::X * QUARTER, Vec3::Y * 2.0);
        assert_eq!(motion(UpAxis::Y, along_z).standing_axis(), Some(UpAxis::Z));
        assert_eq!(motion(UpAxis::Y, Vec3::X * 2.0 * QUARTER).standing_axis(), Some(UpAxis::MinusY));
        assert_eq!(motion(UpAxis::Z, along_z).contradicting_axis(), None);
        assert_eq!(motion(UpAxis::Z, along_y).contradicting_axis(), Some(UpAxis::Y));
        // On the side: nothing is known.
        assert_eq!(motion(UpAxis::Y, Vec3::Z * QUARTER).standing_axis(), None);
    }

    #[test]
    fn what_is_declared_comes_first_then_a_certain_format_then_the_body() {
        let settled = |certain: bool, options: MotionOptions| {
            let mut motion = motion(UpAxis::Y, Vec3::X * QUARTER);
            motion.up_is_certain = certain;
            motion.settle_up(&options);
            motion.up
        };
        let declared =
            MotionOptions { up: Some(UpAxis::X), coordinates: Some(Coordinates::Camera), ..Default::default() };
        assert_eq!(settled(true, declared), UpAxis::X);
        let camera = MotionOptions { coordinates: Some(Coordinates::Camera), ..Default::default() };
        assert_eq!(settled(true, camera), UpAxis::MinusY);
        assert_eq!(settled(true, MotionOptions::default()), UpAxis::Y);
        assert_eq!(settled(false, MotionOptions::default()), UpAxis::Z);
    }

    #[test]
    fn bodies_that_do_not_stand_are_said_to_lie_or_to_be_head_down() {
        assert_eq!(motion(UpAxis::Y, Vec3::Y).doubts_about_up(), None);
        let doubt = |turn: Vec3| motion(UpAxis::Y, turn).doubts_about_up().unwrap();
        assert!(doubt(Vec3::X * 2.0 * QUARTER).message.contains("head down in 1 of 1 frames"));
        assert!(doubt(Vec3::X * QUARTER).message.contains("lies"));
    }
}
