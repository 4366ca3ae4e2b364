//! Many subjects, each an independent job: registered, trained, measured and exported as a [`Manifest`] asks, by whoever comes first.
//!
//! There is no queue here. A scheduler (Slurm's array jobs, Kubernetes' Indexed Jobs, a loop in a shell) starts processes; each takes the
//! subjects of its [`Shard`], skips those that are done or that another process holds, and goes on where a killed one has stopped. What
//! is done stands in each subject's folder, with the digests of inputs and settings that it was done with: [`work_on`] twice is
//! [`work_on`] once. An error of one subject is that subject's.

mod digest;
pub mod emit;
mod folder;
mod manifest;
mod page;
mod plan;
mod rows;
mod shard;
mod stages;
mod summary;
mod work;

pub use folder::{Mark, State, SubjectFolder};
pub use manifest::Manifest;
pub use plan::{Stage, SubjectPlan};
pub use shard::Shard;
pub use summary::{INDEX_FILE, Summary, SummaryRow, TABLE_FILES, Totals};
pub use work::{Watcher, Worked, work_on};
