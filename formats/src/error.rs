//! What can be wrong with what a user gave, as data: each variant names the thing, what was found, and the remedy.

use std::path::{Path, PathBuf};

/// Result of every fallible call of the crates that read and look at what users have.
pub type Result<T> = std::result::Result<T, Error>;

/// What is wrong with a file or a value. Messages name the file, what was found, what was expected and the next step.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused a read or write.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file or folder that has to be there is not.
    #[error("{path}: {what} not found; {remedy}", path = path.display())]
    Missing {
        /// Where it was looked for.
        path: PathBuf,
        /// What is missing.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// A file does not follow its format.
    #[error("{path}: not a valid {format}: {place} is {found}, expected {expected}", path = path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The format it was read as.
        format: &'static str,
        /// Byte offset, key or line.
        place: String,
        /// What stands there.
        found: String,
        /// What should stand there.
        expected: String,
    },
    /// A file asks for code to be run, or for more memory than its size can explain.
    #[error("{path}: refused: {found}; only plain numbers, strings and arrays are read", path = path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// What it asked for.
        found: String,
    },
    /// A valid file that is not what the command needs (an SMPL model for SMPL-X, a wrong gender, ...).
    #[error("{path}: {found}, expected {expected}; {remedy}", path = path.display())]
    Mismatch {
        /// The file.
        path: PathBuf,
        /// What it holds.
        found: String,
        /// What is needed.
        expected: String,
        /// What the user can do.
        remedy: String,
    },
    /// A file that is in none of the formats that it could be in.
    #[error("{path}: no {what} that can be read:\n  {tried}\n{remedy}", path = path.display(), tried = tried.join("\n  "))]
    Unrecognised {
        /// The file.
        path: PathBuf,
        /// What was looked for.
        what: &'static str,
        /// Each format, and why the file is not in it.
        tried: Vec<String>,
        /// Where the formats are described.
        remedy: &'static str,
    },
    /// A value outside its range, or an array of the wrong shape, passed by a caller or a configuration.
    #[error("{name} is {found}, expected {expected}")]
    Value {
        /// The name of the value.
        name: String,
        /// What it is.
        found: String,
        /// What it may be.
        expected: String,
    },
    /// Data that can be read, and that nothing good can be made of.
    #[error("{message} (--accept {defect} takes it as it is)")]
    Unfit {
        /// The kind of fault, by the name under which it can be accepted.
        defect: &'static str,
        /// What was found, with the figure, and what to do.
        message: String,
    },
    /// One frame of a sequence could not be used.
    #[error("frame {frame}: {source}")]
    Frame {
        /// The frame, as `split/sequence/number`.
        frame: String,
        /// Why.
        source: Box<Error>,
    },
}

impl Error {
    /// An I/O error at `path`; for `map_err`.
    pub fn io(path: impl AsRef<Path>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.as_ref().to_path_buf();
        move |source| Self::Io { path, source }
    }

    /// Names the frame in which `self` happened.
    #[must_use]
    pub fn in_frame(self, frame: impl Into<String>) -> Self {
        Self::Frame { frame: frame.into(), source: Box::new(self) }
    }
}
