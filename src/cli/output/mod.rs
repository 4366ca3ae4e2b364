//! What verbs say: messages and progress on stderr, results on stdout and in files.

pub mod files;
pub mod json;
pub mod measured_run;
pub mod messages;
pub mod progress;
pub mod report;
