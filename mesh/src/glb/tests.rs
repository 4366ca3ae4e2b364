use std::io::Cursor;
use std::path::Path;

use glam::{Quat, Vec3};
use image::{ImageFormat, Rgb, RgbImage};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use super::read_glb;
use crate::testing::face_colour;
use crate::{Colouring, Loss, ReadMesh};
use xavatar_formats::{Error, Result};

const FLOAT: u32 = 5126;
const BYTE: u32 = 5121;

/// A file under construction.
struct Scene {
    document: Value,
    binary: Vec<u8>,
}

impl Scene {
    /// A triangle at the origin in one node.
    fn triangle() -> Self {
        let document = json!({
            "asset": { "version": "2.0" },
            "buffers": [{}], "bufferViews": [], "accessors": [],
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": {} }] }],
        });
        let mut scene = Self { document, binary: Vec::new() };
        let position = scene.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        scene.attribute("POSITION", position);
        scene
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let views = self.document["bufferViews"].as_array_mut().unwrap();
        views.push(json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() }));
        self.binary.extend(bytes);
        views.len() - 1
    }

    fn accessor(&mut self, kind: u32, shape: &str, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let accessors = self.document["accessors"].as_array_mut().unwrap();
        accessors.push(json!({ "bufferView": view, "componentType": kind, "type": shape, "count": count }));
        accessors.len() - 1
    }

    fn floats(&mut self, shape: &str, values: &[f32]) -> usize {
        let columns = match shape {
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(FLOAT, shape, values.len() / columns, &bytes)
    }

    fn indices(&mut self, values: &[u8]) -> usize {
        self.accessor(BYTE, "SCALAR", values.len(), values)
    }

    fn primitive(&mut self) -> &mut Value {
        &mut self.document["meshes"][0]["primitives"][0]
    }

    fn attribute(&mut self, name: &str, accessor: usize) {
        self.primitive()["attributes"][name] = accessor.into();
    }

    /// Adds a picture of one colour as a texture.
    fn texture(&mut self, colour: [u8; 3]) -> usize {
        let mut png = Cursor::new(Vec::new());
        RgbImage::from_pixel(2, 2, Rgb(colour)).write_to(&mut png, ImageFormat::Png).unwrap();
        let view = self.view(&png.into_inner());
        for (key, value) in [
            ("images", json!({ "bufferView": view, "mimeType": "image/png" })),
            ("textures", json!({ "source": self.count("images") })),
        ] {
            if self.document[key].is_null() {
                self.document[key] = json!([]);
            }
            self.document[key].as_array_mut().unwrap().push(value);
        }
        self.count("textures") - 1
    }

    fn count(&self, key: &str) -> usize {
        self.document[key].as_array().map_or(0, Vec::len)
    }

    fn bytes(&self) -> Vec<u8> {
        let mut json = self.document.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut binary = self.binary.clone();
        binary.resize(binary.len().next_multiple_of(4), 0);
        let chunk = |kind: &[u8], content: &[u8]| [&(content.len() as u32).to_le_bytes(), kind, content].concat();
        let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &binary)].concat();
        [b"glTF", &2u32.to_le_bytes(), &(12 + chunks.len() as u32).to_le_bytes(), &chunks[..]].concat()
    }

    fn read(&self) -> Result<ReadMesh> {
        read_glb(Path::new("scan.glb"), &self.bytes())
    }

    fn refusal(&self) -> String {
        self.read().unwrap_err().to_string()
    }
}

