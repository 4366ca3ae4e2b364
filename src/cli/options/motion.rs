//! What verbs that take a motion have in common: how it is read, and what is printed about it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use xavatar::avatar::Avatar;
use xavatar::body::BodyModel;
use xavatar::data::{Coordinates, HandConvention, MotionOptions, PosedClip, RestPose, Translation, UpAxis, Warning};
use xavatar::export::ground_motion;
use xavatar::formats::read_text;
use xavatar::synthetic::load_poses;

use crate::cli::option;

/// What the user declares about a motion, and what is to be made of it.
#[derive(Clone, Debug, PartialEq, clap::Args, Serialize, Deserialize)]
#[command(next_help_heading = "Motion (docs/motion.md)")]
pub struct MotionArguments {
    /// The motion's up axis, where it is detected wrongly
    #[arg(long, value_enum, value_name = "AXIS")]
    up: Option<Up>,
    /// What the motion's numbers are relative to; of a file that has both, which to read: the world's by default
    #[arg(long, value_enum, value_name = "COORDINATES")]
    from: Option<Space>,
    /// What the motion's hand poses are, where the format's convention is not followed
    #[arg(long, value_enum, value_name = "CONVENTION")]
    hands: Option<Hands>,
    /// Frames a second of the motion, where it does not say
    #[arg(long, value_name = "F", value_parser = positive)]
    source_fps: Option<f32>,
    /// Frames a second wanted: resamples, rotations along their arcs
    #[arg(long, value_name = "F", value_parser = positive)]
    fps: Option<f32>,
    /// Frames of the motion to take, counted from 1, both ends included: 10..20, 10.. or ..20
    #[arg(long, value_name = "A..B", value_parser = frame_range)]
    frames: Option<FrameRange>,
    /// Smooth in time with a Gaussian of this standard deviation, such as 0.05
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    smooth: Option<f32>,
    /// What becomes of the path through the world
    #[arg(long, value_enum, default_value_t = Travel::Keep)]
    translation: Travel,
    /// Move the motion up or down as a whole, so that the figure's lowest place in it is on the floor, y = 0
    #[arg(long)]
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    ground: bool,
    /// For BVH: a TOML file with lines such as "Hips" = "pelvis", where bones have names that are not known
    #[arg(long, value_name = "FILE", alias = "bone-map")]
    bones: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
enum Up {
    Y,
    Z,
    X,
    /// As in camera coordinates
    YDown,
    ZDown,
    XDown,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
enum Space {
    /// A camera: x right, y down, z away from it
    Camera,
    /// A world that stays while the camera moves
    World,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
enum Hands {
    /// Zero is the flat hand
    Flat,
    /// Zero is the body model's relaxed hand
    Relative,
    /// Coefficients of the body model's hand components
    Pca,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
enum Travel {
    /// As in the motion
    Keep,
    /// Moved as a whole, so that it starts above the origin
    Origin,
    /// Left out: every frame in one place
    None,
}

/// The first frame and the last, if it is not the motion's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct FrameRange(usize, Option<usize>);

impl MotionArguments {
    /// Reads a motion for an avatar, posed by `body` where there is one, on the floor if that is wanted; and tells what was detected,
    /// declared and changed.
    pub fn load(&self, motion: &Path, avatar: &Avatar, body: Option<&BodyModel>) -> anyhow::Result<PosedClip> {
        let mut clip = load_poses(motion, &self.options(avatar)?, &avatar.subject.skeleton, body)?;
        clip.report.iter().for_each(|line| log::info!("{line}"));
        warn(&clip.warnings);
        if self.ground {
            let lift = ground_motion(avatar, body, &mut clip.poses)?;
            log::info!("ground: the motion is moved up by {lift:.3} m");
        }
        Ok(clip)
    }

    /// Whether figures stand on the floor.
    pub fn is_grounded(&self) -> bool {
        self.ground
    }

