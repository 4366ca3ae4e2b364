//! The recipe of the built-in subject, as written in `assets/mannequin.toml`; units and meanings stand there.
//!
//! What the file leaves to symmetry is completed here: mirrored joints and solids.

use serde::Deserialize;
use std::collections::BTreeMap;

use crate::body::smplx;
use crate::formats::{Error, Result};
use glam::Vec3;

const TEXT: &str = include_str!("../../../assets/mannequin.toml");

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Recipe {
    pub(super) mesh: MeshDetail,
    joints: BTreeMap<String, [f32; 3]>,
    pub(super) flesh: Flesh,
    pub(super) rig: Rig,
    pub(super) hands: Hands,
    pub(super) shapes: Vec<ShapeDirection>,
    pub(super) expressions: Vec<Expression>,
    pub(super) correctives: Correctives,
    pub(super) scan: ScanDetail,
    pub(super) garments: Vec<Garment>,
    pub(super) paints: Vec<Paint>,
    pub(super) wrinkles: Vec<Wrinkle>,
    pub(super) motion: Motion,
    pub(super) poses: BTreeMap<String, KeyPose>,
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

/// How the skin follows the joints.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Rig {
    pub(super) diffusion_rounds: usize,
    pub(super) eyeball_radius: f32,
    pub(super) eyes_mouth: Vec<Ball>,
}

/// A place on the face.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ball {
    pub(super) centre: [f32; 3],
    pub(super) radius: f32,
}

/// How the left hand closes; the right hand is its mirror image.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Hands {
    pub(super) finger_curl: [[f32; 3]; 3],
    pub(super) thumb_curl: [[f32; 3]; 3],
    pub(super) relaxed: f32,
}

/// One direction of body shape.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShapeDirection {
    #[serde(rename = "name")]
    _name: String,
    pub(super) moves: Vec<Move>,
}

/// A displacement of what some joints hold.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Move {
    pub(super) joints: Vec<String>,
    #[serde(default)]
    pub(super) shift: [f32; 3],
    #[serde(default)]
    pub(super) stretch: [f32; 3],
    #[serde(default)]
    pub(super) about: [f32; 3],
    #[serde(default)]
    pub(super) inflate: f32,
}

/// One direction of expression.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Expression {
    pub(super) name: String,
    pub(super) pulls: Vec<Pull>,
}

/// A displacement around a point of the face.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Pull {
    pub(super) at: [f32; 3],
    pub(super) radius: f32,
    pub(super) shift: [f32; 3],
}

/// What pose does to flesh beyond skinning.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Correctives {
    pub(super) bulges: Vec<Bulge>,
}

/// A swelling around a bent joint.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Bulge {
    pub(super) joint: String,
    pub(super) amount: f32,
    pub(super) radius: f32,
}

/// The scan's triangles, and the colour of bare skin.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ScanDetail {
    pub(super) edge: f32,
    pub(super) head_edge: f32,
    pub(super) head_above: f32,
    pub(super) skin: [u8; 3],
}

/// Something worn.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Garment {
    pub(super) borders: Vec<Border>,
    pub(super) thickness: f32,
    pub(super) hem: f32,
    pub(super) rise: f32,
    pub(super) colour: [u8; 3],
    pub(super) stripes: Option<Stripes>,
}

/// A plane that a garment ends at.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Border {
    pub(super) normal: [f32; 3],
    pub(super) offset: f32,
}

/// Bands of a second colour along y.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Stripes {
    pub(super) period: f32,
    pub(super) share: f32,
    pub(super) colour: [u8; 3],
}

/// Colour on the skin inside an ellipsoid.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Paint {
    pub(super) centre: [f32; 3],
    pub(super) radii: [f32; 3],
    pub(super) colour: [u8; 3],
}

/// Creases of cloth around a joint that bends.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Wrinkle {
    pub(super) joint: String,
    pub(super) axis: [f32; 3],
    pub(super) wavelength: f32,
    pub(super) radius: f32,
    pub(super) depth: f32,
}

