//! What can be wrong with what a user gave, as data: each variant names the thing, what was found, and the remedy.
//!
//! The data is as it was found, in a file or a path, so every message shows it through [`Shown`]: on one line, cut, and with nothing
//! in it that a terminal obeys.

use std::path::{Path, PathBuf};

use crate::Remedy;
use crate::shown::Shown;

/// Result of every fallible call of the crates that read and look at what users have.
pub type Result<T> = std::result::Result<T, Error>;

/// What is wrong with a file or a value. Messages name the file, what was found, what was expected and the next step.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused a read or write.
    #[error("{path}: {source}", source = Shown(source), path = Shown(path.display()))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file or folder that has to be there is not.
    #[error("{path}: {what} not found; {remedy}", path = Shown(path.display()), what = Shown(what))]
    Missing {
        /// Where it was looked for.
        path: PathBuf,
        /// What is missing.
        what: String,
        /// What the user can do.
        remedy: Remedy,
    },
    /// A file does not follow its format.
    #[error(
        "{path}: not a valid {format}: {place} is {found}, expected {expected}",
        path = Shown(path.display()), place = Shown(place), found = Shown(found), expected = Shown(expected)
    )]
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
    /// A file asks for code to be run, or for what only a decompression bomb holds.
    #[error(
        "{path}: refused: {found}; only plain numbers, strings and arrays are read",
        path = Shown(path.display()), found = Shown(found)
    )]
    Refused {
        /// The file.
        path: PathBuf,
        /// What it asked for.
        found: String,
    },
    /// A file asks for more memory than its size can explain, or than there is.
    #[error(
        "{path}: {purpose} takes {bytes} bytes of memory, {limit}",
        path = Shown(path.display()), purpose = Shown(purpose)
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// What in it, and what the memory is for.
        purpose: String,
        /// How much it takes, bytes.
        bytes: u64,
        /// Which limit that is beyond.
        limit: MemoryLimit,
    },
    /// A valid file that is not what the command needs (an SMPL model for SMPL-X, a wrong gender, ...).
    #[error(
        "{path}: {found}, expected {expected}; {remedy}",
        path = Shown(path.display()), found = Shown(found), expected = Shown(expected)
    )]
    Mismatch {
        /// The file.
        path: PathBuf,
        /// What it holds.
        found: String,
        /// What is needed.
        expected: String,
        /// What the user can do.
        remedy: Remedy,
    },
    /// A file that is in none of the formats that it could be in.
    #[error("{path}: no {what} that can be read:{tried}\n{remedy}", path = Shown(path.display()), tried = Indented(tried))]
    Unrecognised {
        /// The file.
        path: PathBuf,
        /// What was looked for.
        what: &'static str,
        /// Each format, and why the file is not in it.
        tried: Vec<String>,
        /// Where the formats are described.
        remedy: Remedy,
    },
    /// A skeleton whose bones' names do not say which joints of a body they are.
    #[error(
        "{path}: a skeleton in which no bone is known as {missing}; {remedy}:{map}",
        path = Shown(path.display()), missing = Shown(missing), map = Indented(map)
    )]
    UnknownBones {
        /// The file.
        path: PathBuf,
        /// The joints that no bone is known as.
        missing: String,
        /// A map of the bones to start from, in TOML, a line each.
        map: Vec<String>,
        /// What to do with it.
        remedy: Remedy,
    },
    /// A value outside its range, or an array of the wrong shape, passed by a caller or a configuration.
    #[error("{name} is {found}, expected {expected}", name = Shown(name), found = Shown(found), expected = Shown(expected))]
    Value {
        /// The name of the value.
        name: String,
        /// What it is.
        found: String,
        /// What it may be.
        expected: String,
    },
    /// Data that can be read, and that nothing good can be made of.
    #[error("{message}; {remedy}", message = Shown(message))]
    Unfit {
        /// What was found, with the figure, and what to do.
        message: String,
        /// How to take it as it is.
        remedy: Remedy,
    },
    /// One frame of a sequence could not be used.
    #[error("frame {frame}: {source}", frame = Shown(frame))]
    Frame {
        /// The frame, as `split/sequence/number`.
        frame: String,
        /// Why.
        source: Box<Error>,
    },
}