#[test]
fn vertex_colours_are_linear_and_normals_and_indices_are_read() {
    let mut scene = Scene::triangle();
    // 0.5775804 is sRGB 200, 0.0451862 is 60, 0.0069954 is 20.
    let colour = [0.577_580_4, 0.045_186_2, 0.006_995_4];
    let colours = scene.floats("VEC3", &[colour, colour, [0.0, 0.0, 1.0]].concat());
    scene.attribute("COLOR_0", colours);
    let normals = scene.floats("VEC3", &[0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    scene.attribute("NORMAL", normals);
    let indices = scene.indices(&[2, 0, 1]);
    scene.primitive()["indices"] = indices.into();
    let ReadMesh { mesh, notes } = scene.read().unwrap();
    assert_eq!((notes, &mesh.faces[..]), (vec![], &[[2, 0, 1]][..]));
    assert_eq!((mesh.vertices, mesh.normals), (vec![Vec3::ZERO, Vec3::X, Vec3::Y], Some(vec![Vec3::Z; 3])));
    assert!(matches!(mesh.colouring, Colouring::Vertex(c) if c == [[200, 60, 20], [200, 60, 20], [0, 0, 255]]));
}

#[test]
fn nodes_place_their_meshes_and_a_mirror_keeps_the_outside() {
    let mut scene = Scene::triangle();
    let normals = scene.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    scene.attribute("NORMAL", normals);
    let turn = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    scene.document["nodes"] = json!([
        { "children": [1, 2], "translation": [0, 0, 5] },
        { "mesh": 0, "scale": [2, 1, 1], "rotation": turn.to_array() },
        { "mesh": 0, "scale": [-1, 1, 1] },
        { "mesh": 0 },
    ]);
    let mesh = scene.read().unwrap().mesh;
    assert_eq!(mesh.faces, [[0, 1, 2], [3, 5, 4]], "the node that is not in the scene is left out");
    let expected =
        [[0.0, 0.0, 5.0], [2.0, 0.0, 5.0], [0.0, 0.0, 6.0], [0.0, 0.0, 5.0], [-1.0, 0.0, 5.0], [0.0, 1.0, 5.0]];
    assert!(mesh.vertices.iter().zip(expected).all(|(found, place)| found.abs_diff_eq(place.into(), 1e-5)));
    let normals = mesh.normals.clone().unwrap();
    assert!(normals[1].abs_diff_eq(Vec3::NEG_Y, 1e-5) && normals[4].abs_diff_eq(Vec3::Z, 1e-5));
    assert!((0..2).all(|face| mesh.face_normal(face).dot(normals[3 * face as usize]) > 0.99));
}

#[test]
fn joints_move_what_they_are_bound_to() {
    let mut scene = Scene::triangle();
    let joints = scene.accessor(BYTE, "VEC4", 3, &[0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]);
    let weights = scene.floats("VEC4", &[0.5, 0.5, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    scene.attribute("JOINTS_0", joints);
    scene.attribute("WEIGHTS_0", weights);
    let mut matrices = [glam::Mat4::IDENTITY; 2].map(|matrix| matrix.to_cols_array());
    matrices[1][13] = -1.0;
    let binds = scene.floats("MAT4", &matrices.concat());
    scene.document["skins"] = json!([{ "joints": [1, 2], "inverseBindMatrices": binds }]);
    // The node of a skinned mesh does not move it.
    scene.document["nodes"] = json!([
        { "mesh": 0, "skin": 0, "translation": [100, 0, 0] }, { "translation": [0, 0, 3] }, { "translation": [0, 2, 0] }
    ]);
    let mesh = scene.read().unwrap().mesh;
    // Joint 0 moves by (0, 0, 3), joint 1 by (0, 2, 0) - (0, 1, 0); the last vertex is moved by none.
    assert_eq!(mesh.vertices, [Vec3::new(0.0, 0.5, 1.5), Vec3::new(1.0, 1.0, 0.0), Vec3::Y]);
}

#[test]
fn strips_and_fans_are_triangles() {
    for (mode, indices, faces) in [
        (5, &[0, 1, 2, 0, 1][..], vec![[0, 1, 2], [2, 1, 0], [2, 0, 1]]),
        (6, &[0, 1, 2, 1], vec![[0, 1, 2], [0, 2, 1]]),
        (4, &[0, 1, 2, 0, 1], vec![[0, 1, 2]]),
    ] {
        let mut scene = Scene::triangle();
        let indices = scene.indices(indices);
        scene.primitive()["indices"] = indices.into();
        scene.primitive()["mode"] = mode.into();
        assert_eq!(scene.read().unwrap().mesh.faces, faces, "mode {mode}");
    }
    let mut scene = Scene::triangle();
    let points = json!({ "attributes": { "POSITION": 0 }, "mode": 0 });
    scene.document["meshes"][0]["primitives"].as_array_mut().unwrap().push(points);
    scene.document["meshes"][0]["weights"] = json!([0.0, 0.5]);
    let losses: Vec<Loss> = scene.read().unwrap().notes.iter().map(|note| note.lost).collect();
    assert_eq!(losses, [Loss::Other, Loss::Other], "the points and the morph target");
}

#[test]
fn quantised_numbers_are_scaled() {
    let mut scene = Scene::triangle();
    let position = scene.accessor(
        5123,
        "VEC3",
        3,
        &[[0u16; 3], [65535, 0, 0], [0, 65535, 0]].map(|row| row.map(u16::to_le_bytes)).concat().concat(),
    );
    scene.document["accessors"][position]["normalized"] = true.into();
    scene.attribute("POSITION", position);
    scene.document["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    scene.document["nodes"][0]["scale"] = json!([2, 2, 2]);
    assert_eq!(scene.read().unwrap().mesh.vertices, [Vec3::ZERO, 2.0 * Vec3::X, 2.0 * Vec3::Y]);
}

/// Two triangles whose materials have different colours.
fn two_materials(first: Value, second: Value) -> Scene {
    let mut scene = Scene::triangle();
    let uvs = scene.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    scene.attribute("TEXCOORD_0", uvs);
    scene.primitive()["material"] = 0.into();
    let mut other = scene.primitive().clone();
    other["material"] = 1.into();
    scene.document["meshes"][0]["primitives"].as_array_mut().unwrap().push(other);
    scene.document["materials"] = json!([{ "pbrMetallicRoughness": first }, { "pbrMetallicRoughness": second }]);
    scene
}

#[test]
fn pictures_and_factors_of_materials_are_the_colours_of_faces() {
    let texture = json!({ "baseColorTexture": { "index": 0 } });
    for (first, second, expected) in [
        (texture.clone(), json!({ "baseColorTexture": { "index": 1 } }), [[200, 60, 20], [0, 255, 0]]),
        (texture.clone(), json!({ "baseColorFactor": [0.0, 1.0, 0.2140, 1] }), [[200, 60, 20], [0, 255, 127]]),
        (
            json!({ "baseColorFactor": [0.2140, 1.0, 1.0, 1] }),
            json!({ "baseColorFactor": [0, 0, 1, 1] }),
            [[127, 255, 255], [0, 0, 255]],
        ),
        // Half of the light of sRGB 200 is sRGB 146.
        (
            json!({ "baseColorTexture": { "index": 0 }, "baseColorFactor": [0.5, 1, 0, 1] }),
            texture,
            [[146, 60, 0], [200, 60, 20]],
        ),
    ] {
        let mut scene = two_materials(first, second);
        scene.texture([200, 60, 20]);
        scene.texture([0, 255, 0]);
        let ReadMesh { mesh, notes } = scene.read().unwrap();
        assert_eq!((notes, [face_colour(&mesh, 0), face_colour(&mesh, 1)]), (vec![], expected));
    }
    let mut scene = two_materials(json!({}), json!({}));
    scene.texture([200, 60, 20]);
    scene.document["materials"][0]["extensions"] =
        json!({ "KHR_materials_pbrSpecularGlossiness": { "diffuseTexture": { "index": 0 } } });
    assert_eq!(face_colour(&scene.read().unwrap().mesh, 0), [200, 60, 20]);
}

#[test]
fn row_0_of_a_picture_is_v_0_and_transforms_are_applied() {
    let coordinates = |transform: Value| {
        let texture = json!({ "index": 0, "extensions": { "KHR_texture_transform": transform } });
        let mut scene =
            two_materials(json!({ "baseColorTexture": texture }), json!({ "baseColorTexture": { "index": 0 } }));
        scene.texture([1, 2, 3]);
        let Colouring::Texture { uvs, .. } = scene.read().unwrap().mesh.colouring else { panic!() };
        [uvs[1], uvs[2], uvs[4]].map(|uv| (uv * 1e4).round() / 1e4).map(|uv| uv.to_array())
    };
    assert_eq!(coordinates(json!({})), [[1.0, 0.0], [0.0, 1.0], [1.0, 0.0]]);
    let moved = json!({ "offset": [0.25, 0.5], "scale": [0.5, 0.25] });
    assert_eq!(coordinates(moved), [[0.75, 0.5], [0.25, 0.75], [1.0, 0.0]]);
    // A quarter turn takes u to v, and v to -u, which the offset brings back.
    let turned = json!({ "offset": [1, 0], "rotation": std::f32::consts::FRAC_PI_2 });
    assert_eq!(coordinates(turned), [[1.0, 1.0], [0.0, 0.0], [1.0, 0.0]]);
}

#[test]
fn pictures_that_cannot_be_had_are_noted_and_broken_ones_are_errors() {
    let texture = json!({ "baseColorTexture": { "index": 0 } });
    let mut scene = two_materials(texture.clone(), texture);
    scene.texture([1, 2, 3]);
    let whole = scene.document["images"][0].clone();
    let mut read = |image: Value, texture: Value| {
        scene.document["images"][0] = image;
        scene.document["textures"][0] = texture;
        scene.read()
    };
    let gone = read(json!({ "uri": "gone.png" }), json!({ "source": 0 })).unwrap();
    assert_eq!(gone.notes.len(), 1);
    assert!(gone.notes[0].lost == Loss::Colours && gone.notes[0].why.contains("\"gone.png\""), "{:?}", gone.notes);
    let other = read(whole.clone(), json!({ "extensions": { "KHR_texture_basisu": { "source": 0 } } })).unwrap();
    assert!(other.notes[0].why.contains("KHR_texture_basisu"), "{:?}", other.notes);
    let error = read(json!({ "uri": "data:image/png;base64,iVBORw0KGgo=" }), json!({ "source": 0 })).unwrap_err();
    assert!(error.to_string().contains("scan.glb: not a valid GLB: image 0"), "{error}");
    let mut png = Cursor::new(Vec::new());
    RgbImage::from_pixel(1, 1, Rgb([9, 8, 7])).write_to(&mut png, ImageFormat::Png).unwrap();
    let encoded = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, png.into_inner());
    let inline = read(json!({ "uri": format!("data:image/png;base64,{encoded}") }), json!({ "source": 0 })).unwrap();
    assert_eq!(face_colour(&inline.mesh, 0), [9, 8, 7]);
}

#[test]
fn what_is_not_read_is_refused_by_its_name() {
    let refusal = |change: &dyn Fn(&mut Value)| {
        let mut scene = Scene::triangle();
        change(&mut scene.document);
        scene.refusal()
    };
    for (key, value, words) in [
        ("extensionsRequired", json!(["KHR_draco_mesh_compression"]), "KHR_draco_mesh_compression"),
        ("extensionsRequired", json!(["EXT_meshopt_compression"]), "EXT_meshopt_compression"),
        ("buffers", json!([{ "uri": "scan.bin" }]), "in another file"),
        ("nodes", json!([{ "children": [0], "mesh": 0 }]), "in a circle"),
        ("nodes", json!([{ "children": [2] }, { "children": [2] }, { "mesh": 0 }]), "node 1"),
        ("nodes", json!([{ "children": [9] }]), "the parent of 9"),
        ("nodes", json!([{ "mesh": 9 }]), "mesh 9"),
        ("nodes", json!([{ "mesh": 0, "skin": 0 }]), "skin 0"),
        ("nodes", json!([{ "mesh": 0, "rotation": [0, 0, 0, 0] }]), "finite"),
        ("accessors", json!([]), "accessor 0"),
        ("bufferViews", json!([]), "buffer view 0"),
        ("materials", json!(7), "JSON"),
    ] {
        let error = refusal(&|document| document[key] = value.clone());
        assert!(error.contains(words) && error.contains("scan.glb") && error.len() < 300, "{key}: {error}");
    }
    for (key, value) in [
        ("count", json!(4)),
        ("count", json!(1u64 << 60)),
        ("byteOffset", json!(u64::MAX)),
        ("componentType", json!(5124)),
        ("type", json!("VEC2")),
        ("sparse", json!({ "count": 1 })),
        ("bufferView", Value::Null),
    ] {
        let error = refusal(&|document| document["accessors"][0][key] = value.clone());
        assert!(error.contains("accessor 0"), "{key}: {error}");
    }
    let mut scene = Scene::triangle();
    let indices = scene.indices(&[0, 1, 3]);
    scene.primitive()["indices"] = indices.into();
    assert!(scene.refusal().contains("vertex index 3"));
    let mut first_version = Scene::triangle().bytes();
    first_version[4] = 1;
    assert!(read_glb(Path::new("scan.glb"), &first_version).unwrap_err().to_string().contains("version"));
}

#[test]
fn instances_cannot_make_more_than_the_file_explains() {
    let mut scene = Scene::triangle();
    scene.document["nodes"] = (0..1000).map(|_| json!({ "mesh": 0 })).collect();
    scene.document["scenes"] = json!([{ "nodes": (0..1000).collect::<Vec<usize>>() }]);
    assert_eq!(scene.read().unwrap().mesh.faces.len(), 1000);
    let heavy = scene.indices(&[0, 1, 2].repeat(1000));
    scene.primitive()["indices"] = heavy.into();
    assert!(matches!(scene.read(), Err(Error::Refused { .. })));
}

#[test]
fn truncations_and_mutations_never_panic_and_what_is_read_is_sound() {
    let texture = json!({ "baseColorTexture": { "index": 0 } });
    let mut scene = two_materials(texture, json!({ "baseColorFactor": [0.2, 0.4, 0.6, 1.0] }));
    scene.texture([200, 60, 20]);
    let indices = scene.indices(&[0, 1, 2]);
    scene.primitive()["indices"] = indices.into();
    let bytes = scene.bytes();
    scene.read().unwrap();
    for length in 0..bytes.len() {
        assert!(read_glb(Path::new("scan.glb"), &bytes[..length]).is_err(), "{length}");
    }
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for _ in 0..10_000 {
        let mut bytes = bytes.clone();
        for _ in 0..rng.random_range(1..4) {
            let at = rng.random_range(0..bytes.len());
            bytes[at] = if rng.random() { b"0123456789,[]{}\""[rng.random_range(0..16)] } else { rng.random() };
        }
        read_glb(Path::new("scan.glb"), &bytes).into_iter().for_each(|read| read.mesh.check().unwrap());
    }
}
