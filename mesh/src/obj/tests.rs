use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{read_obj, write_obj};
use crate::testing::face_colour;
use crate::{Colouring, Loss, ReadMesh, TriangleMesh, read_mesh};
use xavatar_formats::{Error, Result};

fn read(text: &str) -> Result<ReadMesh> {
    read_obj(Path::new("scan.obj"), text.as_bytes())
}

/// A mesh of which nothing is lost.
fn whole(text: &str) -> TriangleMesh {
    let ReadMesh { mesh, notes } = read(text).unwrap();
    assert_eq!(notes, []);
    mesh
}

fn lost(read: &ReadMesh) -> Vec<Loss> {
    read.notes.iter().map(|note| note.lost).collect()
}

fn coloured_mesh() -> TriangleMesh {
    TriangleMesh {
        // The last vertex belongs to no face.
        vertices: vec![Vec3::ZERO, Vec3::X, Vec3::new(0.1, 1.0, -1e-9), Vec3::new(1.0 / 3.0, -2.5e8, 0.0), Vec3::ONE],
        faces: vec![[0, 1, 2], [2, 1, 3]],
        normals: Some(vec![Vec3::Z, Vec3::NEG_Y, Vec3::new(0.6, 0.0, 0.8), Vec3::ONE.normalize(), Vec3::ZERO]),
        colouring: Colouring::Vertex((0..5).map(|i| [i * 60, 255 - i, i]).collect()),
    }
}

const TWO_FACES: &str = "# by hand\no thing\nv 0 0 0 1\nv 1 0 0 1\nv 1 1 0 1\nv 0 1 0 1\nvn 0 0 2\nvn 0 1 0\n\
    s off\nf 1//1 2//1 3//1\nf -4//-2 -2//1 -1//2\nl 1 2\n";

#[test]
fn round_trip_is_the_identity_with_vertex_colours_and_with_a_texture() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("my mesh.v2.obj");
    let image = RgbImage::from_fn(3, 2, |x, y| Rgb([x as u8, y as u8, 9]));
    let uvs: Vec<Vec2> = (0..5).map(|i| Vec2::new(i as f32 / 7.0, 0.3) * if i < 4 { 1.0 } else { 0.0 }).collect();
    let coloured = coloured_mesh();
    let textured = TriangleMesh { colouring: Colouring::Texture { uvs, image: Arc::new(image) }, ..coloured_mesh() };
    let bare = TriangleMesh { colouring: Colouring::None, normals: None, ..coloured_mesh() };
    for mesh in [coloured, textured, bare] {
        write_obj(&path, &mesh).unwrap();
        let ReadMesh { mesh: back, notes } = read_mesh(&path).unwrap();
        assert_eq!(notes, []);
        assert_eq!((&back.vertices, &back.faces, &back.normals), (&mesh.vertices, &mesh.faces, &mesh.normals));
        match (&back.colouring, &mesh.colouring) {
            (Colouring::None, Colouring::None) => {}
            (Colouring::Vertex(a), Colouring::Vertex(b)) => assert_eq!(a, b),
            (Colouring::Texture { uvs: a, image: i }, Colouring::Texture { uvs: b, image: j }) => {
                assert_eq!((a, i), (b, j));
            }
            _ => panic!("{:?}", back.colouring),
        }
    }
}

#[test]
fn a_written_material_does_not_shine() {
    let folder = tempfile::tempdir().unwrap();
    let image = image::RgbImage::from_pixel(2, 2, image::Rgb([9, 8, 7]));
    let colouring = Colouring::Texture { uvs: vec![glam::Vec2::ZERO; 3], image: image.into() };
    let mesh =
        TriangleMesh { vertices: vec![Vec3::ZERO, Vec3::X, Vec3::Y], faces: vec![[0, 1, 2]], normals: None, colouring };
    write_obj(folder.path().join("skin.obj"), &mesh).unwrap();
    let material = std::fs::read_to_string(folder.path().join("skin.mtl")).unwrap();
    for statement in ["Ks 0 0 0", "illum 1", "Ka 0 0 0", "Kd 1 1 1", "map_Kd skin.png"] {
        assert!(material.lines().any(|line| line == statement), "{statement} is not in {material}");
    }
}

