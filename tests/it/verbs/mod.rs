//! Whole verbs, run as a user runs them.

mod batch;
mod body;
mod check;
mod cli;
mod labelled;
mod register;
mod register_rgbd;
mod render;
mod rgbd;
mod runs;
mod tool;
mod truth;
mod view;
