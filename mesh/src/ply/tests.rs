use std::path::Path;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{read_ply, write_ply};
use crate::testing::face_colour;
use crate::{Colouring, Loss, ReadMesh, TriangleMesh, read_mesh};

fn coloured_mesh() -> TriangleMesh {
    TriangleMesh {
        vertices: vec![Vec3::ZERO, Vec3::X, Vec3::new(0.1, 1.0, -0.3), Vec3::new(1e-7, -2.5e8, 1.0 / 3.0)],
        faces: vec![[0, 1, 2], [2, 1, 3]],
        normals: Some(vec![Vec3::Z, Vec3::NEG_Y, Vec3::new(0.6, 0.0, 0.8), Vec3::ONE.normalize()]),
        colouring: Colouring::Vertex(vec![[0, 1, 2], [255, 254, 253], [7, 8, 9], [128, 0, 64]]),
    }
}

fn written(mesh: &TriangleMesh) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.ply");
    write_ply(&path, mesh).unwrap();
    std::fs::read(path).unwrap()
}

fn parsed(bytes: &[u8]) -> Option<TriangleMesh> {
    read_ply(Path::new("mesh.ply"), bytes).ok().map(|read| read.mesh)
}

fn lost(read: &ReadMesh) -> Vec<Loss> {
    read.notes.iter().map(|note| note.lost).collect()
}

/// An ascii file.
fn ascii(header: &str, body: &str) -> Vec<u8> {
    format!("ply\nformat ascii 1.0\n{header}\nend_header\n{body}").into_bytes()
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z";
const LIST: &str = "property list uchar int vertex_indices";

const QUAD: &str = "ply\r\nformat ascii 1.0\r\ncomment made by hand\r\nelement material 1\nproperty list uchar float shine\n\
    element vertex 4\nproperty double z\nproperty double y\nproperty float confidence\nproperty double x\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n\
    element face 1\nproperty short flags\nproperty list ushort int vertex_index\nend_header\n\
    2 0.5 0.25\n0 0 .5 0 1 2 3 255\n0 0 .5 1 4 5 6 255\n0 1 .5 1 7 8 9 255\n0 1 .5 0 10 11 12 255\n-1 4 0 1 2 3";

#[test]
fn round_trip_is_the_identity() {
    let mesh = coloured_mesh();
    let back = parsed(&written(&mesh)).unwrap();
    assert_eq!((&back.vertices, &back.faces, &back.normals), (&mesh.vertices, &mesh.faces, &mesh.normals));
    let (Colouring::Vertex(a), Colouring::Vertex(b)) = (&back.colouring, &mesh.colouring) else { panic!() };
    assert_eq!(a, b);
}

#[test]
fn a_texture_makes_the_round_trip_beside_the_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.v1.ply");
    let image = RgbImage::from_fn(3, 2, |x, y| Rgb([x as u8, y as u8, 9]));
    let uvs = vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::splat(0.3)];
    let mesh = TriangleMesh {
        colouring: Colouring::Texture { uvs: uvs.clone(), image: Arc::new(image.clone()) },
        ..coloured_mesh()
    };
    write_ply(&path, &mesh).unwrap();
    let ReadMesh { mesh: back, notes } = read_mesh(&path).unwrap();
    assert_eq!((notes, &back.faces, &back.normals), (vec![], &mesh.faces, &mesh.normals));
    let Colouring::Texture { uvs: back_uvs, image: back_image } = back.colouring else { panic!() };
    assert_eq!(back_uvs, uvs);
    assert_eq!(*back_image, image);

    std::fs::remove_file(path.with_extension("png")).unwrap();
    let ReadMesh { mesh: back, notes } = read_mesh(&path).unwrap();
    assert!(notes.len() == 1 && notes[0].to_string().starts_with("colours are lost: the picture \"scan.v1.png\""));
    assert_eq!((&back.vertices, &back.faces), (&mesh.vertices, &mesh.faces));
}

#[test]
fn ascii_polygons_unknown_elements_and_any_column_order_are_read() {
    let mesh = parsed(QUAD.as_bytes()).unwrap();
    assert_eq!(mesh.vertices, [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]);
    assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3]]);
    assert!(matches!(mesh.colouring, Colouring::Vertex(colours) if colours[3] == [10, 11, 12]));
}

