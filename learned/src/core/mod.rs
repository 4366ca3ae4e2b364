//! What every training of a body shares (METHOD-BODY section 3): the pose of a registration, un-posing, template and joints of a subject, weights,
//! shapes, the file.

mod cholesky;
mod file;
mod fitted_body;
mod gathered;
mod identity;
mod mirror;
mod person;
mod pose_fit;
mod procrustes;
mod shapes;
mod skin;
mod unposing;
mod weights;

pub use cholesky::Factor;
pub use file::{Family, trained_arrays};
pub use fitted_body::FittedBody;
pub use identity::{Identity, IdentityMoments, SkinningRows};
pub use mirror::Mirror;
pub use person::{Person, undriven, with_identity};
pub use pose_fit::{Fitted, PoseFit};
pub use shapes::{Shapes, joint_rows, shapes_of};
pub use skin::{mean_identity, shaped, weight_rows, with_skin};
pub use unposing::{features, unposed};
pub use weights::{Grown, WeightMoments, WeightRow};
