//! What is wrong with a file, before its path is known: parsers work on bytes.

use std::path::Path;

use xavatar_formats::Error;

/// Result of parsing.
pub(super) type Parsed<T> = std::result::Result<T, Fault>;

#[derive(Debug)]
pub(super) struct Fault {
    place: String,
    found: String,
    expected: String,
}

impl Fault {
    pub(super) fn new(place: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { place: place.into(), found: found.into(), expected: expected.into() }
    }

    pub(super) fn in_file(self, path: &Path, format: &'static str) -> Error {
        let Self { place, found, expected } = self;
        Error::Malformed { path: path.into(), format, place, found, expected }
    }
}