#[test]
fn the_three_encodings_say_the_same() {
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty float x\nproperty double y\nproperty short z\n\
             element face 1\nproperty list uint uchar vertex_indices\nend_header\n"
        )
    };
    let rows = [(0.5f32, 1.0f64, -3i16), (0.25, 2.0, 4), (-7.0, 0.125, 300)];
    let mut little = header("binary_little_endian").into_bytes();
    let mut big = header("binary_big_endian").into_bytes();
    let mut ascii = header("ascii");
    for (x, y, z) in rows {
        little.extend([&x.to_le_bytes()[..], &y.to_le_bytes(), &z.to_le_bytes()].concat());
        big.extend([&x.to_be_bytes()[..], &y.to_be_bytes(), &z.to_be_bytes()].concat());
        ascii += &format!("{x} {y} {z}\n");
    }
    little.extend([3, 0, 0, 0, 2, 1, 0]);
    big.extend([0, 0, 0, 3, 2, 1, 0]);
    ascii += "3 2 1 0\n";
    let expected = rows.map(|(x, y, z)| Vec3::new(x, y as f32, f32::from(z)));
    for bytes in [little, big, ascii.into_bytes()] {
        let mesh = parsed(&bytes).unwrap();
        assert_eq!(mesh.vertices, expected);
        assert_eq!(mesh.faces, [[2, 1, 0]]);
    }
}

#[test]
fn every_truncation_of_a_binary_file_is_an_error() {
    let bytes = written(&coloured_mesh());
    assert!((0..bytes.len()).all(|length| parsed(&bytes[..length]).is_none()));
}

/// A triangle with the given properties and values of its vertices, and of its face after the corners.
fn triangle(vertex: [&str; 2], face: [&str; 2]) -> ReadMesh {
    let header = format!("element vertex 3\n{XYZ}\n{}\nelement face 1\n{LIST}\n{}", vertex[0], face[0]);
    let rows = [[0, 0, 0], [1, 0, 0], [0, 1, 0]].map(|[x, y, z]| format!("{x} {y} {z} {}\n", vertex[1])).concat();
    let read = read_ply(Path::new("mesh.ply"), &ascii(&header, &format!("{rows}3 0 1 2 {}\n", face[1]))).unwrap();
    read.mesh.check().unwrap();
    read
}

#[test]
fn colours_of_vertices_are_read_by_all_their_names_and_numbers() {
    let with = |kind: &str, names: [&str; 3], values: &str| {
        let properties = names.map(|name| format!("property {kind} {name}")).join("\n");
        let read = triangle([&properties, values], ["", ""]);
        assert_eq!(read.notes, [], "{kind} {names:?}");
        let Colouring::Vertex(colours) = read.mesh.colouring else { panic!("{kind} {names:?}") };
        colours[1]
    };
    let rgb = ["red", "green", "blue"];
    for names in [rgb, ["diffuse_red", "diffuse_green", "diffuse_blue"], ["r", "g", "b"], ["Red", "Green", "Blue"]] {
        assert_eq!(with("uchar", names, "200 60 20"), [200, 60, 20]);
    }
    for (kind, values) in [
        ("float", "200 60 20"),
        ("double", "0.7843 0.2353 0.0784"),
        ("int", "200 60 20"),
        ("ushort", "51400 15420 5140"),
        ("float", "51400 15420 5140"),
    ] {
        assert_eq!(with(kind, rgb, values), [200, 60, 20], "{kind}");
    }
}

#[test]
fn colours_that_mean_nothing_known_are_named() {
    for (property, value) in [("float rgb", "1.5"), ("uint packed_color", "7"), ("float f_dc_0", "0.1")] {
        let read = triangle([&format!("property {property}"), value], ["", ""]);
        let name = property.split(' ').next_back().unwrap();
        assert!(lost(&read) == [Loss::Colours] && read.notes[0].why.contains(name), "{:?}", read.notes);
    }
    let rgb = "property float red\nproperty float green\nproperty float blue";
    assert_eq!(lost(&triangle([rgb, "nan nan nan"], ["", ""])), [Loss::Colours]);
    assert_eq!(lost(&triangle(["property float quality", "1"], ["", ""])), [], "colourless, and says nothing else");
    let uv = "property float s\nproperty float t";
    assert_eq!(lost(&triangle([uv, "0 0"], ["", ""])), [Loss::Colours], "without a TextureFile");
}

