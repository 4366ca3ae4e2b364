//! The recipe of the built-in subject, as written in `assets/mannequin.toml`; units and meanings stand there.
//!
//! What the file leaves to symmetry is completed here: mirrored joints and solids.

use serde::Deserialize;
use std::collections::BTreeMap;

use crate::body::{JOINT_NAMES, JOINTS};
use crate::{Error, Result};
use glam::Vec3;

const TEXT: &str = include_str!("../../assets/mannequin.toml");

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Recipe {
    pub(super) mesh: MeshDetail,
    joints: BTreeMap<String, [f32; 3]>,
    pub(super) flesh: Flesh,
}

/// How long triangles are, and where the flesh ends below.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MeshDetail {
    pub(super) cell: f32,
    pub(super) sole: f32,
    pub(super) arms: Magnifier,
    pub(super) head: Magnifier,
    pub(super) feet: Magnifier,
}

/// A region with smaller triangles.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Magnifier {
    pub(super) start: f32,
    pub(super) ramp: f32,
    pub(super) magnification: f32,
    pub(super) centre: [f32; 2],
}

/// The solids that are melted together.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Flesh {
    pub(super) limbs: Vec<Limb>,
    pub(super) masses: Vec<Mass>,
}

/// A round cone.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Limb {
    pub(super) joint: String,
    pub(super) from: [f32; 3],
    pub(super) to: [f32; 3],
    pub(super) radii: [f32; 2],
    pub(super) blend: f32,
}

/// An ellipsoid.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Mass {
    pub(super) joint: String,
    pub(super) centre: [f32; 3],
    pub(super) radii: [f32; 3],
    pub(super) blend: f32,
    #[serde(default)]
    pub(super) carve: bool,
}

impl Recipe {
    /// The recipe that is part of the program.
    pub(super) fn embedded() -> Result<Self> {
        toml::from_str(TEXT).map_err(|error| malformed("the text", error.to_string(), "TOML with the documented keys"))
    }

    /// The rest position of each joint (J).
    pub(super) fn joint_positions(&self) -> Result<[Vec3; JOINTS]> {
        let mut positions = [Vec3::ZERO; JOINTS];
        for (position, name) in positions.iter_mut().zip(JOINT_NAMES) {
            let (written, sign) = match name.strip_prefix("right_") {
                Some(side) => (format!("left_{side}"), -1.0),
                None => (name.to_owned(), 1.0),
            };
            let [x, y, z] = self.joints.get(&written).ok_or_else(|| malformed(&written, "absent", "a position"))?;
            *position = Vec3::new(sign * x, *y, *z);
        }
        Ok(positions)
    }
}

/// The index of a joint by its name.
pub(super) fn joint_index(name: &str) -> Result<usize> {
    let known = JOINT_NAMES.iter().position(|joint| *joint == name);
    known.ok_or_else(|| malformed("a joint", format!("{name:?}"), "a joint of SMPL-X"))
}

/// The joint on the other side; a middle joint is its own twin.
pub(super) fn twin(joint: usize) -> usize {
    let name = JOINT_NAMES[joint];
    let other = match (name.strip_prefix("left_"), name.strip_prefix("right_")) {
        (Some(side), _) => format!("right_{side}"),
        (_, Some(side)) => format!("left_{side}"),
        _ => return joint,
    };
    JOINT_NAMES.iter().position(|joint| *joint == other).unwrap_or(joint)
}

fn malformed(place: &str, found: impl Into<String>, expected: &str) -> Error {
    Error::Malformed {
        path: "assets/mannequin.toml".into(),
        format: "mannequin recipe",
        place: place.into(),
        found: found.into(),
        expected: expected.into(),
    }
}
