//! What a check finds wrong with a subject, each kind by a name under which it can be accepted.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use xavatar_formats::{Choice, Error};

/// A kind of fault in a subject's data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Defect {
    /// Nothing to train on.
    NoFrames,
    /// Frames that cannot be read.
    Unreadable,
    /// A scan that is no surface of a body: too few faces, no area, flat, faces that do not hang together.
    NoSurface,
    /// Scans that show more than the person: ground, or what floats around.
    Surroundings,
    /// Scans in another unit than metres.
    Unit,
    /// Scans that are turned against their bodies: another axis up, another side in front.
    Turned,
    /// Scans that are mirror images of their bodies.
    Mirrored,
    /// Scans that are elsewhere than their bodies.
    Shifted,
    /// Registrations of other frames than their scans.
    OtherFrame,
    /// Bodies that fit their scans in no place and pose.
    OtherPerson,
    /// A part of the body that is not where the scan has it.
    Slipped,
    /// A part of the body that the scan does not have.
    Missing,
    /// A part of the body that the scan has twice.
    Doubled,
    /// Scans with a second wall inside.
    Hollow,
    /// Scans so open that their inside is not one.
    Open,
    /// Scans whose faces are seen from inside.
    InsideOut,
    /// Cameras that do not see the body where their pictures show it.
    Camera,
    /// No frame to measure on.
    NoTestFrames,
    /// A body that is too tall or too small for a person.
    BodyHeight,
    /// Frames that were each registered with a shape of its own.
    Shapes,
    /// Hand poses that seem to be stored in another convention.
    Hands,
    /// Parameters that no registration has.
    Incomplete,
    /// Things in scans' files that could not be read.
    Lost,
    /// Scans without colours.
    NoColours,
    /// Scans with holes.
    Holes,
    /// Pictures in which the subject is small.
    FewPoints,
}

impl Defect {
    /// All kinds, the graver first.
    pub const ALL: [Self; 26] = [
        Self::NoFrames,
        Self::Unreadable,
        Self::NoSurface,
        Self::Surroundings,
        Self::Unit,
        Self::Turned,
        Self::Mirrored,
        Self::Shifted,
        Self::OtherFrame,
        Self::OtherPerson,
        Self::Slipped,
        Self::Missing,
        Self::Doubled,
        Self::Hollow,
        Self::Open,
        Self::InsideOut,
        Self::Camera,
        Self::NoTestFrames,
        Self::BodyHeight,
        Self::Shapes,
        Self::Hands,
        Self::Incomplete,
        Self::Lost,
        Self::NoColours,
        Self::Holes,
        Self::FewPoints,
    ];

    /// Its name, in a command and in JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoFrames => "no-frames",
            Self::Unreadable => "unreadable",
            Self::NoSurface => "no-surface",
            Self::Surroundings => "surroundings",
            Self::Unit => "unit",
            Self::Turned => "turned",
            Self::Mirrored => "mirrored",
            Self::Shifted => "shifted",
            Self::OtherFrame => "other-frame",
            Self::OtherPerson => "other-person",
            Self::Slipped => "slipped",
            Self::Missing => "missing",
            Self::Doubled => "doubled",
            Self::Hollow => "hollow",
            Self::Open => "open",
            Self::InsideOut => "inside-out",
            Self::Camera => "camera",
            Self::NoTestFrames => "no-test-frames",
            Self::BodyHeight => "body-height",
            Self::Shapes => "shapes",
            Self::Hands => "hands",
            Self::Incomplete => "incomplete",
            Self::Lost => "lost",
            Self::NoColours => "no-colours",
            Self::Holes => "holes",
            Self::FewPoints => "few-points",
        }
    }

    /// Whether training on such data fails or gives another person's avatar; the others are warnings.
    #[must_use]
    pub const fn is_problem(self) -> bool {
        (self as u8) <= (Self::Camera as u8)
    }
}

impl fmt::Display for Defect {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for Defect {
    type Err = Error;

    fn from_str(text: &str) -> xavatar_formats::Result<Self> {
        let named = Self::ALL.into_iter().find(|defect| defect.name() == text.trim());
        named.ok_or_else(|| Error::Value {
            name: "finding".into(),
            found: format!("{:?}", text.chars().take(40).collect::<String>()),
            expected: format!("one of {}", Self::ALL.map(Self::name).join(", ")),
        })
    }
}

impl Serialize for Defect {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// One thing that is wrong with a subject, or with some of its frames.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What kind of fault it is.
    pub name: Defect,
    /// What was found, with the figure, and what to do.
    pub message: String,
    /// The frames it was found in, as `split/sequence/number`; none if it is of the subject as a whole.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<String>,
    /// What a caller can choose that helps.
    #[serde(skip)]
    pub choice: Option<Choice>,
}

impl Finding {
    /// A fault of the subject as a whole.
    pub(crate) fn of_subject(name: Defect, message: impl Into<String>) -> Self {
        let choice = (name == Defect::Unreadable).then_some(Choice::SkipBadFrames);
        Self { name, message: message.into(), frames: Vec::new(), choice }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.name, self.message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_defect_is_known_by_its_name_and_by_no_other() {
        for defect in Defect::ALL {
            assert_eq!(defect.name().parse::<Defect>().unwrap(), defect);
        }
        let error = "upside-down".parse::<Defect>().unwrap_err().to_string();
        assert!(error.contains("upside-down") && error.contains("turned, mirrored"), "{error}");
    }

    #[test]
    fn problems_stand_before_warnings() {
        let problems = Defect::ALL.iter().take_while(|defect| defect.is_problem()).count();
        assert!(Defect::ALL[problems..].iter().all(|defect| !defect.is_problem()));
        assert!(Defect::Camera.is_problem() && !Defect::NoTestFrames.is_problem());
    }
}
