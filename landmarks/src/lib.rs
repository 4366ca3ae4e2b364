//! Landmarks of a person found in pictures of a scan.
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod body;
mod finder;
mod hands;
mod models;
pub mod network;
mod picture;
mod rays;

pub use finder::{Found, Landmark, find};
pub use models::Models;
