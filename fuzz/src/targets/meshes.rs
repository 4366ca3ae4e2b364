//! Meshes: PLY, OBJ with MTL, GLB. What they refer to is looked for where there is nothing.

use std::path::Path;

use xavatar::mesh::{Colouring, parse_mesh};

pub(super) fn ply(bytes: &[u8]) -> bool {
    is_mesh("no/such/mesh.ply", bytes)
}

pub(super) fn ply_seeds() -> Vec<Vec<u8>> {
    let text = "ply\nformat ascii 1.0\ncomment TextureFile skin.png\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty float s\nproperty float t\n\
        element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0 255 0 0 0 0\n1 0 0 0 255 0 1 0\n\
        0 1 0 0 0 255 0 1\n1 1 0 9 9 9 1 1\n3 0 1 2\n4 0 1 3 2\n";
    let head = "ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n\
        property float nx\nproperty float ny\nproperty float nz\nelement tristrips 1\nproperty list int int vertex_indices\n\
        end_header\n";
    let vertex = |x: f64, y: f64| {
        [x, y, 0.0].map(f64::to_be_bytes).concat().into_iter().chain([0.0, 0.0, 1.0].map(f32::to_be_bytes).concat())
    };
    let vertices = vertex(0.0, 0.0).chain(vertex(1.0, 0.0)).chain(vertex(0.0, 1.0));
    let strip = [4, 0, 1, 2, -1i32].map(i32::to_be_bytes).concat();
    vec![text.into(), head.bytes().chain(vertices).chain(strip).collect()]
}

pub(super) fn obj(bytes: &[u8]) -> bool {
    is_mesh("no/such/mesh.obj", bytes)
}

pub(super) fn obj_seeds() -> Vec<Vec<u8>> {
    let text = "# a comment\nmtllib scan.mtl\no body\nv 0 0 0 1 0.5 0\nv 1 0 0 1 0.5 0\nv 0 1 0 1 0.5 0\nv 1 1 0 1 0.5 0\nvt 0 0\n\
        vt 1 0\nvt 0 1\nvn 0 0 1\nusemtl skin\nf 1/1/1 2/2/1 3/3/1\nf -1 -2 -3\nf 1//1 2//1 3//1 4//1\nf 1 2 \\\n3\n";
    let utf16 = text.encode_utf16().flat_map(u16::to_le_bytes);
    vec![text.into(), [0xff, 0xfe].into_iter().chain(utf16).collect()]
}

pub(super) fn glb(bytes: &[u8]) -> bool {
    is_mesh("no/such/mesh.glb", bytes)
}

pub(super) fn glb_seeds() -> Vec<Vec<u8>> {
    let json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"translation":[0,1,0]}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"mode":4}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
        {"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],
        "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],"buffers":[{"byteLength":44}]}"#;
    let positions = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes).concat();
    let indices = [0u16, 1, 2, 0].map(u16::to_le_bytes).concat();
    vec![glb_file(json.as_bytes(), &[positions, indices].concat())]
}

/// A GLB whose chunks are as long as they say: its JSON, then [`BETWEEN`], then its buffer.
pub(super) fn glb_chunks(bytes: &[u8]) -> bool {
    let place = bytes.windows(BETWEEN.len()).position(|window| window == BETWEEN).unwrap_or(bytes.len());
    let (json, buffer) = bytes.split_at(place);
    glb(&glb_file(json, buffer.get(BETWEEN.len()..).unwrap_or_default()))
}

pub(super) fn glb_chunks_seeds() -> Vec<Vec<u8>> {
    const HEADS: usize = 20;
    glb_seeds()
        .into_iter()
        .map(|file| {
            let json = u32::from_le_bytes([file[12], file[13], file[14], file[15]]) as usize;
            [&file[HEADS..HEADS + json], BETWEEN, &file[HEADS + json + 8..]].concat()
        })
        .collect()
}

const BETWEEN: &[u8] = b"|GLB";

fn glb_file(json: &[u8], buffer: &[u8]) -> Vec<u8> {
    let chunk = |name: &[u8; 4], content: &[u8], filler: u8| {
        let length = content.len().next_multiple_of(4);
        let filling = vec![filler; length - content.len()];
        [&(length as u32).to_le_bytes()[..], name, content, &filling].concat()
    };
    let chunks = [chunk(b"JSON", json, b' '), chunk(b"BIN\0", buffer, 0)].concat();
    let length = (12 + chunks.len()) as u32;
    [b"glTF", &2u32.to_le_bytes()[..], &length.to_le_bytes(), &chunks].concat()
}

fn is_mesh(path: &str, bytes: &[u8]) -> bool {
    // What is read must be sound: everything that follows relies on it.
    parse_mesh(Path::new(path), bytes).is_ok_and(|read| {
        let count = read.mesh.vertices.len();
        assert!(read.mesh.faces.iter().flatten().all(|vertex| (*vertex as usize) < count));
        assert!(read.mesh.vertices.iter().all(|vertex| vertex.is_finite()));
        match &read.mesh.colouring {
            Colouring::None => {}
            Colouring::Vertex(colours) => assert_eq!(colours.len(), count),
            Colouring::Texture { uvs, .. } => assert_eq!(uvs.len(), count),
        }
        true
    })
}
