//! What a fit weighs: distance to the scan, distance to landmarks, and what is known of poses beforehand.

mod landmarks;
mod prior;
mod robust;
mod surface;

pub use landmarks::LandmarkTerm;
pub use prior::{PosePrior, add_expression};
pub use surface::{Dressed, SurfaceTerm};
