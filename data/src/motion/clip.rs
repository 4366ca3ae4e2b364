//! From a file of any format to frames that can animate any avatar: what is detected, what the user declares, what is reported.

use std::collections::BTreeMap;
use std::path::Path;

use glam::Vec3;

use super::conventions::{Coordinates, HandConvention, Translation, UpAxis};
use super::parameters::Choice;
use super::rest::RestPose;
use super::timing::{resampled, smoothed};
use super::{Motion, Wanted, Warning, detect};
use xavatar_body::smplx::{self, joint};
use xavatar_body::{BodyModel, BodyParameters, HandPose, Pose, PoseAxisAngle};
use xavatar_formats::{Error, Result};

/// Frames a second where neither the file nor the user says.
pub(super) const USUAL_RATE: f32 = 30.0;

/// What the user declares about a motion, and what is to be made of it. `Default` detects everything and changes nothing.
#[derive(Clone, Debug, Default)]
pub struct MotionOptions {
    /// The up axis, where it is not what the format and the body's stance say.
    pub up: Option<UpAxis>,
    /// Which of a file's motions to read where it has one in the camera's coordinates and one in the world's; of a file that has
    /// one only, what it is in.
    pub coordinates: Option<Coordinates>,
    /// What the file's hands are, where it is not what the format says.
    pub hands: Option<HandConvention>,
    /// The file's frames a second, where it does not say so, or wrongly.
    pub source_rate: Option<f32>,
    /// Frames a second wanted.
    pub rate: Option<f32>,
    /// The first and the last frame to take, counted from 1 in the file; `None` is to the end.
    pub frames: Option<(usize, Option<usize>)>,
    /// Standard deviation of the Gaussian that smooths in time, seconds.
    pub smoothing: Option<f32>,
    /// What becomes of the path through the world.
    pub translation: Translation,
    /// The skeleton at rest that motions of other skeletons (BVH) are turned onto.
    pub rest: RestPose,
    /// Which bone of such a skeleton is which SMPL-X joint, where its names do not say.
    pub bone_map: Option<BTreeMap<String, String>>,
}

/// Frames ready to animate an avatar: Y up, at a known rate.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// The parameters of each frame (T), at least one. Shape is the source's: an avatar has its own.
    pub frames: Vec<smplx::Parameters>,
    /// How fast they follow each other.
    pub frames_per_second: f32,
    /// What was read, detected, declared and changed, a line each, for the user.
    pub report: Vec<String>,
    /// What may be wrong with it, a line each: loud.
    pub warnings: Vec<Warning>,
}

impl Clip {
    /// Reads a motion of any format ([`read_motion`](super::read_motion)) and applies the options.
    ///
    /// # Errors
    /// Those of [`read_motion`](super::read_motion); [`Error::Value`] for options that no motion, or this one, can follow.
    pub fn load(path: &Path, options: &MotionOptions) -> Result<Self> {
        let wanted =
            Wanted { rest: &options.rest, bone_map: options.bone_map.as_ref(), coordinates: options.coordinates };
        let motion = detect::read(path, &wanted)?;
        Self::of(motion, options)
    }

