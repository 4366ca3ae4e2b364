//! Avatars for other programs: one rigged mesh with plain arrays, and the files it is written to.
//!
//! [`RiggedMesh`] is what every format and viewer takes; its documentation says how to pose it. [`Rigging`] makes it of an
//! avatar and a motion, and reports what a rig of few influences a vertex loses against
//! [`FixedTopology`](crate::avatar::FixedTopology).

mod bake;
mod correctives;
mod engine;
mod expressions;
mod face_units;
mod fewer_faces;
mod glb;
mod ground;
mod influences;
mod reference;
mod report;
mod rig;
mod rigging;
mod scaled_bones;
mod skeleton;
mod unwrap;
mod usd;

pub use bake::{Baked, Charts, TextureReport, bake_texture};
pub use engine::{BoneAxis, Engine};
pub use face_units::{FaceUnitErrors, FaceUnitReport};
pub use fewer_faces::{FewerFaces, with_fewer_faces};
pub use glb::write_glb;
pub use ground::{ground_mesh, ground_motion};
pub use report::{Deviation, RigReport};
pub use rig::{Animation, Joint, Morph, RiggedMesh};
pub use rigging::Rigging;
pub use usd::{write_usda, write_usdz};
