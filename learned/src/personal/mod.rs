//! A body of one person from one registration or a few (AVATAR, Osman ch. 6): template, joints and correctives, and how sure the correctives are.
//!
//! Template and joints are least squares with the body's correctives in place, in turn with the poses (`fit`). What is left of the registrations at rest
//! moves the correctives by Bayes' rule (`posterior`), only where a joint reaches; how far they may move, and how noisy registrations are, are
//! those for which what is seen is most probable (`evidence`). One scan tells one direction of features: elsewhere they stay the body's, and
//! say so by their variance.

mod evidence;
mod file;
mod fit;
mod posterior;
mod support;

pub use evidence::{Scales, log_evidence};
pub use fit::{Personal, personal};
pub use posterior::Posterior;
pub use support::Support;
