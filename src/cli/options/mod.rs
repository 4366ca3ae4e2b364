//! What several verbs take.

pub mod captured;
pub mod inputs;
pub mod meshes;
pub mod motion;
pub mod posing;
pub mod scans;
pub mod training;
