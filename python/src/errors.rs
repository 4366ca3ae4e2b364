//! Errors of the library as exceptions of the package (`xavatar.errors`), with the remedy in the words of a caller in Python.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use xavatar::formats::{Choice, Remedy};
use xavatar::{Error, InputError};

/// Results of the library, to be raised.
pub trait Raise<T> {
    /// The value, or the exception for the error.
    fn or_raise(self) -> PyResult<T>;
}

impl<T, E: Into<Error>> Raise<T> for Result<T, E> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| raised(&error.into()))
    }
}

/// An argument that is not what it has to be.
pub fn refused(name: &str, found: impl ToString, expected: impl Into<String>) -> PyErr {
    raised(&InputError::Value { name: name.into(), found: found.to_string(), expected: expected.into() }.into())
}

/// The exception for an error.
pub fn raised(error: &Error) -> PyErr {
    let remedy = error.choice().map(argument).or_else(|| remedy_of(error).map(|remedy| remedy.words().to_owned()));
    let message = match error.choice().map(argument) {
        Some(argument) => format!("{error} ({argument})"),
        None => error.to_string(),
    };
    Python::attach(|py| exception(py, class_of(error), &message, remedy, frame_of(error)).unwrap_or_else(|error| error))
}

fn exception(
    py: Python<'_>,
    class: &str,
    message: &str,
    remedy: Option<String>,
    frame: Option<&str>,
) -> PyResult<PyErr> {
    let attributes = PyDict::new(py);
    attributes.set_item("remedy", remedy)?;
    attributes.set_item("frame", frame)?;
    let class = py.import("xavatar.errors")?.getattr(class)?;
    Ok(PyErr::from_value(class.call((message,), Some(&attributes))?))
}

/// The name of its class in `xavatar.errors`.
fn class_of(error: &Error) -> &'static str {
    match error {
        Error::Input(error) => class_of_input(error),
        Error::UnknownSetting { .. } => "ArgumentError",
        Error::Frame { source, .. } => class_of(source),
        Error::NoSurface { .. } | Error::NonFinite { .. } => "TrainingError",
        _ => "Error",
    }
}

fn class_of_input(error: &InputError) -> &'static str {
    match error {
        InputError::Io { .. } => "FileError",
        InputError::Missing { .. } => "MissingError",
        InputError::Refused { .. } => "RefusedError",
        InputError::Value { .. } => "ArgumentError",
        InputError::Unfit { .. } => "UnfitError",
        InputError::Frame { source, .. } => class_of_input(source),
        InputError::Malformed { .. }
        | InputError::TooLarge { .. }
        | InputError::Mismatch { .. }
        | InputError::Unrecognised { .. }
        | InputError::UnknownBones { .. } => "FormatError",
        _ => "Error",
    }
}

fn remedy_of(error: &Error) -> Option<&Remedy> {
    match error {
        Error::Input(error) => error.remedy(),
        Error::Frame { source, .. } => remedy_of(source),
        _ => None,
    }
}

fn frame_of(error: &Error) -> Option<&str> {
    match error {
        Error::Frame { frame, .. } | Error::Input(InputError::Frame { frame, .. }) => Some(frame),
        _ => None,
    }
}

/// What a caller in Python writes for a choice.
pub fn argument(choice: Choice) -> String {
    match choice {
        Choice::SkipBadFrames => "train(..., skip_bad_frames=True)".into(),
        Choice::ContinueRun => "the same call of train() again".into(),
        Choice::StartRun => "train(..., out=another folder)".into(),
        Choice::Accept(defect) => format!("train(..., accept=[{defect:?}])"),
        Choice::RecordPlacement => "xavatar check --fix".into(),
        Choice::CheckData => "Subject.open(data, body).check()".into(),
        Choice::BoneMap => "read_motion(..., bones={\"Hips\": \"pelvis\"})".into(),
        Choice::UpAxis => "read_motion(..., up=\"Z\"), or coordinates=\"camera\"".into(),
        Choice::FrameRate => "read_motion(..., source_rate=30)".into(),
        Choice::LearningRate => "train(..., settings={\"optimiser.learning_rate\": ...})".into(),
    }
}
