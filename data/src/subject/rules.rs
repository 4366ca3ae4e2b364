//! What the numbers of a subject's files mean: where zero is, in which unit, of which hand.

use glam::Vec3;
use serde::Deserialize;

use super::unseen::UnseenParts;
use crate::placement::{Origin, ScanPlacement};
use xavatar_body::smplx::joint;
use xavatar_body::{BodyModel, BodyParameters, Gender, HandPose, PoseAxisAngle};
use xavatar_formats::{Error, Result};

/// What zero is in a registration's hand poses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HandZero {
    /// The model's relaxed hand, smplx's default (`flat_hand_mean=False`).
    #[default]
    Relative,
    /// The flat hand (`flat_hand_mean=True`).
    Flat,
}

/// What a layout's numbers mean.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Conventions {
    /// Of the model that all its subjects were registered with.
    pub gender: Option<Gender>,
    pub hands: HandZero,
    /// What the scans' coordinates count from.
    pub origin: Origin,
}

/// How the files of one subject are read.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rules {
    pub(super) hands: HandZero,
    /// Applied to scans one after the other.
    pub(super) placements: Vec<ScanPlacement>,
    /// What depends on the body model; settled once the model is known.
    pub(super) settled: Option<Settled>,
    /// What scans do not show, whose registration is a guess.
    pub(super) unseen: UnseenParts,
}

/// Three numbers a joint of a hand.
type HandComponent = [f32; 3 * joint::HAND];

/// What of a body model, in a subject's shape, the meaning of files depends on.
#[derive(Clone, Debug)]
pub(crate) struct Settled {
    /// At rest, metres.
    pelvis: Vec3,
    /// Principal components of the left and the right hand, one a row.
    hand_components: [Vec<HandComponent>; 2],
}

impl Settled {
    pub(super) fn of(body: &BodyModel, betas: &[f32]) -> Result<Self> {
        let standing = body.pose(&body.skeleton().rest_pose().in_shape(betas))?;
        let components = |side: usize| body.hands().get(side).map_or_else(Vec::new, |hand| hand.components.clone());
        Ok(Self { pelvis: standing.joints[0], hand_components: [components(0), components(1)] })
    }
}

impl Rules {
    /// Where an origin is in a frame of these parameters.
    ///
    /// # Errors
    /// [`Error::Value`] for the pelvis, if no body model settles where that is.
    pub(super) fn place_of(&self, origin: Origin, parameters: &BodyParameters) -> Result<Vec3> {
        match origin {
            Origin::World => Ok(Vec3::ZERO),
            Origin::Translation => Ok(parameters.translation()),
            Origin::Pelvis => Ok(self.settled("the scans' origin, the pelvis,")?.pelvis + parameters.translation()),
        }
    }

    /// A hand (0 left, 1 right) in this subject's convention, as one that says its convention itself.
    ///
    /// # Errors
    /// [`Error::Value`] for coefficients relative to the flat hand, if no body model settles what they are of, or of more than its.
    pub(super) fn hand(&self, side: usize, pose: HandPose) -> Result<HandPose> {
        match (self.hands, pose) {
            (HandZero::Flat, HandPose::RelativeToMean(rotations)) => Ok(HandPose::Flat(rotations)),
            (HandZero::Flat, HandPose::Pca(coefficients)) => {
                let components =
                    &self.settled("a hand in coefficients relative to the flat hand")?.hand_components[side];
                flat_hand(&coefficients, components)
            }
            (_, pose) => Ok(pose),
        }
    }

    fn settled(&self, what: &str) -> Result<&Settled> {
        self.settled.as_ref().ok_or_else(|| Error::Value {
            name: what.into(),
            found: "unknown without a body model".into(),
            expected: "the subject settled with its body model first".into(),
        })
    }
}

fn flat_hand(coefficients: &[f32], components: &[HandComponent]) -> Result<HandPose> {
    if coefficients.len() > components.len() {
        return Err(Error::Value {
            name: "hand pose".into(),
            found: format!("{} PCA coefficients", coefficients.len()),
            expected: format!("at most {}, the components of the model", components.len()),
        });
    }
    let value = |index: usize| -> f32 {
        coefficients.iter().zip(components).map(|(coefficient, component)| coefficient * component[index]).sum()
    };
    Ok(HandPose::Flat(std::array::from_fn(|joint| {
        PoseAxisAngle(Vec3::from_array(std::array::from_fn(|axis| value(3 * joint + axis))))
    })))
}

#[cfg(test)]
mod tests {
    use super::*;
    use xavatar_body::Pose;

    #[test]
    fn flat_hands_are_sums_of_components_without_the_mean() {
        let mut components = vec![[0.0; 3 * joint::HAND]; 2];
        components[0][3] = 1.0;
        components[1][44] = 0.5;
        let HandPose::Flat(joints) = flat_hand(&[2.0, -4.0], &components).unwrap() else { panic!("absolute") };
        assert_eq!(joints[1].0, Vec3::new(2.0, 0.0, 0.0));
        assert_eq!(joints[14].0, Vec3::new(0.0, 0.0, -2.0));
        assert!(flat_hand(&[0.0; 3], &components).is_err());
    }

    #[test]
    fn what_needs_a_body_model_says_so() {
        let rules = Rules { hands: HandZero::Flat, ..Rules::default() };
        assert!(rules.hand(0, HandPose::Pca(vec![1.0])).unwrap_err().to_string().contains("body model"));
        assert!(rules.place_of(Origin::Pelvis, &Pose::default().into()).is_err());
        let relative = HandPose::RelativeToMean(Default::default());
        assert_eq!(rules.hand(1, relative.clone()).unwrap(), HandPose::Flat(Default::default()));
        assert_eq!(Rules::default().hand(1, relative.clone()).unwrap(), relative);
    }
}
