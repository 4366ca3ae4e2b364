//! Why there is no mesh of a field.

/// Why a surface could not be extracted.
#[derive(Debug, thiserror::Error)]
pub enum ExtractionError {
    /// The field has no surface inside the box that was searched.
    #[error("no surface: the values range from {minimum} to {maximum}, the surface is at {level}")]
    NoSurface {
        /// Smallest value seen.
        minimum: f32,
        /// Largest value seen.
        maximum: f32,
        /// The level that was searched for.
        level: f32,
    },
    /// The grid is out of range, or a value is not finite.
    #[error(transparent)]
    Input(#[from] xavatar_formats::Error),
}