    /// Frames a second that are wanted.
    pub fn rate(&self) -> Option<f32> {
        self.fps
    }

    /// The frames that are wanted of `count`, counted from 0.
    pub fn range_within(&self, count: usize) -> anyhow::Result<std::ops::Range<usize>> {
        let FrameRange(first, last) = self.frames.unwrap_or(FrameRange(1, None));
        let last = last.unwrap_or(count);
        if first > last.max(1) || last > count {
            bail!("--frames {first}..{last}: there are {count} frames");
        }
        Ok(first - 1..last)
    }

    fn options(&self, avatar: &Avatar) -> anyhow::Result<MotionOptions> {
        Ok(MotionOptions {
            up: self.up.map(|up| match up {
                Up::Y => UpAxis::Y,
                Up::Z => UpAxis::Z,
                Up::X => UpAxis::X,
                Up::YDown => UpAxis::MinusY,
                Up::ZDown => UpAxis::MinusZ,
                Up::XDown => UpAxis::MinusX,
            }),
            coordinates: self.from.map(|from| match from {
                Space::Camera => Coordinates::Camera,
                Space::World => Coordinates::World,
            }),
            hands: self.hands.map(|hands| match hands {
                Hands::Flat => HandConvention::Flat,
                Hands::Relative => HandConvention::RelativeToMean,
                Hands::Pca => HandConvention::Pca,
            }),
            source_rate: self.source_fps,
            rate: self.fps,
            frames: self.frames.map(|FrameRange(first, last)| (first, last)),
            smoothing: self.smooth,
            translation: match self.translation {
                Travel::Keep => Translation::Keep,
                Travel::Origin => Translation::FromOrigin,
                Travel::None => Translation::None,
            },
            rest: RestPose::of_canonical(&avatar.subject.skeleton, &avatar.subject.joints),
            bone_map: self.bones.as_deref().map(read_bone_map).transpose()?,
        })
    }
}

/// Says what may be wrong with a motion, and the option for it.
pub fn warn(warnings: &[Warning]) {
    warnings.iter().for_each(|warning| log::warn!("{}", described(warning)));
}

/// A warning, with the option for it.
pub fn described(warning: &Warning) -> String {
    let advice = warning.choice.map_or_else(String::new, |choice| format!(" ({})", option(choice)));
    format!("{warning}{advice}")
}

fn read_bone_map(path: &Path) -> anyhow::Result<BTreeMap<String, String>> {
    toml::from_str(&read_text(path)?)
        .with_context(|| format!("{}: expected lines such as \"Hips\" = \"pelvis\"", path.display()))
}

pub fn positive(text: &str) -> Result<f32, String> {
    let value = text.parse().ok().filter(|value: &f32| value.is_finite() && *value > 0.0);
    value.ok_or_else(|| "expected a positive number".into())
}

fn frame_range(text: &str) -> Result<FrameRange, String> {
    let number = |text: &str| text.parse().ok().filter(|number: &usize| *number > 0);
    let range = text.split_once("..").and_then(|(first, last)| {
        let first = if first.is_empty() { 1 } else { number(first)? };
        let last = if last.is_empty() { None } else { Some(number(last)?) };
        last.is_none_or(|last| first <= last).then_some(FrameRange(first, last))
    });
    range.ok_or_else(|| "expected A..B, A.. or ..B with frames counted from 1".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_frames_have_one_end_or_two() {
        assert_eq!(frame_range("10..20"), Ok(FrameRange(10, Some(20))));
        assert_eq!(frame_range("10.."), Ok(FrameRange(10, None)));
        assert_eq!(frame_range("..7"), Ok(FrameRange(1, Some(7))));
        for wrong in ["", "5", "0..3", "5..4", "a..b", "1..2..3", "-1..2", "1..99999999999999999999999"] {
            assert!(frame_range(wrong).is_err(), "{wrong}");
        }
    }
}