#[test]
fn colours_of_faces_stand_in_for_those_of_vertices() {
    let header = format!(
        "element vertex 4\n{XYZ}\nelement face 2\n{LIST}\nproperty uchar red\nproperty uchar green\nproperty uchar blue"
    );
    let bytes = ascii(&header, "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 200 60 20\n3 0 2 3 1 2 3\n");
    let mesh = parsed(&bytes).unwrap();
    assert_eq!(mesh.faces, [[0, 1, 2], [4, 5, 3]], "shared vertices are split, the first kind keeps the number");
    assert_eq!((mesh.vertices[4], mesh.vertices[5]), (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
    let Colouring::Vertex(colours) = mesh.colouring else { panic!() };
    let one = [200, 60, 20];
    assert_eq!(colours, [one, one, one, [1, 2, 3], [1, 2, 3], [1, 2, 3]]);
    // Both: those of the vertices are finer.
    let rgb = "property uchar red\nproperty uchar green\nproperty uchar blue";
    let read = triangle([rgb, "7 8 9"], [rgb, "200 60 20"]);
    assert!(matches!(read.mesh.colouring, Colouring::Vertex(colours) if colours[0] == [7, 8, 9]));
}

/// A quad and a triangle with texture coordinates of their own, in two pictures that are red and green.
fn textured_by_face(folder: &Path, header: &str, faces: &str) -> ReadMesh {
    for (name, colour) in [("a b.png", [255, 0, 0]), ("b.png", [0, 255, 0])] {
        RgbImage::from_pixel(4, 4, Rgb(colour)).save(folder.join(name)).unwrap();
    }
    let header = format!("element vertex 5\n{XYZ}\nelement face 2\n{LIST}\n{header}");
    let bytes = ascii(&header, &format!("0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 2 0\n{faces}"));
    read_ply(&folder.join("mesh.ply"), &bytes).unwrap()
}

#[test]
fn texture_coordinates_of_faces_are_looked_up_in_the_picture_of_each() {
    let folder = tempfile::tempdir().unwrap();
    let list = "property list uchar float texcoord";
    let files = "comment TextureFile a b.png\ncomment TextureFile b.png";
    let quad = "4 0 1 2 3 8 0 0 1 0 1 1 0 1";
    let read = textured_by_face(
        folder.path(),
        &format!("{list}\nproperty int texnumber\n{files}"),
        &format!("{quad} 0\n3 3 2 4 6 0 0 1 0 0 1 1\n"),
    );
    assert_eq!((read.notes, read.mesh.faces.len()), (vec![], 3));
    assert_eq!([0, 1, 2].map(|face| face_colour(&read.mesh, face)), [[255, 0, 0], [255, 0, 0], [0, 255, 0]]);

    let one = format!("{list}\ncomment texturefile b.png");
    let read = textured_by_face(folder.path(), &one, &format!("{quad}\n3 3 2 4 0\n"));
    assert_eq!((lost(&read), face_colour(&read.mesh, 0)), (vec![Loss::SomeColours], [0, 255, 0]), "a face without any");
    assert_eq!(face_colour(&read.mesh, 2), [128; 3]);

    let missing = format!("{list}\ncomment TextureFile C:\\scans\\gone.png");
    let read = textured_by_face(folder.path(), &missing, &format!("{quad}\n3 3 2 4 0\n"));
    assert!(lost(&read) == [Loss::Colours] && read.notes[0].why.contains("gone.png"), "{:?}", read.notes);
}

#[test]
fn a_row_ends_with_its_line() {
    let header = format!("element vertex 3\n{XYZ}\nelement face 1\n{LIST}");
    let mesh = parsed(&ascii(&header, "0 0 0 9 9\n\n1 0 0 7\r\n0 1 0\n3 0 1 2 9 1 1 1 1\n")).unwrap();
    assert_eq!((mesh.vertices, mesh.faces), (vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]));
    let error = read_ply(Path::new("mesh.ply"), &ascii(&header, "0 0 0\n1 0\n0 0 1 0\n3 0 1 2\n")).unwrap_err();
    let error = error.to_string();
    assert!(error.contains("line 11 is the end of the line"), "{error}");
}

#[test]
fn returns_alone_and_utf_16_are_read() {
    let header = format!("element vertex 3\n{XYZ}\nelement face 1\n{LIST}");
    let text = String::from_utf8(ascii(&header, "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")).unwrap();
    let utf_16 = [0xfeffu16].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    for bytes in [text.replace('\n', "\r").into_bytes(), text.replace('\n', "\r\n").into_bytes(), utf_16] {
        assert_eq!(parsed(&bytes).unwrap().faces, [[0, 1, 2]]);
    }
    // A binary body may begin with a newline.
    let header =
        format!("ply\rformat binary_little_endian 1.0\relement vertex 1\r{}\rend_header\r", XYZ.replace('\n', "\r"));
    let bytes = [header.as_bytes(), &[b'\n', 0, 0, 0], &[0; 8]].concat();
    assert_eq!(parsed(&bytes).unwrap().vertices, [Vec3::X * f32::from_bits(10)]);
}

// A strip 0 1 2 3 is (0 1 2), (2 1 3): every other triangle is turned over so that all face the same way.
#[test]
fn strips_of_triangles_are_faces() {
    let header = format!("element vertex 6\n{XYZ}\nelement tristrips 1\nproperty list int int vertex_indices");
    let vertices = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n";
    let faces = |strips: &str| parsed(&ascii(&header, &format!("{vertices}{strips}"))).map(|mesh| mesh.faces);
    assert_eq!(faces("6 0 1 2 3 4 5\n").unwrap(), [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]]);
    assert_eq!(faces("8 0 1 2 -1 2 3 4 -1\n").unwrap(), [[0, 1, 2], [2, 3, 4]]);
    assert_eq!(faces("6 0 1 2 2 3 4\n").unwrap(), [[0, 1, 2], [3, 2, 4]], "two equal corners lead on");
    assert_eq!(faces("3 0 1 -2\n"), None);
    assert_eq!(faces("3 0 1 6\n"), None);
}

