//! A motion's time: other frame rates, and less jitter.
//!
//! Rotations are interpolated along the shortest arc (slerp) and averaged as unit quaternions; hands that are relative to the
//! mean hand or PCA coefficients are sums, not rotations, and are treated as numbers, like expression and translation.

use glam::{DQuat, Vec3};

use super::conventions::HandConvention;
use xavatar_body::smplx::{self, joint};
use xavatar_body::{HandPose, Pose, PoseAxisAngle};
use xavatar_formats::{Error, Result};

/// Frames that a resampled motion may have: an hour at 120 a second.
const MOST_FRAMES: f64 = 432_000.0;
/// Standard deviations after which a Gaussian weight is left out.
const REACH: f64 = 3.0;

/// The frames at `to` frames a second instead of `from`: as many as fit between the first and the last.
pub(super) fn resampled(frames: &[smplx::Parameters], from: f32, to: f32) -> Result<Vec<smplx::Parameters>> {
    let ratio = f64::from(from) / f64::from(to);
    let last = frames.len().saturating_sub(1);
    // The last frame counts although rounding puts it a hair outside.
    let count = (last as f64 / ratio + 1e-6).floor() + 1.0;
    if count > MOST_FRAMES {
        return Err(Error::Value {
            name: "frames a second".into(),
            found: format!("{to}, which makes {count:.0} frames of {} at {from}", frames.len()),
            expected: format!("at most {MOST_FRAMES} frames"),
        });
    }
    let frame = |index: usize| {
        let place = (index as f64 * ratio).min(last as f64);
        let before = place as usize;
        let share = place - before as f64;
        match frames.get(before + 1) {
            Some(after) if share > 1e-6 => between(&frames[before], after, share),
            _ => frames[before].clone(),
        }
    };
    Ok((0..count as usize).map(frame).collect())
}

/// The frames, each the mean of those around it with Gaussian weights of standard deviation `sigma` frames.
pub(super) fn smoothed(frames: &[smplx::Parameters], sigma: f64) -> Vec<smplx::Parameters> {
    let reach = (REACH * sigma).min(frames.len() as f64) as usize;
    let channels: Vec<Channels> = frames.iter().map(Channels::of).collect();
    let mean = |centre: usize| {
        let window = centre.saturating_sub(reach)..(centre + reach + 1).min(frames.len());
        // Only frames with hands of the same kind have a mean.
        let window = window.filter(|index| channels[*index].numbers.len() == channels[centre].numbers.len());
        let weighted = window.map(|index| {
            let distance = (index as f64 - centre as f64) / sigma;
            (&channels[index], (-0.5 * distance * distance).exp())
        });
        Channels::mean(&channels[centre], weighted).into_parameters(&frames[centre])
    };
    (0..frames.len()).map(mean).collect()
}

/// The pose a `share` (0..1) of the way between two.
fn between(first: &smplx::Parameters, second: &smplx::Parameters, share: f64) -> smplx::Parameters {
    let [from, to] = [first, second].map(Channels::of);
    if from.rotations.len() != to.rotations.len() || from.numbers.len() != to.numbers.len() {
        return if share < 0.5 { first.clone() } else { second.clone() };
    }
    let rotations = from.rotations.iter().zip(&to.rotations);
    let numbers = from.numbers.iter().zip(&to.numbers);
    let channels = Channels {
        rotations: rotations.map(|(from, to)| from.slerp(*to, share)).collect(),
        numbers: numbers.map(|(from, to)| from + (to - from) * share).collect(),
    };
    channels.into_parameters(first)
}

/// A pose as what is interpolated along arcs, and what is interpolated as numbers.
struct Channels {
    /// Those before the hands; then those of each flat hand.
    rotations: Vec<DQuat>,
    /// Expression, translation 3; then the numbers of each other hand.
    numbers: Vec<f64>,
}

