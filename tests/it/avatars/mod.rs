//! From frames to avatars, and what is made of them.

mod animation;
mod canonical_grid;
mod engines;
mod evaluation;
mod export;
mod mannequin;
mod old_files;
mod other_skeleton;
mod registration;
mod render;
mod rgbd_training;
mod runs;
mod toy_family;
mod training;
pub mod untrained;
