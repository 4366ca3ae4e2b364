//! Animatable neural avatars from 3D scans: implicit geometry, colour and learned skinning (X-Avatar, Shen 2022).
//!
//! A person is three fields over one canonical body. Geometry f says of a canonical point x_c whether it is inside, texture c what colour it
//! has, skinning w which bones move it. To learn them from posed scans, every posed point x_d needs its canonical one; that search
//! is the heart of the method, and its gradient is exact. This page walks from the formulas to the code.
//!
//! # The body: theta, beta, psi to bones
//!
//! T = template + shapedirs [beta | psi] + posedirs vec(R(theta) - I); joints = regressor (template + shapedirs [beta | psi]); posed by linear
//! blend skinning. [`body::BodyModel`] is that, of a [`body::Skeleton`] that is data: joints, tree, parts, canonical pose. A
//! [`body::Pose`] is theta, beta, psi and a translation; what a source states in its own terms, such as hands relative to the model's
//! mean, are [`body::BodyParameters`], which the model resolves. Deformers take B_j = G_j(theta) G_j(theta_canonical)^-1, from
//! [`canonical_to_posed`](body::BodyModel::canonical_to_posed).
//!
//! # The fields: f, c, w
//!
//! [`fields::Fields`] holds them: softplus networks over encoded points, conditioned on [theta_b / pi, psi]
//! ([`fields::Condition`]), or hash grids with small networks. They are made of [`xavatar_network`], which has every derivative by hand:
//! df/dx_c for normals, and the parameters' gradient of losses on values, normals and weights.
//!
//! # Correspondence: x_d = sum_i w_i(x_c) B_i x_c
//!
//! [`fields::PosedField`] searches all x_c of a posed point, from the bones of its part ([`fields::start_groups`]), with
//! [`xavatar_deformer`]: Broyden's method, on the field itself or on one baked on a grid. A point may have several: occupancy is the
//! largest of theirs, distance the smallest. Gradients reach the skinning field through the implicit function theorem.
//!
//! # Training
//!
//! [`data`] reads what users have: scans, motions, body models, all without running anything that is in them. A
//! [`data::Source`] hands out captures, a [supervision](train::supervision) draws points from them, part by part, and an
//! [engine](train::engine) descends [`train::losses`]: BCE(f) or |f - d|, |n_d - n|^2, |c - c_gt|, and what holds the weights at joints
//! and skin. A [`runs::Run`] is a folder that can be stopped and resumed to the bit; [`config::Config`] is all that may be turned.
//!
//! # The avatar
//!
//! [`avatar::Avatar`] is one file. [`query`](avatar::Avatar::query) it at a point, [extract](avatar::Avatar::extract_canonical) its
//! surface with the marching cubes of [`mesh`], pose it with [`avatar::Animator`] (the union of all correspondences) or
//! [`avatar::FixedTopology`] (one mesh, skinned). [`evaluate`] measures it, [`render`] draws it without a GPU. Checkpoints of the released
//! X-Avatar code become avatars by [`from_official`](avatar::Avatar::from_official).
//!
//! # Trying it
//!
//! [`synthetic::BuiltInSubject`] needs no data. `examples/` trains, poses and queries it; the shortest of them:
//!
//! ```no_run
//! use xavatar::avatar::{Animator, Avatar};
//! use xavatar::synthetic::BuiltInSubject;
//!
//! let avatar = Avatar::load("runs/demo".as_ref())?;
//! let subject = BuiltInSubject::new()?;
//! let animator = Animator::new(&avatar, subject.model(), subject.part_labels())?;
//! let mesh = animator.extract(&subject.model().skeleton().rest_pose(), 128)?.mesh;
//! xavatar::mesh::write_ply("t-pose.ply", &mesh)?;
//! # Ok::<(), xavatar::Error>(())
//! ```
//!
//! Points and joints are in metres, rotations in radians, Y is up and the subject faces +Z.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub mod avatar;
pub mod cohort;
pub mod config;
pub mod doctor;
mod error;
pub mod evaluate;
pub mod export;
pub mod fields;

pub mod report;
pub mod runs;
pub mod synthetic;
pub mod train;
pub mod view;

pub use xavatar_body as body;
pub use xavatar_data as data;
pub use xavatar_formats as formats;
pub use xavatar_landmarks as landmarks;
pub use xavatar_learned as learned;
pub use xavatar_mesh as mesh;
pub use xavatar_register as register;
pub use xavatar_render as render;

pub use error::{Error, Result};
pub use xavatar_formats::Error as InputError;
