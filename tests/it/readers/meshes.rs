//! Meshes as other programs write them, and as files are damaged and lose their company: read right, noted, or refused by name.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use xavatar::mesh::{Colouring, Loss, ReadMesh, SurfacePoint, Topology, TriangleMesh, read_mesh};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

fn read(name: &str) -> ReadMesh {
    let read = read_mesh(fixture("meshes").join(name)).unwrap();
    read.mesh.check().unwrap();
    read
}

fn losses(read: &ReadMesh) -> Vec<Loss> {
    read.notes.iter().map(|note| note.lost).collect()
}

/// The colours at the centres of all faces, each once, in bytes.
fn face_colours(mesh: &TriangleMesh) -> Vec<[u8; 3]> {
    let centre = |face| SurfacePoint { face, barycentric: [1.0 / 3.0; 3] };
    let colour = |face| mesh.colour_at(&centre(face)).unwrap().to_array().map(|c| (c * 255.0).round() as u8);
    let mut colours: Vec<[u8; 3]> = (0..mesh.faces.len() as u32).map(colour).collect();
    colours.sort_unstable();
    colours.dedup();
    colours
}

const RED: [u8; 3] = [200, 60, 20];
const BLUE: [u8; 3] = [20, 60, 200];

// All of them are the same cube of 8 vertices and 12 faces.
#[test]
fn a_cube_is_a_cube_whatever_its_file_lacks_or_adds() {
    for (name, lost) in [
        ("without-its-material-file.obj", vec![Loss::Colours]),
        ("normals-that-are-not-there.obj", vec![Loss::Normals]),
        ("continued-lines.obj", vec![]),
        ("two-textures.obj", vec![]),
        ("longer-lines.ply", vec![]),
        ("utf-16.obj", vec![]),
        ("texture-by-face.ply", vec![]),
        ("diffuse-colours.ply", vec![]),
        ("real-colours-to-255.ply", vec![]),
        ("one-coloured-vertex.obj", vec![Loss::SomeColours]),
        ("two-corners.obj", vec![Loss::Faces]),
        ("colours-that-are-no-numbers.obj", vec![Loss::Colours]),
        ("colours-r-g-b.ply", vec![]),
        ("texture-without-usemtl.obj", vec![]),
    ] {
        let read = read(name);
        let cube = read.mesh.merged_by_position();
        assert_eq!((losses(&read), cube.vertices.len(), cube.faces.len()), (lost, 8, 12), "{name}: {:?}", read.notes);
        assert!(Topology::of(&cube).is_watertight() && (cube.volume().abs() - 1.0).abs() < 1e-9, "{name}");
    }
}

#[test]
fn colours_are_those_that_the_files_have() {
    for (name, expected) in [
        ("texture-by-face.ply", vec![RED]),
        ("diffuse-colours.ply", vec![RED]),
        ("real-colours-to-255.ply", vec![RED]),
        ("colours-r-g-b.ply", vec![RED]),
        ("texture-without-usemtl.obj", vec![RED]),
        ("two-textures.obj", vec![BLUE, RED]),
        ("longer-lines.ply", vec![[9, 9, 9]]),
    ] {
        assert_eq!(face_colours(&read(name).mesh), expected, "{name}");
    }
    let Colouring::Vertex(colours) = read("one-coloured-vertex.obj").mesh.colouring else { panic!() };
    assert_eq!(colours, [128; 8].map(|grey| [grey; 3]), "half of the light, and what is unknown is grey");
    let Colouring::Texture { image, .. } = read("texture-without-usemtl.obj").mesh.colouring else { panic!() };
    assert_eq!(image.dimensions(), (4, 4));
}

// A strip of 0 1 2 3 has two triangles, -1 ends it.
#[test]
fn strips_are_faces() {
    assert_eq!(read("strips.ply").mesh.faces, [[0, 1, 2], [2, 1, 3]]);
}

#[test]
fn what_trimesh_writes_is_what_it_was_given() {
    let box_of = |name: &str| {
        let ReadMesh { mesh, notes } = read_mesh(fixture("trimesh").join(name)).unwrap();
        assert_eq!(notes, [], "{name}");
        let merged = mesh.merged_by_position();
        assert_eq!((merged.vertices.len(), merged.faces.len()), (8, 12), "{name}");
        assert!((merged.volume() - 1.0).abs() < 1e-6 && (merged.area() - 7.0).abs() < 1e-6, "{name}");
        mesh
    };
    for name in ["coloured.glb", "coloured.ply", "coloured.obj"] {
        assert_eq!(face_colours(&box_of(name)), [RED], "{name}");
    }
    for name in ["textured.glb", "textured/textured.obj"] {
        let mesh = box_of(name);
        for face in 0..12 {
            let [a, b, c] = mesh.corners(face);
            let x = (a.x + b.x + c.x) / 3.0;
            let point = SurfacePoint { face, barycentric: [1.0 / 3.0; 3] };
            let colour = mesh.colour_at(&point).unwrap() * 255.0;
            let expected = if x < 0.0 { RED } else { BLUE };
            assert!(colour.abs_diff_eq(expected.map(f32::from).into(), 1.0), "{name} at {x}: {colour}");
        }
    }
}

