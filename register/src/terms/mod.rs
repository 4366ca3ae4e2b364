//! What a fit weighs: distance to the scan, to landmarks and to neighbouring frames, and what is known of poses
//! beforehand.

mod landmarks;
mod motion;
mod prior;
mod robust;
mod surface;

pub use landmarks::LandmarkTerm;
pub use motion::MotionTerm;
pub use prior::{PosePrior, add_expression};
pub use surface::{Dressed, SurfaceTerm};