/// What bounds the memory that a file may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemoryLimit {
    /// A budget in proportion to the file's size.
    OfFile {
        /// The file's size.
        file_bytes: u64,
        /// What a file of this size may take.
        bytes: u64,
    },
    /// What the system gives.
    OfSystem,
}

impl std::fmt::Display for MemoryLimit {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OfFile { file_bytes, bytes } => {
                write!(formatter, "of the {bytes} that a file of {file_bytes} bytes may take in all; ")?;
                formatter.write_str("if it is honest, save it uncompressed or in parts")
            }
            Self::OfSystem => formatter.write_str("which the system does not have; close other programs or add memory"),
        }
    }
}

/// Lines, each indented on a line of its own.
struct Indented<'a>(&'a [String]);

impl std::fmt::Display for Indented<'_> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|line| write!(formatter, "\n  {}", Shown(line)))
    }
}

impl Error {
    /// An I/O error at `path`; for `map_err`.
    pub fn io(path: impl AsRef<Path>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.as_ref().to_path_buf();
        move |source| Self::Io { path, source }
    }

    /// What the user can do, where that is known.
    pub fn remedy(&self) -> Option<&Remedy> {
        match self {
            Self::Missing { remedy, .. }
            | Self::Mismatch { remedy, .. }
            | Self::Unrecognised { remedy, .. }
            | Self::UnknownBones { remedy, .. }
            | Self::Unfit { remedy, .. } => Some(remedy),
            Self::Frame { source, .. } => source.remedy(),
            _ => None,
        }
    }

    /// Names the frame in which `self` happened.
    #[must_use]
    pub fn in_frame(self, frame: impl Into<String>) -> Self {
        Self::Frame { frame: frame.into(), source: Box::new(self) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An error of every kind, with `text` wherever one has text that may come from a file.
    fn every_error(text: &str) -> Vec<Error> {
        let (path, text) = (PathBuf::from(text), text.to_owned());
        let system = || std::io::Error::other(text.clone());
        let errors = vec![
            Error::Io { path: path.clone(), source: system() },
            Error::Missing { path: path.clone(), what: text.clone(), remedy: text.as_str().into() },
            Error::Malformed {
                path: path.clone(),
                format: "npz archive",
                place: text.clone(),
                found: text.clone(),
                expected: text.clone(),
            },
            Error::Refused { path: path.clone(), found: text.clone() },
            Error::TooLarge { path: path.clone(), purpose: text.clone(), bytes: 1, limit: MemoryLimit::OfSystem },
            Error::Mismatch {
                path: path.clone(),
                found: text.clone(),
                expected: text.clone(),
                remedy: text.as_str().into(),
            },
            Error::Unrecognised {
                path: path.clone(),
                what: "motion",
                tried: vec![text.clone()],
                remedy: "convert it".into(),
            },
            Error::UnknownBones {
                path: path.clone(),
                missing: text.clone(),
                map: vec![text.clone()],
                remedy: text.as_str().into(),
            },
            Error::Value { name: text.clone(), found: text.clone(), expected: text.clone() },
            Error::Unfit { message: text.clone(), remedy: "scan again".into() },
            Error::Frame { frame: text.clone(), source: Box::new(Error::Io { path, source: system() }) },
        ];
        for error in &errors {
            // A new kind of error does not compile here: add it to the list above.
            match error {
                Error::Io { .. }
                | Error::Missing { .. }
                | Error::Malformed { .. }
                | Error::Refused { .. }
                | Error::TooLarge { .. }
                | Error::Mismatch { .. }
                | Error::Unrecognised { .. }
                | Error::UnknownBones { .. }
                | Error::Value { .. }
                | Error::Unfit { .. }
                | Error::Frame { .. } => {}
            }
        }
        errors
    }

    #[test]
    fn no_message_carries_what_a_terminal_obeys_or_more_than_a_screen() {
        for error in every_error("\u{1b}]0;title\u{7}\n\u{9b}2J\r") {
            let message = error.to_string();
            let lines = match error {
                Error::Unrecognised { .. } => 3,
                Error::UnknownBones { .. } => 2,
                _ => 1,
            };
            assert_eq!(message.lines().count(), lines, "{message:?}");
            assert!(!message.chars().any(|character| character.is_control() && character != '\n'), "{message:?}");
        }
        for error in every_error(&"x".repeat(100_000)) {
            let message = error.to_string();
            assert!(message.len() < 4000, "{} bytes: {}", message.len(), &message[..80]);
        }
    }
}
