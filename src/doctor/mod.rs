//! What this machine is, and how fast: what `xavatar doctor` says, and what the performance bench measures with.

mod facts;
mod networks;
mod programs;
mod search;
mod self_test;
mod timing;

pub use facts::Facts;
pub use networks::{NetworkCase, NetworkSpeed, Networks};
pub use programs::{OptionalProgram, optional_programs};
pub use search::{PosedSubject, SearchSpeed};
pub use self_test::{Figure, self_test};
pub use timing::Seconds;
