//! What a format reader finds wrong, before it is known which file the bytes came from.
//!
//! Readers of bytes return a [`Fault`]; readers of paths turn it into an [`Error`] that names the file.

use std::path::Path;

use crate::Error;
use crate::error::MemoryLimit;

/// Why bytes could not be read.
#[derive(Debug)]
pub enum Fault {
    /// The bytes break the format's rules.
    Malformed {
        /// Byte offset, key or field.
        place: String,
        /// What stands there.
        found: String,
        /// What should stand there.
        expected: String,
    },
    /// The bytes ask for code to be run.
    Refused(String),
    /// The bytes ask for more memory than their size can explain, or than there is.
    TooLarge {
        /// What the memory is for.
        purpose: String,
        /// How much, bytes.
        bytes: u64,
        /// Which limit that is beyond.
        limit: MemoryLimit,
    },
}

impl Fault {
    /// That `found` stands at `place` instead of `expected`.
    pub fn malformed(
        place: impl std::fmt::Display,
        found: impl std::fmt::Display,
        expected: impl std::fmt::Display,
    ) -> Self {
        Self::Malformed { place: place.to_string(), found: found.to_string(), expected: expected.to_string() }
    }

    /// That the bytes ask for something that is not done.
    pub fn refused(found: impl std::fmt::Display) -> Self {
        Self::Refused(found.to_string())
    }

    pub(crate) fn too_large(purpose: impl std::fmt::Display, bytes: usize, limit: MemoryLimit) -> Self {
        Self::TooLarge { purpose: purpose.to_string(), bytes: bytes as u64, limit }
    }

    /// The same fault, inside the named part of a larger file.
    pub fn within(self, part: &str) -> Self {
        match self {
            Self::Malformed { place, found, expected } => {
                Self::Malformed { place: format!("{part}, {place}"), found, expected }
            }
            Self::Refused(found) => Self::Refused(format!("{part} asks for {found}")),
            Self::TooLarge { purpose, bytes, limit } => {
                Self::TooLarge { purpose: format!("{part}, {purpose}"), bytes, limit }
            }
        }
    }

    /// The fault as the library's error about the file at `path`, read as `format`.
    pub fn in_file(self, path: &Path, format: &'static str) -> Error {
        let path = path.to_path_buf();
        match self {
            Self::Malformed { place, found, expected } => Error::Malformed { path, format, place, found, expected },
            Self::Refused(found) => Error::Refused { path, found },
            Self::TooLarge { purpose, bytes, limit } => Error::TooLarge { path, purpose, bytes, limit },
        }
    }
}

/// The first characters of untrusted text, quoted and escaped, so that a message stays one short line.
pub fn excerpt(text: &str) -> String {
    const SHOWN: usize = 60;
    let mut shown: String = text.chars().take(SHOWN).collect();
    if shown.len() < text.len() {
        shown.push('…');
    }
    format!("{shown:?}")
}
