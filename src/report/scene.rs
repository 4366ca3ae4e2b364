//! What the page's viewer draws, as JSON with base64 arrays: a rig in as few bytes as are seen.
//!
//! Little endian. Positions f32; normals i16, of 32767; weights u8, of 255; rotations i16 quaternions, of 32767. Expressions are
//! stored for the vertices that they move. `assets/report/viewer/avatar.js` is the reader. V vertices, J joints, T frames.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::{Mat4, Vec3};
use serde::Serialize;

use super::part_colours::part_colour;
use crate::body::Part;
use crate::export::RiggedMesh;
use crate::mesh::Colouring;
use crate::render::joint_colours;
use crate::{Error, InputError, Result};

/// Influences of a vertex that the shader knows.
const INFLUENCES: usize = 4;
/// Displacements by a unit of expression below this are not seen, metres.
const UNSEEN: f32 = 2e-5;
/// The colour of a surface without one.
const PLASTER: [u8; 3] = [210, 206, 201];

/// The viewer's data.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ViewerScene {
    positions: PackedArray,
    normals: PackedArray,
    colours: PackedArray,
    joints: PackedArray,
    weights: PackedArray,
    faces: PackedArray,
    /// (J).
    joint_names: Vec<String>,
    /// Of each joint but the root (J); the root's is 0, as JSON knows no index that is none.
    parents: Vec<usize>,
    /// Where each joint is in its parent's frame (J, 3).
    joint_places: PackedArray,
    /// Column-major (J, 16).
    inverse_binds: PackedArray,
    /// Index into `parts` (J).
    joint_parts: Vec<usize>,
    joint_colours: Vec<[u8; 3]>,
    parts: Vec<NamedPart>,
    expressions: Expressions,
    motion: PackedMotion,
    #[serde(skip_serializing_if = "Option::is_none")]
    live: Option<LiveEndpoint>,
}

/// An array as the script decodes it.
#[derive(Clone, Debug, Serialize)]
struct PackedArray {
    #[serde(rename = "type")]
    kind: &'static str,
    base64: String,
}

#[derive(Clone, Debug, Serialize)]
struct NamedPart {
    name: String,
    colour: [u8; 3],
}

#[derive(Clone, Debug, Serialize)]
struct Expressions {
    count: usize,
    /// Those that any expression moves (N).
    vertices: PackedArray,
    /// (count, N, 3), metres.
    offsets: PackedArray,
}

#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct PackedMotion {
    frames: usize,
    frames_per_second: f32,
    /// (T, J, 4).
    rotations: PackedArray,
    /// Where the root is (T, 3).
    places: PackedArray,
    /// Coefficients (T, count).
    expressions: PackedArray,
}

#[derive(Clone, Debug, Serialize)]
struct LiveEndpoint {
    endpoint: &'static str,
}

impl ViewerScene {
    /// The scene of a rig with four influences a vertex.
    ///
    /// # Errors
    /// [`InputError::Value`] for a rig with another number of influences.
    pub(super) fn of(rig: &RiggedMesh) -> Result<Self> {
        if rig.influences != INFLUENCES {
            return Err(Error::from(InputError::Value {
                name: "influences of the viewer's rig".into(),
                found: rig.influences.to_string(),
                expected: INFLUENCES.to_string(),
            }));
        }
        let count = rig.mesh.vertices.len();
        let normals = rig.mesh.normals.clone().unwrap_or_else(|| rig.mesh.vertex_normals());
        let colours = match &rig.mesh.colouring {
            Colouring::Vertex(colours) => colours.clone(),
            Colouring::None | Colouring::Texture { .. } => vec![PLASTER; count],
        };
        let faces = rig.mesh.faces.as_flattened();
        let faces = match u16::try_from(count) {
            Ok(_) => packed("u16", faces.iter().flat_map(|vertex| (*vertex as u16).to_le_bytes())),
            Err(_) => packed("u32", faces.iter().flat_map(|vertex| vertex.to_le_bytes())),
        };
        let inverse_binds = rig.joints.iter().flat_map(|joint| Mat4::from(joint.inverse_bind).to_cols_array());
        Ok(Self {
            positions: floats(rig.mesh.vertices.iter().flat_map(Vec3::to_array)),
            normals: shares(normals.iter().flat_map(Vec3::to_array)),
            colours: packed("u8", colours.into_iter().flatten()),
            joints: packed("u8", rig.skin_joints.iter().copied()),
            weights: packed("u8", rig.skin_weights.as_chunks().0.iter().flat_map(quantised_weights)),
            faces,
            joint_names: rig.joints.iter().map(|joint| joint.name.clone()).collect(),
            parents: rig.joints.iter().map(|joint| joint.parent.unwrap_or(0)).collect(),
            joint_places: floats(rig.joints.iter().flat_map(|joint| joint.translation.to_array())),
            inverse_binds: floats(inverse_binds),
            joint_parts: rig.joints.iter().map(|joint| joint.part).collect(),
            joint_colours: joint_colours(&rig.joints.iter().map(|joint| joint.parent).collect::<Vec<_>>()),
            parts: named_parts(rig),
            expressions: Expressions::of(rig),
            motion: PackedMotion::of(rig),
            live: None,
        })
    }