#[test]
fn the_content_tells_the_format_and_extensions_may_be_of_any_case() {
    let folder = tempfile::tempdir().unwrap();
    for (source, name) in [
        ("meshes/diffuse-colours.ply", "SCAN.PLY"),
        ("meshes/continued-lines.obj", "SCAN.OBJ"),
        ("trimesh/coloured.glb", "SCAN.GLB"),
        ("meshes/diffuse-colours.ply", "misnamed.obj"),
        ("trimesh/coloured.glb", "misnamed.ply"),
        ("meshes/continued-lines.obj", "without-extension"),
    ] {
        let path = folder.path().join(name);
        fs::copy(fixture(source), &path).unwrap();
        assert_eq!(read_mesh(&path).unwrap().mesh.merged_by_position().vertices.len(), 8, "{name}");
    }
}

#[test]
fn other_formats_and_files_without_a_vertex_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    for (name, content, words) in [
        ("a.stl", &b"solid cube\nfacet normal 0 0 1\n"[..], "STL"),
        ("a.STL", &[0; 84], "STL"),
        ("a.fbx", b"Kaydara FBX Binary  \0\x1a\0", "FBX"),
        ("a.off", b"OFF\n8 12 0\n", "OFF"),
        ("a.dae", b"<?xml version=\"1.0\"?><COLLADA>", "COLLADA"),
        ("a.gltf", b"{\"asset\":{\"version\":\"2.0\"}}", "other files"),
        ("a.ply.gz", &[0x1f, 0x8b, 8, 0], "gzip"),
        ("a.usdz", b"PK\x03\x04", "USDZ"),
        ("a.xyz", b"1 2 3\n", "no known format"),
        ("a.obj", b"", "without a vertex"),
        ("a.obj", b"\0\0\0\0 no mesh at all", "without a vertex"),
        ("a.obj", b"V 0 0 0\nF 1 1 1\n", "without a vertex"),
        (
            "a.ply",
            b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
            "without a vertex",
        ),
        ("a.ply", b"", "the end of the file"),
        ("a.glb", b"", "`glTF`"),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, content).unwrap();
        let error = read_mesh(&path).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains(name) && error.len() < 300, "{error}");
    }
}

#[test]
fn damaged_meshes_are_read_or_refused_and_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(9);
    for name in ["a.png", "b.png", "two.mtl"] {
        fs::copy(fixture("meshes").join(name), folder.path().join(name)).unwrap();
    }
    for source in [
        "meshes/two-textures.obj",
        "meshes/texture-by-face.ply",
        "meshes/strips.ply",
        "meshes/utf-16.obj",
        "trimesh/coloured.ply",
        "trimesh/coloured.glb",
        "trimesh/textured.glb",
    ] {
        let whole = fs::read(fixture(source)).unwrap();
        let path = folder.path().join(Path::new(source).file_name().unwrap());
        let sound = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            match read_mesh(&path) {
                Ok(read) => read.mesh.check().unwrap(),
                Err(error) => assert!(error.to_string().len() < 500, "{error}"),
            }
        };
        (0..whole.len()).step_by(1 + whole.len() / 100).for_each(|length| sound(&whole[..length]));
        for _ in 0..300 {
            let mut bytes = whole.clone();
            for _ in 0..random.random_range(1..4) {
                let place = random.random_range(0..bytes.len());
                bytes[place] ^= random.random_range(1..=255u8);
            }
            sound(&bytes);
        }
    }
}

/// What `info` prints of a fixture, and its exit code.
fn info(name: &str) -> (Option<i32>, String) {
    let output =
        Command::new(env!("CARGO_BIN_EXE_xavatar")).arg("info").arg(fixture("meshes").join(name)).output().unwrap();
    (output.status.code(), String::from_utf8([output.stdout, output.stderr].concat()).unwrap())
}

#[test]
fn info_says_what_was_lost_and_names_a_broken_picture() {
    let (code, printed) = info("without-its-material-file.obj");
    assert_eq!(code, Some(0));
    assert!(printed.contains("8 vertices, 12 faces, no colours"), "{printed}");
    assert!(
        printed.contains("warning: colours are lost: material files not beside the mesh: \"scan.mtl\""),
        "{printed}"
    );
    let (code, printed) = info("diffuse-colours.ply");
    assert!(code == Some(0) && printed.contains("vertex colours, (200, 60, 20) on average"), "{printed}");
    let (code, printed) = info("broken-palette.obj");
    assert!(code == Some(1) && printed.contains("tex.png: not a valid image"), "{printed}");
    assert!(!printed.contains("panicked"), "{printed}");
}
