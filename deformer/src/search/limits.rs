//! How far a start is followed.

/// When a start is finished.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits<T> {
    /// |g| below which a start has converged, metres.
    pub tolerance: T,
    /// |g| above which an updated start is given up, metres.
    pub divergence: T,
    /// How many times x is updated.
    pub updates: u32,
}
