//! Fitting: from a first guess through stages to the poses of all frames, the subject's shape and its clothing.

mod arms;
mod clothing;
mod hands;
mod multistart;
mod quality;
mod schedule;
mod sequence;
mod start;
mod subject;
mod verdict;

pub use clothing::Clothing;
pub use hands::fingers;
pub use multistart::{GOOD, Guess};
pub use quality::{FrameQuality, PartQuality};
pub use schedule::{Freed, Limbs, Stage};
pub use sequence::{Frame, Sequence};
pub use start::{from_landmarks, onto_landmarks};
pub use subject::{Fitter, Known, Shaped, Start};
pub use verdict::{doubtful, turned_hands};
