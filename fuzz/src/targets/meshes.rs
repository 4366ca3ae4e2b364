//! Meshes: each format by its name, without the files that they refer to.

use std::path::Path;

use xavatar::mesh::parse_mesh;

pub(super) fn ply(bytes: &[u8]) -> bool {
    read("mesh.ply", bytes)
}

pub(super) fn obj(bytes: &[u8]) -> bool {
    read("mesh.obj", bytes)
}

pub(super) fn glb(bytes: &[u8]) -> bool {
    read("mesh.glb", bytes)
}

/// Reads as a file of this name in a folder that is not there.
fn read(name: &str, bytes: &[u8]) -> bool {
    parse_mesh(&Path::new("absent").join(name), bytes).is_ok()
}

pub(super) fn ply_seeds() -> Vec<Vec<u8>> {
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment TextureFile a.png\nelement vertex 3\nproperty float x\nproperty float y\n\
             property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
             property list uchar int vertex_indices\nproperty list uchar float texcoord\nelement tristrips 1\n\
             property list int int vertex_indices\nend_header\n"
        )
    };
    let ascii = header("ascii") + "0 0 0 1 2 3\n1 0 0 4 5 6\n0 1 0 7 8 9\n3 0 1 2 6 0 0 1 0 0 1\n4 0 1 2 -1\n";
    let mut binary = header("binary_little_endian").into_bytes();
    for (place, colour) in [([0.0f32; 3], [1, 2, 3]), ([1.0, 0.0, 0.0], [4, 5, 6]), ([0.0, 1.0, 0.0], [7, 8, 9])] {
        place.iter().for_each(|value| binary.extend(value.to_le_bytes()));
        binary.extend(colour);
    }
    binary.push(3);
    [0i32, 1, 2].iter().for_each(|index| binary.extend(index.to_le_bytes()));
    binary.push(0);
    [4i32, 0, 1, 2, -1].iter().for_each(|index| binary.extend(index.to_le_bytes()));
    vec![ascii.into_bytes(), binary]
}

pub(super) fn obj_seeds() -> Vec<Vec<u8>> {
    let text = "mtllib m.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvn 0 0 1\nusemtl a\n\
                f 1/1/1 2/2/1 \\\n3/1/1\nf -1 -2 -3\n";
    let units = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    vec![text.into(), units]
}

pub(super) fn glb_seeds() -> Vec<Vec<u8>> {
    let json = r#"{"asset":{"version":"2.0"},"buffers":[{}],"bufferViews":[{"buffer":0,"byteLength":36},
        {"buffer":0,"byteOffset":36,"byteLength":24}],"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
        {"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],"meshes":[{"primitives":[{"attributes":{"POSITION":0,
        "TEXCOORD_0":1},"material":0}]}],"materials":[{"pbrMetallicRoughness":{"baseColorFactor":[1,0,0.5,1]}}],
        "nodes":[{"mesh":0,"scale":[1,2,1]}],"scenes":[{"nodes":[0]}]}"#;
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let numbers: [f32; 15] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
    let binary: Vec<u8> = numbers.iter().flat_map(|value| value.to_le_bytes()).collect();
    let chunk = |kind: &[u8], content: &[u8]| [&(content.len() as u32).to_le_bytes(), kind, content].concat();
    let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &binary)].concat();
    let length = 12 + chunks.len() as u32;
    vec![[b"glTF", &2u32.to_le_bytes(), &length.to_le_bytes(), &chunks[..]].concat()]
}
