//! Landmarks of a person, found in pictures of a scan: what other programs find in photographs, without photographs.
//!
//! A scan can be looked at from anywhere. Virtual cameras stand around the body, then around each hand; networks that the user has
//! ([`Models`]) say where joints are in each picture; the point of which most of these rays pass near is the landmark. One wrong
//! picture, or ten, move nothing. Of a depth camera there is one picture, and the depth in it ([`Photograph`]). [`network`] runs the networks on the processor. In parallel over pictures, with the same
//! bits whatever the threads. Metres, Y up.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod body;
mod finder;
mod hands;
mod models;
pub mod network;
mod photograph;
mod picture;
mod rays;

pub use finder::{Landmark, find};
pub use models::Models;
pub use photograph::Photograph;
