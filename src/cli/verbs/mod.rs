//! The verbs, one a file, each thin: parse, call the library, print.

pub mod ablate;
pub mod animate;
pub mod batch;
pub mod body;
pub mod check;
pub mod completions;
pub mod convert;
pub mod demo;
pub mod doctor;
pub mod eval;
pub mod export;
pub mod extract;
pub mod fuse;
pub mod info;
pub mod man;
pub mod mocap;
pub mod pointcloud;
pub mod register;
pub mod render;
pub mod render_dataset;
pub mod render_rgbd;
pub mod train;
pub mod view;