    /// The scene of a page whose server answers with meshes.
    pub(super) fn live(self, endpoint: &'static str) -> Self {
        Self { live: Some(LiveEndpoint { endpoint }), ..self }
    }

    /// JSON that may stand inside a script element: nothing in it can end one.
    pub(super) fn json(&self) -> String {
        // Arrays of numbers and strings always have a JSON form.
        serde_json::to_string(self).unwrap_or_default().replace('<', "\\u003c")
    }
}

impl Expressions {
    fn of(rig: &RiggedMesh) -> Self {
        let shapes: Vec<_> = expressions(rig).map(|(_, morph)| &morph.offsets).collect();
        let is_moved = |vertex: &usize| shapes.iter().any(|offsets| offsets[*vertex].length() > UNSEEN);
        let vertices: Vec<usize> = (0..rig.mesh.vertices.len()).filter(is_moved).collect();
        let offsets = shapes.iter().flat_map(|offsets| vertices.iter().flat_map(|vertex| offsets[*vertex].to_array()));
        Self {
            count: shapes.len(),
            offsets: floats(offsets),
            vertices: packed("u32", vertices.iter().flat_map(|vertex| (*vertex as u32).to_le_bytes())),
        }
    }
}

impl PackedMotion {
    fn of(rig: &RiggedMesh) -> Self {
        let animation = &rig.animation;
        let columns: Vec<usize> = expressions(rig).map(|(index, _)| index).collect();
        let rows = (0..animation.frames()).map(|frame| &animation.morph_weights[frame * rig.morphs.len()..]);
        Self {
            frames: animation.frames(),
            frames_per_second: animation.frames_per_second,
            rotations: shares(animation.rotations.iter().flatten().flat_map(|rotation| rotation.to_array())),
            places: floats(animation.root_translations.iter().flat_map(Vec3::to_array)),
            expressions: floats(rows.flat_map(|row| columns.iter().map(|column| row[*column]))),
        }
    }
}

/// The morphs that are expressions, with their places among all.
fn expressions(rig: &RiggedMesh) -> impl Iterator<Item = (usize, &crate::export::Morph)> {
    rig.morphs.iter().enumerate().filter(|(_, morph)| morph.is_expression())
}

/// Bytes of sum 255: the first, which is the largest, takes the rounding.
fn quantised_weights(weights: &[f32; INFLUENCES]) -> [u8; INFLUENCES] {
    let mut bytes = weights.map(|weight| (weight * 255.0).round() as u8);
    bytes[0] = 255_u8.saturating_sub(bytes[1..].iter().fold(0, |sum, byte| sum.saturating_add(*byte)));
    bytes
}

fn packed(kind: &'static str, bytes: impl Iterator<Item = u8>) -> PackedArray {
    PackedArray { kind, base64: STANDARD.encode(bytes.collect::<Vec<u8>>()) }
}

fn floats(values: impl Iterator<Item = f32>) -> PackedArray {
    packed("f32", values.flat_map(f32::to_le_bytes))
}

/// Values from -1 to 1.
fn shares(values: impl Iterator<Item = f32>) -> PackedArray {
    packed("i16", values.flat_map(|value| ((value * f32::from(i16::MAX)).round() as i16).to_le_bytes()))
}

fn named_parts(rig: &RiggedMesh) -> Vec<NamedPart> {
    let named = |(part, name): (u8, &String)| {
        let (first, rest) = name.split_at(name.chars().next().map_or(0, char::len_utf8));
        NamedPart { name: first.to_uppercase() + rest, colour: part_colour(Part(part)) }
    };
    (0..).zip(&rig.parts).map(named).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantised_weights_sum_to_one() {
        for weights in [[1.0, 0.0, 0.0, 0.0], [0.25; 4], [0.5, 0.3, 0.15, 0.05], [0.334, 0.333, 0.333, 0.0]] {
            let bytes = quantised_weights(&weights);
            assert_eq!(bytes.iter().map(|byte| u32::from(*byte)).sum::<u32>(), 255);
            let error = bytes.iter().zip(weights).map(|(byte, weight)| (f32::from(*byte) / 255.0 - weight).abs());
            assert!(error.fold(0.0, f32::max) < 0.007);
        }
    }

    #[test]
    fn values_beyond_the_range_saturate() {
        assert_eq!(shares([2.0, -2.0].into_iter()).base64, STANDARD.encode([0xff, 0x7f, 0x00, 0x80]));
    }
}
