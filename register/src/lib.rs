//! Registration: scans, and landmarks if there are any, to the poses of a body model, its shape, and the clothing over it.
//!
//! E = landmarks + scan + prior over (R_1 .. R_J, t, psi) of every frame and one beta for all, minimised by Levenberg-Marquardt with exact
//! derivatives ([`linear`], [`terms`]), in stages that draw nearer ([`fit`]). Clothing is a distance D_i over each vertex, the same in all
//! frames, learned in alternation: bodies lie under clothes, not in them. [`landmarks`] reads what programs write; without any, a pose is
//! found from the scan's shape, and the score says whether to believe it. [`job`] takes a folder of scans to data that can be trained on.
//!
//! Everything is computed in double precision, in parallel over frames, with the same bits whatever the threads. Metres, radians, Y up.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub mod fit;
pub mod free_form;
pub mod job;
pub mod landmarks;
pub mod linear;
pub mod surface_model;
pub mod target;
pub mod terms;
pub mod view;
