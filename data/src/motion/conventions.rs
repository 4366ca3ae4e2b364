//! What a motion's numbers mean, where sources differ: which axis points up, what zero hands are, where the body is.
//!
//! Everything after [`Clip`](super::Clip) is Y up, metres and radians; these types say how a source became that.

use glam::{Quat, Vec3};

use super::Motion;
use xavatar_body::{HandPose, PoseAxisAngle, smplx};

/// The axis of a motion's world that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// As in this library, X-Humans, most BVH files.
    #[default]
    Y,
    /// As in AMASS and GRAB.
    Z,
    /// Y points down, as in the camera coordinates of pose estimators (x right, z away from the camera).
    MinusY,
    /// Z points down.
    MinusZ,
    /// X points up.
    X,
    /// X points down.
    MinusX,
}

impl UpAxis {
    /// Every axis, the more usual ones first.
    pub const ALL: [Self; 6] = [Self::Y, Self::Z, Self::MinusY, Self::MinusZ, Self::X, Self::MinusX];

    /// The direction, in the motion's world.
    pub fn direction(self) -> Vec3 {
        match self {
            Self::Y => Vec3::Y,
            Self::Z => Vec3::Z,
            Self::MinusY => Vec3::NEG_Y,
            Self::MinusZ => Vec3::NEG_Z,
            Self::X => Vec3::X,
            Self::MinusX => Vec3::NEG_X,
        }
    }

    /// The rotation that brings the axis to Y.
    fn to_y(self) -> Quat {
        use std::f32::consts::FRAC_PI_2;
        match self {
            Self::Y => Quat::IDENTITY,
            Self::Z => Quat::from_rotation_x(-FRAC_PI_2),
            Self::MinusY => Quat::from_xyzw(1.0, 0.0, 0.0, 0.0),
            Self::MinusZ => Quat::from_rotation_x(FRAC_PI_2),
            Self::X => Quat::from_rotation_z(FRAC_PI_2),
            Self::MinusX => Quat::from_rotation_z(-FRAC_PI_2),
        }
    }

    /// The axis of this name, as [`Display`](std::fmt::Display) writes it, in any case.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|axis| axis.to_string().eq_ignore_ascii_case(name))
    }
}

impl std::fmt::Display for UpAxis {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Y => "Y",
            Self::Z => "Z",
            Self::MinusY => "Y-down",
            Self::MinusZ => "Z-down",
            Self::X => "X",
            Self::MinusX => "X-down",
        })
    }
}

/// What the numbers of an estimate are relative to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinates {
    /// The camera: x right, y down, z away from it.
    Camera,
    /// A world that stays while the camera moves.
    World,
}

impl std::fmt::Display for Coordinates {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Camera => "the camera's",
            Self::World => "the world's",
        })
    }
}

/// What the numbers of a hand pose are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HandConvention {
    /// Absolute rotations: zero is the flat hand ([`HandPose::Flat`]).
    Flat,
    /// Offsets from the model's mean hand ([`HandPose::RelativeToMean`]).
    RelativeToMean,
    /// Coefficients of the model's hand components ([`HandPose::Pca`]).
    Pca,
}

impl HandConvention {
    /// The convention of a pose.
    pub fn of(hand: &HandPose) -> Self {
        match hand {
            HandPose::Flat(_) => Self::Flat,
            HandPose::RelativeToMean(_) => Self::RelativeToMean,
            HandPose::Pca(_) => Self::Pca,
        }
    }
}

impl std::fmt::Display for HandConvention {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Flat => "flat (zero is the flat hand)",
            Self::RelativeToMean => "relative to the mean hand",
            Self::Pca => "PCA coefficients",
        })
    }
}

/// What becomes of a motion's path through the world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Translation {
    /// As the source has it.
    #[default]
    Keep,
    /// Moved as a whole, so that the first frame is above the origin; heights stay.
    FromOrigin,
    /// Every frame at the origin.
    None,
}

