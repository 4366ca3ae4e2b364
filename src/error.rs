//! What can go wrong, as data: each variant names the thing, what was found, and the remedy.

use xavatar_formats::{Choice, Error as InputError, Remedy, Shown};
use xavatar_mesh::ExtractionError;

/// Result of every fallible call of this library.
pub type Result<T> = std::result::Result<T, Error>;

/// The errors of this library. Messages name the file, what was found, what was expected and the next step.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or a value that was given.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A configuration key that does not exist.
    #[error("unknown setting `{key}`; did you mean `{nearest}`?", key = Shown(key))]
    UnknownSetting {
        /// The key as given.
        key: String,
        /// The known key closest to it.
        nearest: String,
    },
    /// One frame of a sequence could not be used.
    #[error("frame {frame}: {source}", frame = Shown(frame))]
    Frame {
        /// The frame, as `split/sequence/number`.
        frame: String,
        /// Why.
        source: Box<Error>,
    },
    /// The field has no surface inside the box that was searched.
    #[error(
        "the field has no surface: its values range from {minimum} to {maximum}, the surface is at {level}; train longer, or check the data"
    )]
    NoSurface {
        /// Smallest value seen.
        minimum: f32,
        /// Largest value seen.
        maximum: f32,
        /// The level that was searched for.
        level: f32,
    },
    /// A loss or gradient stopped being a number.
    #[error(
        "{what} became non-finite at step {step}, frame {frame}; the last checkpoint is kept: continue it with a smaller learning rate",
        frame = Shown(frame)
    )]
    NonFinite {
        /// Which quantity.
        what: String,
        /// The step.
        step: u64,
        /// The frame, as `split/sequence/number`.
        frame: String,
    },
    /// From the neural fields.
    #[error(transparent)]
    Network(#[from] xavatar_network::Error),
    /// From the deformer.
    #[error(transparent)]
    Deformer(#[from] xavatar_deformer::Error),
}

impl Error {
    /// The choice of the caller that would help, where there is one.
    pub fn choice(&self) -> Option<Choice> {
        match self {
            Self::Input(error) => error.remedy().and_then(Remedy::choice),
            Self::Frame { source, .. } => source.choice(),
            Self::NoSurface { .. } => Some(Choice::CheckData),
            Self::NonFinite { .. } => Some(Choice::LearningRate),
            Self::UnknownSetting { .. } | Self::Network(_) | Self::Deformer(_) => None,
        }
    }

    /// Names the frame in which `self` happened.
    #[must_use]
    pub fn in_frame(self, frame: impl Into<String>) -> Self {
        Self::Frame { frame: frame.into(), source: Box::new(self) }
    }
}

impl From<ExtractionError> for Error {
    fn from(error: ExtractionError) -> Self {
        match error {
            ExtractionError::NoSurface { minimum, maximum, level } => Self::NoSurface { minimum, maximum, level },
            ExtractionError::Input(error) => Self::Input(error),
        }
    }
}
