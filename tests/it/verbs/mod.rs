//! Whole verbs, run as a user runs them.

mod cli;
mod render;
mod rgbd;
mod runs;
mod view;