/// The subject's shape and its takes.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Motion {
    pub(super) betas: Vec<f32>,
    pub(super) train: Vec<String>,
    pub(super) test: Vec<String>,
}

/// A pose that motions pass through.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct KeyPose {
    pub(super) turns: BTreeMap<String, [f32; 3]>,
    pub(super) hands: [f32; 2],
    #[serde(default)]
    pub(super) yaw: f32,
    #[serde(default)]
    pub(super) jaw: f32,
    #[serde(default)]
    pub(super) expression: BTreeMap<String, f32>,
}

impl Recipe {
    /// The recipe that is part of the program.
    pub(super) fn embedded() -> Result<Self> {
        toml::from_str(TEXT).map_err(|error| malformed("the text", error.to_string(), "TOML with the documented keys"))
    }

    /// The rest position of each joint (J).
    pub(super) fn joint_positions(&self) -> Result<Vec<Vec3>> {
        let position = |name: &String| {
            let (written, sign) = match name.strip_prefix("right_") {
                Some(side) => (format!("left_{side}"), -1.0),
                None => (name.clone(), 1.0),
            };
            let [x, y, z] = self.joints.get(&written).ok_or_else(|| malformed(&written, "absent", "a position"))?;
            Ok(Vec3::new(sign * x, *y, *z))
        };
        smplx::skeleton().joints.iter().map(position).collect()
    }
}

/// The index of a joint by its name.
pub(super) fn joint_index(name: &str) -> Result<usize> {
    smplx::skeleton().joint(name).ok_or_else(|| malformed("a joint", format!("{name:?}"), "a joint of SMPL-X"))
}

/// The joints that a move names: `name`, or `name*` for a joint and all below it.
pub(super) fn joint_set(names: &[String]) -> Result<Vec<bool>> {
    let parents = &smplx::skeleton().parents;
    let mut set = vec![false; parents.len()];
    for name in names {
        match name.strip_suffix('*') {
            None => set[joint_index(name)?] = true,
            Some(name) => {
                let top = joint_index(name)?;
                for (joint, named) in set.iter_mut().enumerate() {
                    *named |= std::iter::successors(Some(joint), |joint| parents[*joint]).any(|above| above == top);
                }
            }
        }
    }
    Ok(set)
}

/// The joint on the other side; a middle joint is its own twin.
pub(super) fn twin(joint: usize) -> usize {
    let name = smplx::skeleton().joints[joint].as_str();
    let other = match (name.strip_prefix("left_"), name.strip_prefix("right_")) {
        (Some(side), _) => format!("right_{side}"),
        (_, Some(side)) => format!("left_{side}"),
        _ => return joint,
    };
    smplx::skeleton().joint(&other).unwrap_or(joint)
}

pub(super) fn malformed(place: &str, found: impl Into<String>, expected: &str) -> Error {
    Error::Malformed {
        path: "assets/mannequin.toml".into(),
        format: "mannequin recipe",
        place: place.into(),
        found: found.into(),
        expected: expected.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twins_are_each_others_and_stand_opposite() {
        let positions = Recipe::embedded().unwrap().joint_positions().unwrap();
        for joint in 0..positions.len() {
            assert_eq!(twin(twin(joint)), joint);
            assert_eq!(positions[twin(joint)] * Vec3::new(-1.0, 1.0, 1.0), positions[joint]);
        }
        assert_eq!((twin(0), twin(16), twin(39)), (0, 17, 54));
    }

    #[test]
    fn a_star_takes_all_joints_below() {
        let set = |names: &[&str]| {
            let named = joint_set(&names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>()).unwrap();
            (0..named.len()).filter(|joint| named[*joint]).collect::<Vec<_>>()
        };
        assert_eq!(set(&["left_hip*"]), [1, 4, 7, 10]);
        assert_eq!(set(&["head*", "neck"]), [12, 15, 22, 23, 24]);
        assert_eq!(set(&["pelvis*"]).len(), smplx::skeleton().joints.len());
        assert!(joint_set(&["tail".into()]).unwrap_err().to_string().contains("\"tail\""));
    }
}