#[test]
fn an_element_without_rows_may_be_anything() {
    let header = format!("element vertex 1\n{XYZ}\nelement face 0\nproperty list uchar int corners\nelement edge 0");
    let read = read_ply(Path::new("mesh.ply"), &ascii(&header, "1 0 0\n")).unwrap();
    assert_eq!((read.mesh.vertices, read.mesh.faces.len(), read.notes), (vec![Vec3::X], 0, vec![]));
}

#[test]
fn faces_of_two_corners_and_unknown_elements_are_noted() {
    let header = format!("element vertex 3\n{XYZ}\nelement face 3\n{LIST}\nelement edge 2\nproperty int a");
    let bytes = ascii(&header, "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n2 0 1\n0\n0\n1\n");
    let read = read_ply(Path::new("mesh.ply"), &bytes).unwrap();
    assert_eq!((lost(&read), read.mesh.faces.len()), (vec![Loss::Faces, Loss::Other], 1));
    assert!(read.notes[0].why.contains('2') && read.notes[1].why.contains("elements, \"edge\""), "{:?}", read.notes);
}

#[test]
fn no_truncation_of_an_ascii_file_panics_and_a_missing_word_is_an_error() {
    for length in 0..QUAD.len() {
        let result = parsed(&QUAD.as_bytes()[..length]);
        // Only the last word, a single digit, is complete at the end.
        assert!(result.is_none(), "{length}");
    }
}

#[test]
fn mutations_never_panic_and_what_is_read_is_sound() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for source in [written(&coloured_mesh()), QUAD.as_bytes().to_vec()] {
        for _ in 0..5_000 {
            let mut bytes = source.clone();
            for _ in 0..rng.random_range(1..4) {
                let at = rng.random_range(0..bytes.len());
                bytes[at] = rng.random();
            }
            if let Some(mesh) = parsed(&bytes) {
                mesh.check().unwrap();
            }
        }
    }
}

#[test]
fn hostile_headers_are_refused_before_memory_is_asked_for() {
    let file = |vertex: &str, face: &str, tail: &[u8]| {
        let header = format!("ply\nformat binary_little_endian 1.0\n{vertex}\n{face}\nend_header\n");
        [header.as_bytes(), tail].concat()
    };
    let xyz = "property float x\nproperty float y\nproperty float z";
    let huge = file(&format!("element vertex 18446744073709551615\n{xyz}"), "", &[0; 12]);
    let empty_rows = file("element dust 18446744073709551615", &format!("element vertex 1\n{xyz}"), &[0; 12]);
    let list = format!("element vertex 1\n{xyz}\nelement face 1\nproperty list uint uint vertex_indices");
    let huge_list = file(&list, "", &[&[0; 12][..], &[255; 4]].concat());
    let outside = file(&list, "", &[&[0; 12][..], &[3, 0, 0, 0], &[0; 8], &[1, 0, 0, 0]].concat());
    let not_a_number = file(&list, "", &[&f32::NAN.to_le_bytes()[..], &[0; 8], &[3, 0, 0, 0], &[0; 12]].concat());
    for bytes in [huge, empty_rows, huge_list, outside, not_a_number] {
        assert!(parsed(&bytes).is_none());
    }
}

#[test]
fn a_mesh_that_is_not_sound_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.ply");
    write_ply(&path, &coloured_mesh()).unwrap();
    let before = std::fs::read(&path).unwrap();
    let mut mesh = coloured_mesh();
    mesh.faces.push([0, 1, 4]);
    assert!(write_ply(&path, &mesh).is_err());
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_bytes_after_a_valid_start_never_panic(tail in proptest::collection::vec(any::<u8>(), 0..200)) {
        for format in ["ascii", "binary_big_endian"] {
            let header = format!("ply\nformat {format} 1.0\nelement vertex 2\nproperty float x\nproperty float y\n\
                property float z\nelement face 2\nproperty list char short vertex_indices\nend_header\n");
            if let Some(mesh) = parsed(&[header.as_bytes(), &tail].concat()) {
                prop_assert!(mesh.check().is_ok());
            }
        }
    }
}