impl Channels {
    fn of(parameters: &smplx::Parameters) -> Self {
        let mut rotations: Vec<DQuat> = parameters.before_hands().map(quaternion).collect();
        let numbers = parameters.expression.iter().copied().chain(parameters.transl.to_array());
        let mut numbers: Vec<f64> = numbers.map(f64::from).collect();
        for hand in [&parameters.left_hand_pose, &parameters.right_hand_pose] {
            match hand {
                HandPose::Flat(joints) => rotations.extend(joints.map(quaternion)),
                HandPose::RelativeToMean(joints) => {
                    numbers.extend(joints.iter().flat_map(|joint| joint.0.to_array()).map(f64::from));
                }
                HandPose::Pca(coefficients) => numbers.extend(coefficients.iter().copied().map(f64::from)),
            }
        }
        Self { rotations, numbers }
    }

    /// The weighted mean of poses, all of the kind of `centre`; quaternions on the half-sphere of its.
    fn mean<'a>(centre: &Self, weighted: impl Iterator<Item = (&'a Self, f64)>) -> Self {
        let mut rotations = vec![DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0); centre.rotations.len()];
        let mut numbers = vec![0.0; centre.numbers.len()];
        let mut total = 0.0;
        for (channels, weight) in weighted {
            total += weight;
            for ((sum, rotation), middle) in rotations.iter_mut().zip(&channels.rotations).zip(&centre.rotations) {
                let weight = if rotation.dot(*middle) < 0.0 { -weight } else { weight };
                *sum += *rotation * weight;
            }
            numbers.iter_mut().zip(&channels.numbers).for_each(|(sum, number)| *sum += weight * number);
        }
        numbers.iter_mut().for_each(|number| *number /= total);
        Self { rotations: rotations.into_iter().map(DQuat::normalize).collect(), numbers }
    }

    /// The parameters, with the shape and the hand conventions of `like`.
    fn into_parameters(self, like: &smplx::Parameters) -> smplx::Parameters {
        let mut rotations = self.rotations.into_iter().map(axis_angle);
        let before_hands = rotations.by_ref().take(joint::LEFT_HAND.start).collect();
        let mut numbers = self.numbers.into_iter().map(|number| number as f32);
        let mut number = || numbers.next().unwrap_or_default();
        let expression = like.expression.iter().map(|_| number()).collect();
        let transl = Vec3::new(number(), number(), number());
        let mut hand = |like: &HandPose| match HandConvention::of(like) {
            HandConvention::Flat => HandPose::Flat(std::array::from_fn(|_| rotations.next().unwrap_or_default())),
            HandConvention::RelativeToMean => HandPose::RelativeToMean(std::array::from_fn(|_| {
                PoseAxisAngle(Vec3::new(number(), number(), number()))
            })),
            HandConvention::Pca => {
                let count = if let HandPose::Pca(coefficients) = like { coefficients.len() } else { 0 };
                HandPose::Pca((0..count).map(|_| number()).collect())
            }
        };
        let (left_hand_pose, right_hand_pose) = (hand(&like.left_hand_pose), hand(&like.right_hand_pose));
        let pose = Pose { rotations: before_hands, shape: like.betas.clone(), expression, translation: transl };
        smplx::Parameters { left_hand_pose, right_hand_pose, ..smplx::Parameters::from(&pose) }
    }
}

fn quaternion(rotation: PoseAxisAngle) -> DQuat {
    DQuat::from_scaled_axis(rotation.0.as_dvec3())
}

/// With an angle of at most half a turn.
fn axis_angle(rotation: DQuat) -> PoseAxisAngle {
    let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
    PoseAxisAngle(rotation.to_scaled_axis().as_vec3())
}

#[cfg(test)]
mod tests {
    use super::*;
    use xavatar_body::Fingers;

