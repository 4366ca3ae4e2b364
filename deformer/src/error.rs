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
}
