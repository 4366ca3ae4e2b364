//! Canonical <-> deformed space: linear blend skinning and the part-aware correspondence search (thesis ch. 4.2.2-4.2.3).
//!
//! Knows skinning weights and bone transforms, nothing of bodies or files.

mod error;

pub use error::{Error, Result};