    /// A pose that turns and walks evenly: `time` in seconds.
    fn even(time: f32, hands: fn(Fingers) -> HandPose) -> smplx::Parameters {
        let turn = |speed: f32| PoseAxisAngle(Vec3::new(0.6, 0.0, 0.8) * speed * time);
        smplx::Parameters {
            global_orient: turn(0.9),
            body_pose: std::array::from_fn(|joint| turn(0.05 * joint as f32)),
            jaw_pose: turn(0.1),
            left_hand_pose: hands(std::array::from_fn(|joint| turn(0.1 * joint as f32))),
            right_hand_pose: hands(std::array::from_fn(|joint| turn(-0.1 * joint as f32))),
            expression: vec![time; smplx::EXPRESSIONS],
            transl: Vec3::new(time, 2.0 * time, -time),
            ..Default::default()
        }
    }

    fn clip(count: usize, rate: f32, hands: fn(Fingers) -> HandPose) -> Vec<smplx::Parameters> {
        (0..count).map(|frame| even(frame as f32 / rate, hands)).collect()
    }

    fn assert_equal(found: &smplx::Parameters, expected: &smplx::Parameters) {
        let [found, expected] = [found, expected].map(Channels::of);
        for (found, expected) in found.rotations.iter().zip(&expected.rotations) {
            assert!(found.angle_between(*expected) < 1e-5, "{found} is not {expected}");
        }
        assert_eq!(found.numbers.len(), expected.numbers.len());
        for (found, expected) in found.numbers.iter().zip(&expected.numbers) {
            assert!((found - expected).abs() < 1e-5, "{found} is not {expected}");
        }
    }

    // Even turns about one axis are even at every rate.
    #[test]
    fn other_rates_show_the_same_movement() {
        for hands in [HandPose::Flat as fn(Fingers) -> HandPose, HandPose::RelativeToMean] {
            let frames = clip(31, 30.0, hands);
            for rate in [12.0, 24.0, 30.0, 50.0, 120.0] {
                let other = resampled(&frames, 30.0, rate).unwrap();
                assert_eq!(other.len(), rate as usize + 1);
                for (index, frame) in other.iter().enumerate() {
                    assert_equal(frame, &even(index as f32 / rate, hands));
                }
            }
            assert_eq!(resampled(&frames, 30.0, 30.0).unwrap(), frames);
        }
    }

    // 170 and -170 degrees are 20 apart.
    #[test]
    fn rotations_take_the_shorter_way() {
        let turned = |degrees: f32| smplx::Parameters {
            global_orient: PoseAxisAngle(Vec3::Y * degrees.to_radians()),
            ..Default::default()
        };
        let middle = between(&turned(170.0), &turned(-170.0), 0.5);
        assert!((middle.global_orient.0.length().to_degrees() - 180.0).abs() < 1e-3);
    }

    #[test]
    fn a_rate_that_would_fill_memory_is_refused() {
        let frames = clip(100, 30.0, HandPose::Flat);
        let error = resampled(&frames, 1e-6, 60.0).unwrap_err().to_string();
        assert!(error.contains("frames"), "{error}");
        assert_eq!(resampled(&frames[..1], 30.0, 60.0).unwrap().len(), 1);
    }

    #[test]
    fn smoothing_keeps_even_movement_and_halves_jitter() {
        let frames = clip(61, 30.0, HandPose::Flat);
        let smooth = smoothed(&frames, 2.0);
        assert_equal(&smooth[30], &frames[30]);
        let jittery: Vec<_> = frames
            .iter()
            .enumerate()
            .map(|(index, frame)| {
                let mut frame = frame.clone();
                frame.transl.x += if index % 2 == 0 { 0.01 } else { -0.01 };
                frame
            })
            .collect();
        let smooth = smoothed(&jittery, 2.0);
        for index in 10..50 {
            assert!((smooth[index].transl.x - frames[index].transl.x).abs() < 0.001);
        }
    }

    #[test]
    fn hands_of_changing_kinds_are_not_mixed() {
        let mut frames = clip(4, 30.0, HandPose::Flat);
        frames[2].left_hand_pose = HandPose::Pca(vec![0.5; 12]);
        let resampled = resampled(&frames, 30.0, 120.0).unwrap();
        assert_eq!(resampled.len(), 13);
        assert_eq!(smoothed(&frames, 3.0)[2].left_hand_pose, HandPose::Pca(vec![0.5; 12]));
    }
}
