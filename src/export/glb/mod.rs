//! Binary glTF 2.0: one skinned mesh with morph targets and a clip, colours or a texture included.
//!
//! <https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>. The JSON is written as such: the typed bindings of the crate
//! `gltf-json` ask for every absent member of every object, and it is the Khronos validator that decides (`scripts/validate-glb.sh`).

mod buffer;
mod targets;

use std::borrow::Cow;
use std::io::{self, Write};
use std::path::Path;

use glam::{Mat4, Vec3};
use serde_json::{Value, json};

use self::buffer::Buffer;
use self::targets::Targets;
use super::rig::{Animation, RiggedMesh};
use crate::mesh::{Colouring, encode_png};
use crate::{Error, InputError, Result};
use xavatar_formats::write_atomically;

const MAGIC: &[u8; 4] = b"glTF";
const VERSION: u32 = 2;
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BINARY_CHUNK: &[u8; 4] = b"BIN\0";
/// Joints and weights of one attribute.
const SET: usize = 4;
/// The node of the mesh; those of the joints follow.
const MESH_NODE: usize = 0;
const LINEAR: u32 = 9729;
const LINEAR_MIPMAP_LINEAR: u32 = 9987;
const CLAMP_TO_EDGE: u32 = 33071;

/// Writes the rig, whole or not at all.
///
/// # Errors
/// [`InputError::Value`] for a mesh that [`TriangleMesh::check`](crate::mesh::TriangleMesh::check) refuses or that makes more than
/// the 4 GiB of the format; [`InputError::Io`].
pub fn write_glb(path: impl AsRef<Path>, rigged: &RiggedMesh) -> Result<()> {
    let path = path.as_ref();
    rigged.mesh.check()?;
    let mut buffer = Buffer::default();
    let targets = Targets::of(rigged);
    let mut document = json!({
        "asset": { "version": "2.0", "generator": concat!("xavatar ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{ "nodes": [MESH_NODE, top_node(rigged)] }],
        "nodes": nodes(rigged),
        "meshes": [mesh(rigged, &targets, &mut buffer)],
        "skins": [skin(rigged, &mut buffer)],
        "animations": [animation(rigged, &targets, &mut buffer)],
        "materials": [material(&rigged.mesh.colouring)],
    });
    if let Colouring::Texture { image, .. } = &rigged.mesh.colouring {
        // In memory row 0 is v = 0, as in glTF.
        let png = encode_png(image).map_err(InputError::io(path))?;
        document["images"] = json!([{ "bufferView": buffer.file(&png), "mimeType": "image/png" }]);
        document["samplers"] = json!([{
            "magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE,
        }]);
        document["textures"] = json!([{ "source": 0, "sampler": 0 }]);
    }
    document["buffers"] = json!([{ "byteLength": buffer.bytes.len() }]);
    document["bufferViews"] = buffer.views.into();
    document["accessors"] = buffer.accessors.into();
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + text.len() + 8 + buffer.bytes.len();
    let Ok(length) = u32::try_from(length) else {
        return Err(Error::from(InputError::Value {
            name: "the size of the GLB".into(),
            found: format!("{length} bytes"),
            expected: "at most 4 GiB: choose a lower resolution or fewer correctives".into(),
        }));
    };
    Ok(write_atomically(path, |writer| {
        writer.write_all(MAGIC)?;
        writer.write_all(&VERSION.to_le_bytes())?;
        writer.write_all(&length.to_le_bytes())?;
        write_chunk(writer, JSON_CHUNK, &text)?;
        write_chunk(writer, BINARY_CHUNK, &buffer.bytes)
    })?)
}

fn write_chunk(writer: &mut impl Write, kind: &[u8; 4], bytes: &[u8]) -> io::Result<()> {
    writer.write_all(&(bytes.len() as u32).to_le_bytes())?;
    writer.write_all(kind)?;
    writer.write_all(bytes)
}

/// The node that the skeleton hangs on: its root, or the one above, which is the last.
fn top_node(rigged: &RiggedMesh) -> usize {
    match rigged.root {
        Some(_) => joint_node(rigged.joints.len()),
        None => joint_node(0),
    }
}

fn joint_node(joint: usize) -> usize {
    MESH_NODE + 1 + joint
}

/// The mesh, which its skin places, and the joints in the bind pose.
fn nodes(rigged: &RiggedMesh) -> Vec<Value> {
    let mut nodes = vec![json!({ "name": "avatar", "mesh": 0, "skin": 0 })];
    for (index, joint) in rigged.joints.iter().enumerate() {
        let is_child = |other: &usize| rigged.joints[*other].parent == Some(index);
        let children: Vec<usize> = (0..rigged.joints.len()).filter(is_child).map(joint_node).collect();
        let (translation, rotation) = (joint.translation.to_array(), joint.rotation.to_array());
        let mut node = json!({ "name": joint.name, "translation": translation, "rotation": rotation });
        if joint.scale != 1.0 {
            node["scale"] = [joint.scale; 3].into();
        }
        if !children.is_empty() {
            node["children"] = children.into();
        }
        nodes.push(node);
    }
    if let Some(root) = &rigged.root {
        nodes.push(json!({ "name": root, "children": [joint_node(0)] }));
    }
    nodes
}

fn mesh(rigged: &RiggedMesh, targets: &Targets, buffer: &mut Buffer) -> Value {
    let mesh = &rigged.mesh;
    let mut attributes = json!({ "POSITION": buffer.positions(&mesh.vertices) });
    let normals = mesh.normals.clone().unwrap_or_else(|| mesh.vertex_normals());
    // Zero, which the format does not allow, is that of a vertex without area.
    let normals = normals.iter().map(|normal| normal.try_normalize().unwrap_or(Vec3::Y).to_array());
    attributes["NORMAL"] = buffer.attributes(normals).into();
    match &mesh.colouring {
        Colouring::None => {}
        Colouring::Vertex(colours) => {
            attributes["COLOR_0"] = buffer.colours(colours.iter().map(|colour| colour.map(linear))).into();
        }
        Colouring::Texture { uvs, .. } => {
            attributes["TEXCOORD_0"] = buffer.attributes(uvs.iter().map(glam::Vec2::to_array)).into();
        }
    }
    for set in 0..rigged.influences / SET {
        let vertices = 0..mesh.vertices.len();
        let place = |vertex: usize, entry: usize| vertex * rigged.influences + set * SET + entry;
        let joints =
            vertices.clone().map(|vertex| std::array::from_fn(|entry| rigged.skin_joints[place(vertex, entry)]));
        attributes[format!("JOINTS_{set}")] = buffer.joints(joints).into();
        let weights = vertices.map(|vertex| std::array::from_fn(|entry| rigged.skin_weights[place(vertex, entry)]));
        attributes[format!("WEIGHTS_{set}")] = buffer.attributes::<SET>(weights).into();
    }
    let indices = buffer.indices(&mesh.faces);
    let mut primitive = json!({ "attributes": attributes, "indices": indices, "material": 0 });
    let mut value = json!({ "name": "avatar" });
    if !targets.names.is_empty() {
        let target = |offsets: &Cow<[Vec3]>| json!({ "POSITION": buffer.offsets(offsets) });
        primitive["targets"] = targets.offsets.iter().map(target).collect();
        value["weights"] = vec![0.0; targets.names.len()].into();
        // The names' place by agreement of Blender, three.js and others.
        value["extras"] = json!({ "targetNames": targets.names });
    }
    value["primitives"] = json!([primitive]);
    value
}

fn skin(rigged: &RiggedMesh, buffer: &mut Buffer) -> Value {
    let matrices = rigged.joints.iter().map(|joint| Mat4::from(joint.inverse_bind).to_cols_array());
    let joints: Vec<usize> = (0..rigged.joints.len()).map(joint_node).collect();
    json!({ "inverseBindMatrices": buffer.matrices(matrices), "joints": joints, "skeleton": top_node(rigged) })
}

fn animation(rigged: &RiggedMesh, targets: &Targets, buffer: &mut Buffer) -> Value {
    let animation = &rigged.animation;
    let times: Vec<f32> = (0..animation.frames()).map(|frame| frame as f32 / animation.frames_per_second).collect();
    let times = buffer.times(&times);
    let (mut samplers, mut channels) = (Vec::new(), Vec::new());
    let mut channel = |node: usize, path: &str, output: usize| {
        channels.push(json!({ "sampler": samplers.len(), "target": { "node": node, "path": path } }));
        samplers.push(json!({ "input": times, "output": output, "interpolation": "LINEAR" }));
    };
    let Animation { rotations, root_translations, .. } = animation;
    let translations: Vec<f32> = root_translations.iter().flat_map(Vec3::to_array).collect();
    channel(joint_node(0), "translation", buffer.keys(&translations, 3));
    for joint in 0..rigged.joints.len() {
        let keys: Vec<f32> = rotations.iter().flat_map(|frame| frame[joint].to_array()).collect();
        channel(joint_node(joint), "rotation", buffer.keys(&keys, 4));
    }
    if !targets.names.is_empty() {
        channel(MESH_NODE, "weights", buffer.keys(&targets.keys(), 1));
    }
    json!({ "name": animation.name, "samplers": samplers, "channels": channels })
}

/// Skin and cloth: no metal, no gloss.
fn material(colouring: &Colouring) -> Value {
    let mut surface = json!({ "metallicFactor": 0.0, "roughnessFactor": 1.0 });
    if let Colouring::Texture { .. } = colouring {
        surface["baseColorTexture"] = json!({ "index": 0 });
    }
    json!({ "name": "avatar", "pbrMetallicRoughness": surface })
}

/// An sRGB channel as a linear one (IEC 61966-2-1): vertex colours of glTF are linear.
fn linear(channel: u8) -> u16 {
    let encoded = f32::from(channel) / 255.0;
    let linear = if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
    (linear * f32::from(u16::MAX)).round() as u16
}
