//! Bodies that are trained: registrations in one topology to template, joints, weights, shapes and pose correctives (Osman ch. 3-6).
//!
//! [`registrations`] finds what a user has, [`population`] makes some up whose truth is known. [`core`] is what every training shares: the pose of a
//! registration, un-posing, template and joints, weights, shapes, the file. [`sparse`] trains STAR's and SUPR's correctives, [`personal`] a body
//! of one person from a few registrations, with how sure it is, [`blsm`] one whose bones and flesh are apart. [`spiral`] has networks on meshes, [`feet`] those of what the ground does to feet, [`pictures`] one that finds bodies in pictures, [`descent`] trains them, on candle; [`kept`] is what a training is gone on with from.
//! [`attributes`] makes people of a height and a weight, [`evaluation`] measures. What comes out are body files like any other.
//!
//! Everything is computed in double precision, with the same bits whatever the threads; but for the networks, which learn in single
//! precision, and of which that is known for one number of threads alone. Metres, radians, Y up.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub mod attributes;
pub mod blsm;
pub mod core;
pub mod descent;
pub mod evaluation;
pub mod feet;
pub mod kept;
mod named_arrays;
pub mod personal;
pub mod pictures;
pub mod population;
#[cfg(test)]
mod reference;
pub mod registrations;
pub mod sparse;
pub mod spiral;
pub mod truth;
