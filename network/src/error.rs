//! What can go wrong in a field.

/// Result of every fallible call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// The errors of the neural fields.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A network's description is inconsistent.
    #[error("network {name} is {found}, expected {expected}")]
    Shape {
        /// Which quantity.
        name: &'static str,
        /// What it is.
        found: String,
        /// What it may be.
        expected: String,
    },
    /// A stored parameter is absent or of another shape.
    #[error("parameter {name} is {found}, expected {expected}; the file was made by another preset or version")]
    Parameter {
        /// The parameter's name.
        name: String,
        /// What the file has.
        found: String,
        /// What the network needs.
        expected: String,
    },
}
