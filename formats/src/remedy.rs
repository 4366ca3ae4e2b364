//! What can be done about an error: words that hold for every program, and which choice of the caller would do it.
//!
//! A library, a notebook and a command line offer the same choices under different names. The words say what to do; a program that has an
//! option for the choice adds its own name for it.

use std::fmt;

use crate::shown::Shown;

/// What a user can do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Remedy(Box<Content>);

/// Behind a pointer: every result that may be an error carries its size.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Content {
    words: String,
    choice: Option<Choice>,
}

/// What a caller can choose that would help.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// To leave out frames that cannot be used.
    SkipBadFrames,
    /// To continue a run instead of starting one.
    ContinueRun,
    /// To start a run instead of continuing one.
    StartRun,
    /// To take data with this kind of fault as they are.
    Accept(&'static str),
    /// To have the check record how scans are brought to their bodies.
    RecordPlacement,
    /// To look at the data first.
    CheckData,
    /// To say which bone is which joint.
    BoneMap,
    /// To say which axis of a motion is up, or what its numbers are relative to.
    UpAxis,
    /// To say how many frames a second a motion has.
    FrameRate,
    /// To learn more slowly.
    LearningRate,
}

impl Remedy {
    /// Words for a choice that a caller has.
    pub fn choosing(choice: Choice, words: impl Into<String>) -> Self {
        Self(Box::new(Content { words: words.into(), choice: Some(choice) }))
    }

    /// What to do, in words.
    pub fn words(&self) -> &str {
        &self.0.words
    }

    /// The choice that does it, if it is one.
    pub fn choice(&self) -> Option<Choice> {
        self.0.choice
    }
}

impl<W: Into<String>> From<W> for Remedy {
    fn from(words: W) -> Self {
        Self(Box::new(Content { words: words.into(), choice: None }))
    }
}

impl fmt::Display for Remedy {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        Shown(&self.0.words).fmt(formatter)
    }
}