#[test]
fn corners_with_normals_of_their_own_split_vertices_which_keep_their_numbers() {
    let mesh = whole(TWO_FACES);
    assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.normals.unwrap(), [Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Y]);
    let creased = whole(&TWO_FACES.replace("f -4//-2 -2//1", "f -4//-1 -2//2"));
    assert_eq!(creased.faces, [[0, 1, 2], [4, 5, 3]]);
    assert_eq!((creased.vertices[4], creased.vertices[5]), (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
}

/// Two triangles with the materials a and b, beside a material file and the pictures `red.png`, `green.png` and `map 1.png`.
fn textured(mtl: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    RgbImage::from_pixel(3, 5, Rgb([255, 0, 0])).save(folder.path().join("red.png")).unwrap();
    RgbImage::from_pixel(4, 1, Rgb([0, 255, 0])).save(folder.path().join("green.png")).unwrap();
    RgbImage::from_fn(2, 2, |x, y| Rgb([x as u8, y as u8, 7])).save(folder.path().join("map 1.png")).unwrap();
    std::fs::write(folder.path().join("m.mtl"), mtl).unwrap();
    let text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt .5 .5\nusemtl a\nf 1/1 2/2 3/3\n\
        usemtl b\nf 3/3 2/4 4/1\n";
    let path = folder.path().join("scan.obj");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

#[test]
fn materials_that_name_one_picture_share_it_with_v_0_in_row_0() {
    let (_folder, path) = textured("newmtl a\nmap_Kd map 1.png\nnewmtl b\nmap_Kd ./map 1.png\n");
    let ReadMesh { mesh, notes } = read_mesh(&path).unwrap();
    assert_eq!(notes, []);
    assert_eq!(mesh.faces, [[0, 1, 2], [2, 4, 3]]);
    let Colouring::Texture { uvs, image } = mesh.colouring else { panic!() };
    assert_eq!(uvs[4], Vec2::splat(0.5));
    assert_eq!((image.dimensions(), image.get_pixel(0, 0).0), ((2, 2), [0, 1, 7]));
}

#[test]
fn several_pictures_and_colours_are_each_at_their_faces() {
    for (mtl, expected) in [
        ("newmtl a\nmap_Kd red.png\nnewmtl b\nmap_Kd green.png\n", [[255, 0, 0], [0, 255, 0]]),
        ("newmtl a\nmap_Kd red.png\nnewmtl b\nKd 0 1 0.2\n", [[255, 0, 0], [0, 255, 51]]),
        ("newmtl a\nKd 0 0 1\nnewmtl b\nKd 0 1 0.2\n", [[0, 0, 255], [0, 255, 51]]),
        ("newmtl a\nmap_Kd red.png\nnewmtl b\nKd 0.8 0.8 0.8\n", [[255, 0, 0], [204, 204, 204]]),
    ] {
        let (_folder, path) = textured(mtl);
        let ReadMesh { mesh, notes } = read_mesh(&path).unwrap();
        assert_eq!((notes, [face_colour(&mesh, 0), face_colour(&mesh, 1)]), (vec![], expected), "{mtl}");
        assert_eq!(mesh.merged_by_position().vertices.len(), 4, "split vertices stay where they were");
    }
}

#[test]
fn what_is_missing_of_colours_is_named_and_the_shape_is_read() {
    let both = |texture: &str| format!("newmtl a\nmap_Kd {texture}\nnewmtl b\nmap_Kd {texture}\n");
    let outside = tempfile::NamedTempFile::with_suffix(".png").unwrap();
    let outside = outside.path().to_str().unwrap();
    for (mtl, kind, words) in [
        (both("gone.png"), Loss::Colours, ["\"gone.png\"", "put it there"]),
        (both(outside), Loss::Colours, ["the picture", "put it there"]),
        (both("../secret.png"), Loss::Colours, ["secret.png", "put it there"]),
        (
            "newmtl a\nmap_Kd red.png\nnewmtl b\nmap_Kd gone.png\n".into(),
            Loss::SomeColours,
            ["\"gone.png\"", "put it there"],
        ),
        ("newmtl a\nmap_Kd red.png\n".into(), Loss::SomeColours, ["\"b\"", "in no material file"]),
        ("newmtl a\nKd .5 .5 .5\nnewmtl b\nKd .5 .5 .5\n".into(), Loss::Colours, ["texture coordinates", "map_Kd"]),
    ] {
        let (_folder, path) = textured(&mtl);
        let ReadMesh { mesh, notes } = read_mesh(&path).unwrap();
        assert_eq!(mesh.faces.len(), 2);
        let [note] = &notes[..] else { panic!("{mtl}: {notes:?}") };
        assert!(note.lost == kind && words.iter().all(|word| note.why.contains(word)), "{mtl}: {note}");
        assert_eq!(kind == Loss::Colours, matches!(mesh.colouring, Colouring::None));
    }
    let (folder, path) = textured("");
    std::fs::remove_file(folder.path().join("m.mtl")).unwrap();
    let ReadMesh { notes, .. } = read_mesh(&path).unwrap();
    assert!(
        notes.len() == 1 && notes[0].to_string().contains("material files not beside the mesh: \"m.mtl\""),
        "{notes:?}"
    );
    assert!(matches!(read_mesh(folder.path().join("none.obj")), Err(Error::Io { .. })));
}

#[test]
fn a_picture_that_is_none_is_an_error() {
    let (folder, path) = textured("newmtl a\nmap_Kd red.png\nnewmtl b\nmap_Kd red.png\n");
    std::fs::write(folder.path().join("red.png"), b"\x89PNG\r\n\x1a\n").unwrap();
    let error = read_mesh(&path).unwrap_err().to_string();
    assert!(error.contains("red.png: not a valid image"), "{error}");
}

#[test]
fn faces_without_a_material_have_the_only_one_there_is() {
    let (_folder, path) = textured("newmtl other\nmap_Kd red.png\n");
    let text = std::fs::read_to_string(&path).unwrap().replace("usemtl a\n", "").replace("usemtl b\n", "");
    std::fs::write(&path, text).unwrap();
    let ReadMesh { mesh, notes } = read_mesh(&path).unwrap();
    assert_eq!((notes, face_colour(&mesh, 0), face_colour(&mesh, 1)), (vec![], [255, 0, 0], [255, 0, 0]));
}

#[test]
fn texture_coordinates_are_scaled_moved_and_repeated() {
    let at = |mtl: &str, replaced: &str| {
        let (_folder, path) = textured(mtl);
        let text = std::fs::read_to_string(&path).unwrap();
        let text = text.replace("vt 0 0\nvt 1 0\nvt 0 1\nvt .5 .5\n", replaced);
        std::fs::write(&path, text).unwrap();
        let read = read_mesh(&path).unwrap();
        let Colouring::Texture { uvs, .. } = &read.mesh.colouring else { panic!() };
        (read.mesh.faces[0].map(|vertex| uvs[vertex as usize]), lost(&read))
    };
    let one = "newmtl a\nmap_Kd red.png\nnewmtl b\nmap_Kd red.png\n";
    let inside = [Vec2::new(0.25, 0.5), Vec2::new(0.75, 0.5), Vec2::new(0.5, 0.75)];
    let (uvs, lost) = at(one, "vt 4.25 -1.5\nvt 4.75 -1.5\nvt 4.5 -1.25\nvt 4.5 -1.5\n");
    assert_eq!((uvs, lost), (inside, vec![]), "another square of the picture that repeats");
    let (uvs, lost) = at(one, "vt 1 1\nvt 1 1\nvt 1 1\nvt 0 0\n");
    assert_eq!((uvs, lost), ([Vec2::ONE; 3], vec![]), "its upper end is not its lower one");
    let (_, lost) = at(one, "vt 0 0\nvt 3 0\nvt 0 3\nvt 0 0\n");
    assert_eq!(lost, [Loss::SomeColours], "more than one square");
    let scaled = "newmtl a\nmap_Kd -s 0.5 0.5 1 -o 0.25 0.5 red.png\nnewmtl b\nmap_Kd red.png\n";
    let (uvs, lost) = at(scaled, "vt 0 0\nvt 1 0\nvt .5 .5\nvt 0 0\n");
    assert_eq!((uvs, lost), (inside, vec![]));
}

#[test]
fn colours_of_vertices_are_read_as_other_programs_write_them() {
    let read = |colours: [&str; 3]| {
        let text = format!("v 0 0 0 {}\nv 1 0 0 {}\nv 0 1 0 {}\nf 1 2 3\n", colours[0], colours[1], colours[2]);
        let read = read(&text).unwrap();
        let lost = lost(&read);
        (lost, if let Colouring::Vertex(colours) = read.mesh.colouring { colours } else { Vec::new() })
    };
    let found = vec![[200, 60, 20], [0, 0, 0], [255, 255, 255]];
    assert_eq!(read(["200 60 20", "0 0 0", "255 255 255"]), (vec![], found.clone()));
    assert_eq!(read(["200 60 20 255", "0 0 0 255", "255 255 255 255"]), (vec![], found.clone()), "with an alpha");
    assert_eq!(read(["0.7843 0.2353 0.0784", "0 0 0", "1 1 1"]), (vec![], found));
    let grey = [128; 3];
    assert_eq!(read(["1 0 0", "", ""]), (vec![Loss::SomeColours], vec![[255, 0, 0], grey, grey]));
    assert_eq!(read(["", "1 0 0", "nan 0 0"]), (vec![Loss::SomeColours], vec![grey, [255, 0, 0], grey]));
    assert_eq!(read(["nan nan nan", "-nan(ind) 0 0", "1.#QNAN 0 0"]), (vec![Loss::Colours], vec![]));
}

#[test]
fn what_is_no_face_or_has_no_use_is_passed_over() {
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (rest, losses) in [
        ("f 1 2 3\nf 1 2\nf 1\nf\n", vec![Loss::Faces]),
        ("f 1//1 2//2 3//3\n", vec![Loss::Normals]),
        ("vn 0 0 1\nf 1//1 2//1 3\n", vec![Loss::Normals]),
        ("vn nan nan nan\nvn 0\nf 1 2 3\n", vec![]),
        ("vn 0 0 1\nf 1//1 2//1 3//1 # a comment\ncurv 0 1 1 2\n", vec![Loss::Faces]),
        ("vt nan nan\nf 1/1 2/1 3/9\n", vec![Loss::Colours]),
        ("f 1 \\\n2 \\\n3\n", vec![]),
        ("o a\ng b\ns off\nl 1 2\np 1\nf 1 2 3", vec![]),
    ] {
        let read = read(&format!("{triangle}{rest}")).unwrap();
        assert_eq!((lost(&read), &read.mesh.faces[..]), (losses, &[[0, 1, 2]][..]), "{rest}");
        read.mesh.check().unwrap();
    }
}

#[test]
fn faults_are_refused_with_their_line() {
    for text in [
        "v 0 0",
        "v 0 0 nan",
        "v 0 0 1e99",
        "v a b c",
        "v 0 0 0\nf 1 1 2",
        "v 0 0 0\nf 1 1 0",
        "v 0 0 0\nf 1 1 -2",
        "v 0 0 0\nf 1 1 99999999999999999999",
        "v 0 0 0\nf 1/1/1/1 1 1",
        "v 0 0 0\nf a b c",
    ] {
        let error = read(text).unwrap_err().to_string();
        let line = format!("scan.obj: not a valid OBJ: line {} ", text.lines().count());
        assert!(error.starts_with(&line) && error.len() < 200, "{error}");
    }
}

#[test]
fn truncations_and_mutations_never_panic_and_what_is_read_is_sound() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let sound = |bytes: &[u8]| {
        read_obj(Path::new("scan.obj"), bytes).into_iter().for_each(|read| read.mesh.check().unwrap());
    };
    let source = format!("{TWO_FACES}vt 0 0\nvt 1 nan\nusemtl a\nv 1 1 1 0.5 1 2\nf 1/1 \\\n 2/2 3/-1\n");
    (0..source.len()).for_each(|length| sound(&source.as_bytes()[..length]));
    for _ in 0..5_000 {
        let mut bytes = source.as_bytes().to_vec();
        for _ in 0..rng.random_range(1..4) {
            let at = rng.random_range(0..bytes.len());
            bytes[at] = if rng.random() { b"0123456789-/. \n\\"[rng.random_range(0..16)] } else { rng.random() };
        }
        sound(&bytes);
    }
}