impl Translation {
    /// Applies it to frames that are Y up.
    pub(super) fn apply(self, frames: &mut [smplx::Parameters]) {
        let start = frames.first().map_or(Vec3::ZERO, |frame| frame.transl * Vec3::new(1.0, 0.0, 1.0));
        for frame in frames {
            frame.transl = match self {
                Self::Keep => frame.transl,
                Self::FromOrigin => frame.transl - start,
                Self::None => Vec3::ZERO,
            };
        }
    }
}

impl std::fmt::Display for Translation {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Keep => "as in the motion",
            Self::FromOrigin => "from the origin on",
            Self::None => "left out",
        })
    }
}

impl Motion {
    /// The motion with its up axis turned to Y. The turn leaves the floor where it is, for a body whose pelvis rests at `pelvis`.
    ///
    /// A body turns about its pelvis p, so that R (x - p) + p + t, turned by T, is T R (x - p) + p + (T p - p + T t).
    #[must_use]
    pub fn turned_to_y_up(mut self, pelvis: Vec3) -> Self {
        if self.up == UpAxis::Y {
            return self;
        }
        let turn = self.up.to_y();
        for frame in &mut self.frames {
            let orientation = turn * Quat::from_scaled_axis(frame.global_orient.0);
            frame.global_orient = PoseAxisAngle(shortest(orientation).to_scaled_axis());
            frame.transl = turn * (pelvis + frame.transl) - pelvis;
        }
        self.up = UpAxis::Y;
        self
    }
}

/// The same rotation with an angle of at most half a turn.
pub(super) fn shortest(rotation: Quat) -> Quat {
    if rotation.w < 0.0 { -rotation } else { rotation }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(up: UpAxis, frame: smplx::Parameters) -> Motion {
        Motion { frames: vec![frame], up, ..Motion::default() }
    }

    // Where a point of the body is: R (x - p) + p + t.
    fn place(frame: &smplx::Parameters, pelvis: Vec3, point: Vec3) -> Vec3 {
        Quat::from_scaled_axis(frame.global_orient.0) * (point - pelvis) + pelvis + frame.transl
    }

    #[test]
    fn turning_the_world_turns_every_point_of_the_body() {
        let pelvis = Vec3::new(0.0, -0.35, 0.02);
        let frame = smplx::Parameters {
            global_orient: PoseAxisAngle(Vec3::new(1.4, -0.3, 0.7)),
            transl: Vec3::new(1.0, 2.0, 3.0),
            ..Default::default()
        };
        for (up, image) in [
            (UpAxis::Y, (|v| v) as fn(Vec3) -> Vec3),
            (UpAxis::Z, |v| Vec3::new(v.x, v.z, -v.y)),
            (UpAxis::MinusY, |v| Vec3::new(v.x, -v.y, -v.z)),
            (UpAxis::MinusZ, |v| Vec3::new(v.x, -v.z, v.y)),
            (UpAxis::X, |v| Vec3::new(-v.y, v.x, v.z)),
            (UpAxis::MinusX, |v| Vec3::new(v.y, -v.x, v.z)),
        ] {
            let turned = motion(up, frame.clone()).turned_to_y_up(pelvis);
            assert_eq!(turned.up, UpAxis::Y);
            assert!((image(up.direction()) - Vec3::Y).length() < 1e-6);
            for point in [Vec3::ZERO, Vec3::new(0.1, -1.3, 0.2)] {
                let expected = image(place(&frame, pelvis, point));
                assert!((place(&turned.frames[0], pelvis, point) - expected).length() < 1e-5, "{up}");
            }
        }
    }

    #[test]
    fn translation_is_kept_moved_or_left_out() {
        let frames: Vec<_> = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, 2.5, 4.0)]
            .map(|transl| smplx::Parameters { transl, ..Default::default() })
            .to_vec();
        let places = |translation: Translation| {
            let mut frames = frames.clone();
            translation.apply(&mut frames);
            [frames[0].transl, frames[1].transl]
        };
        assert_eq!(places(Translation::Keep), [frames[0].transl, frames[1].transl]);
        assert_eq!(places(Translation::FromOrigin), [Vec3::new(0.0, 2.0, 0.0), Vec3::new(1.0, 2.5, 1.0)]);
        assert_eq!(places(Translation::None), [Vec3::ZERO; 2]);
    }
}
