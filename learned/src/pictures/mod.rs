//! Bodies of pictures (Wang 4.4; METHOD-BODY section 11): a small network finds in a picture the code of a mesh, which an auto-decoder makes, and a camera.
//!
//! It completes the set and is tried on pictures that are drawn (`examples/pictures_to_bodies.rs`). What far larger networks find in photographs is read as motions
//! and starts of registrations.

mod balance;
mod camera;
mod judge;
mod network;

pub use balance::Balance;
pub use camera::projected;
pub use judge::Judge;
pub use network::{Drawn, PictureNetwork};