    /// As [`load`](Self::load), of the content of the file at `path`.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn parse(path: &Path, bytes: &[u8], options: &MotionOptions) -> Result<Self> {
        let wanted =
            Wanted { rest: &options.rest, bone_map: options.bone_map.as_ref(), coordinates: options.coordinates };
        let mut choice = Choice { coordinates: options.coordinates, person: None };
        Self::of(detect::parse(path, bytes, &wanted, &mut choice)?, options)
    }

    /// Applies the options to a motion.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn of(mut motion: Motion, options: &MotionOptions) -> Result<Self> {
        let mut report = vec![format!("motion: {} frames from {}", motion.frames.len(), motion.source)];
        let absent: Vec<&str> = motion.zeroed.iter().filter(|name| *name != "betas").map(String::as_str).collect();
        if !absent.is_empty() {
            report.push(format!("not in the motion, so neutral: {}", absent.join(", ")));
        }
        report.append(&mut motion.notes);

        let own_rate = motion.frames_per_second;
        let (rate, origin) = match (positive("the motion's frames a second", options.source_rate)?, own_rate) {
            (Some(rate), _) => (rate, "declared"),
            (None, Some(rate)) => (rate, "from the motion"),
            (None, None) => (USUAL_RATE, "assumed: the motion does not say"),
        };
        report.push(format!("frame rate: {rate} per second ({origin})"));

        motion.warnings.extend(motion.doubt_about_axis(options));
        report.push(motion.settle_up(options));
        let mut motion = motion.turned_to_y_up(options.rest.pelvis());
        let mut warnings = std::mem::take(&mut motion.warnings);
        warnings.extend(motion.doubts_about_up());
        let mut frames = motion.frames;

        let origin = if options.hands.is_some() { "declared" } else { "by the format" };
        if let Some(convention) = options.hands {
            frames.iter_mut().try_for_each(|frame| declare_hands(frame, convention))?;
        }
        report.push(format!("hands: {} ({origin})", HandConvention::of(&frames[0].left_hand_pose)));

        if let Some((first, last)) = options.frames {
            let last = last.unwrap_or(frames.len());
            if first == 0 || first > last || last > frames.len() {
                return Err(Error::Value {
                    name: "frames".into(),
                    found: format!("{first}..{last}"),
                    expected: format!("within 1..{}, the motion's frames", frames.len()),
                });
            }
            frames = frames.drain(first - 1..last).collect();
            report.push(format!("frames: {first} to {last}"));
        }
        if let Some(seconds) = positive("smoothing", options.smoothing)? {
            frames = smoothed(&frames, f64::from(seconds) * f64::from(rate));
            report.push(format!("smoothed over {seconds} s"));
        }
        let wanted = positive("frames a second", options.rate)?.unwrap_or(rate);
        if wanted != rate {
            frames = resampled(&frames, rate, wanted)?;
            report.push(format!("resampled to {} frames at {wanted} per second", frames.len()));
        }
        options.translation.apply(&mut frames);
        report.push(format!("translation: {}", options.translation));
        if let Some(frame) = frames.iter().position(|frame| !is_finite(frame)) {
            return Err(Error::Value {
                name: format!("frame {} of the motion", frame + 1),
                found: "numbers too large to place a body".into(),
                expected: "metres and radians, or the source's units declared".into(),
            });
        }
        Ok(Self { frames, frames_per_second: wanted, report, warnings })
    }

    /// The pose of each frame (T) on a body; without one, where the hands can be known without.
    ///
    /// # Errors
    /// [`Error::Frame`] naming the frame, if the body is of another skeleton or the hands take one to be known.
    pub fn poses(&self, body: Option<&BodyModel>) -> Result<Vec<Pose>> {
        let pose = |(index, frame): (usize, &smplx::Parameters)| {
            let parameters = BodyParameters::from(frame.clone());
            let pose = body.map_or_else(|| parameters.absolute(), |body| body.resolve(&parameters));
            pose.map_err(|error| error.in_frame(format!("{} of the motion", index + 1)))
        };
        self.frames.iter().enumerate().map(pose).collect()
    }

    /// How long it lasts, seconds; each frame is shown for as long as any other.
    pub fn seconds(&self) -> f32 {
        self.frames.len() as f32 / self.frames_per_second
    }
}

/// Whether root and joints are somewhere: finite numbers of a file can be beyond all numbers once they are scaled and turned.
fn is_finite(frame: &smplx::Parameters) -> bool {
    frame.transl.is_finite() && frame.before_hands().all(|turn| turn.0.is_finite())
}

/// Reads a hand's numbers in another convention than its source's.
fn declare_hands(frame: &mut smplx::Parameters, convention: HandConvention) -> Result<()> {
    for hand in [&mut frame.left_hand_pose, &mut frame.right_hand_pose] {
        let numbers: Vec<f32> = match hand {
            HandPose::Flat(joints) | HandPose::RelativeToMean(joints) => {
                joints.iter().flat_map(|joint| joint.0.to_array()).collect()
            }
            HandPose::Pca(coefficients) => coefficients.clone(),
        };
        let joints = |numbers: &[f32]| {
            let (rotations, rest) = numbers.as_chunks::<3>();
            let rotations =
                rotations.iter().map(|rotation| PoseAxisAngle(Vec3::from_array(*rotation))).collect::<Vec<_>>();
            rotations.try_into().ok().filter(|_| rest.is_empty()).ok_or_else(|| Error::Value {
                name: "hands".into(),
                found: format!("{} numbers a hand", numbers.len()),
                expected: format!("{}, declared to be {convention}", 3 * joint::HAND),
            })
        };
        *hand = match convention {
            HandConvention::Flat => HandPose::Flat(joints(&numbers)?),
            HandConvention::RelativeToMean => HandPose::RelativeToMean(joints(&numbers)?),
            HandConvention::Pca => HandPose::Pca(numbers),
        };
    }
    Ok(())
}

fn positive(name: &str, value: Option<f32>) -> Result<Option<f32>> {
    match value {
        Some(value) if !(value.is_finite() && value > 0.0) => {
            Err(Error::Value { name: name.into(), found: value.to_string(), expected: "a positive number".into() })
        }
        value => Ok(value),
    }
}
