//! Animatable neural avatars from 3D scans: implicit geometry, colour and learned skinning (X-Avatar, Shen 2022).
//!
//! Data flows one way: files -> [`data`] -> frames -> [`train`] -> [`avatar`] -> [`mesh`] -> pictures, exports, metrics.

mod atomic_file;
pub mod avatar;
pub mod body;
pub mod camera;
pub mod canonical_grid;
pub mod config;
pub mod correspondence;
pub mod data;
mod error;
pub mod evaluate;
pub mod export;
pub mod fields;
pub mod mannequin;
pub mod mesh;
mod picture_file;
pub mod render;
mod tensor_file;
pub mod train;

pub use error::{Error, Result};
