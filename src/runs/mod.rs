//! A run: a training in a folder, that can be stopped, gone on with, watched and measured.
//!
//! The folder holds `config.toml`, `cache/` (the captures, checked), `checkpoints/`, `metrics.jsonl` and TensorBoard's events, `previews/`, at
//! the end `avatar.safetensors`, and `measured.json` once it is measured. Every call does what earlier ones have left to do, and nothing
//! twice, so a batch of runs is a loop over [`Run::train`] and [`Run::measure`].

mod ablation;
mod batch;
mod cache;
mod checkpoint;
mod event;
mod event_file;
mod fusion;
mod history;
mod measure;
mod notes;
mod part_columns;
mod preview;
mod run;
mod table;

pub use ablation::{Ablation, Variant};
pub use batch::Batch;
pub use event::{Event, Observer};
pub use fusion::{SomeCaptures, Turn, turned};
pub use history::{NotedStep, has_notes, noted_steps, previews, seconds_per_step};
pub use measure::{RunMetrics, Yardstick};
pub use run::{Ending, Run};
pub use table::{RowKey, RunRow, RunTable};
