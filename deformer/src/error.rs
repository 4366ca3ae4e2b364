//! What can go wrong in the deformer.

/// Result of every fallible call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// The errors of the deformer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Bones, weights or part groups disagree about the skeleton.
    #[error("{name} is {found}, expected {expected}")]
    Skeleton {
        /// Which quantity.
        name: &'static str,
        /// What it is.
        found: String,
        /// What it has to be.
        expected: String,
    },
    /// A batch has another length than the points, bones or cells it belongs to.
    #[error("{name} has {found} elements, expected {expected}")]
    Length {
        /// Which batch.
        name: &'static str,
        /// How many elements it has.
        found: usize,
        /// How many it has to have.
        expected: usize,
    },
    /// A number outside its range.
    #[error("{name} is {found}, expected {expected}")]
    Value {
        /// Which quantity.
        name: &'static str,
        /// What it is.
        found: String,
        /// What it may be.
        expected: String,
    },
}

/// Refuses a batch whose length is not `expected`.
pub(crate) fn expect_length(name: &'static str, found: usize, expected: usize) -> Result<()> {
    if found == expected { Ok(()) } else { Err(Error::Length { name, found, expected }) }
}

/// Refuses a skeleton without bones, and weights (or their cotangents) that are not one row of all bones per `rows`.
pub(crate) fn expect_weights(name: &'static str, found: usize, rows: usize, bones: usize) -> Result<()> {
    if bones == 0 {
        let (found, expected) = ("empty".to_owned(), "one transform per bone".to_owned());
        return Err(Error::Skeleton { name: "the list of bone transforms", found, expected });
    }
    expect_length(name, found, rows * bones)
}
