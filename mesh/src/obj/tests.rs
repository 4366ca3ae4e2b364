use std::path::Path;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::parse::parse_obj;
use super::read::assemble;
use super::{read_obj, write_obj};
use crate::{Colouring, TriangleMesh};
use xavatar_formats::Error;

fn parsed(text: &str) -> Option<TriangleMesh> {
    assemble(parse_obj(text).ok()?, None).ok()
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

fn textured_files(folder: &Path, mtl: &str) -> std::path::PathBuf {
    RgbImage::from_fn(2, 2, |x, y| Rgb([x as u8, y as u8, 7])).save(folder.join("map 1.png")).unwrap();
    std::fs::write(folder.join("m.mtl"), mtl).unwrap();
    let text = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt .5 .5\nusemtl a\nf 1/1 2/2 3/3\n\
        usemtl b\nf 3/3 2/4 4/1\n";
    let path = folder.join("scan.obj");
    std::fs::write(&path, text).unwrap();
    path
}

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
        let back = read_obj(&path).unwrap();
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
fn corners_with_normals_of_their_own_split_vertices_which_keep_their_numbers() {
    let mesh = parsed(TWO_FACES).unwrap();
    assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.normals.unwrap(), [Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Y]);
    let creased = parsed(&TWO_FACES.replace("f -4//-2 -2//1", "f -4//-1 -2//2")).unwrap();
    assert_eq!(creased.faces, [[0, 1, 2], [4, 5, 3]]);
    assert_eq!((creased.vertices[4], creased.vertices[5]), (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
}

#[test]
fn one_texture_is_read_with_v_0_in_row_0() {
    let folder = tempfile::tempdir().unwrap();
    let path = textured_files(folder.path(), "newmtl a\nmap_Kd map 1.png\nnewmtl b\nmap_Kd map 1.png\n");
    // The materials name the same image on different lines.
    let one = "newmtl a\nmap_Kd map 1.png\n";
    assert!(matches!(read_obj(&path), Err(Error::Mismatch { .. })));
    std::fs::write(folder.path().join("m.mtl"), one).unwrap();
    assert!(matches!(read_obj(&path), Err(Error::Mismatch { .. })));
    let text = std::fs::read_to_string(&path).unwrap().replace("usemtl b", "");
    std::fs::write(&path, text).unwrap();
    let mesh = read_obj(&path).unwrap();
    assert_eq!(mesh.faces, [[0, 1, 2], [2, 4, 3]]);
    let Colouring::Texture { uvs, image } = mesh.colouring else { panic!() };
    assert_eq!(uvs[4], Vec2::splat(0.5));
    assert_eq!(image.get_pixel(0, 0).0, [0, 1, 7]);
}

#[test]
fn what_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = textured_files(folder.path(), "newmtl a\nmap_Kd gone.png\nnewmtl b\nmap_Kd gone.png\n");
    std::fs::write(&path, std::fs::read_to_string(&path).unwrap().replace("usemtl b", "")).unwrap();
    assert!(matches!(read_obj(&path), Err(Error::Missing { path, .. }) if path.ends_with("gone.png")));
    std::fs::write(folder.path().join("m.mtl"), "newmtl a\nmap_Kd ../secret.png\n").unwrap();
    assert!(matches!(read_obj(&path), Err(Error::Malformed { .. })));
    std::fs::remove_file(folder.path().join("m.mtl")).unwrap();
    assert!(matches!(read_obj(&path), Err(Error::Missing { path, .. }) if path.ends_with("m.mtl")));
    assert!(matches!(read_obj(folder.path().join("none.obj")), Err(Error::Io { .. })));
}

#[test]
fn faults_are_refused() {
    for text in [
        "v 0 0",
        "v 0 0 nan",
        "v 0 0 1e99",
        "v 0 0 0 2 0 0",
        "v 0 0 0 1 0 0\nv 0 0 0",
        "v 0 0 0\nf 1 1",
        "v 0 0 0\nf 1",
        "v 0 0 0\nf",
        "v 0 0 0\nf 1 1 2",
        "v 0 0 0\nf 1 1 0",
        "v 0 0 0\nf 1 1 -2",
        "v 0 0 0\nf 1 1 99999999999999999999",
        "v 0 0 0\nf 1/1 1/1 1/1",
        "v 0 0 0\nf 1/1/1/1 1 1",
        "v 0 0 0\nf a b c",
        "vt x",
        "vn 0 1",
    ] {
        assert!(parsed(text).is_none(), "{text:?}");
    }
}

#[test]
fn truncations_and_mutations_never_panic_and_what_is_read_is_sound() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for length in 0..TWO_FACES.len() {
        parsed(&TWO_FACES[..length]).into_iter().for_each(|mesh| mesh.check().unwrap());
    }
    for _ in 0..5_000 {
        let mut bytes = TWO_FACES.as_bytes().to_vec();
        for _ in 0..rng.random_range(1..4) {
            let at = rng.random_range(0..bytes.len());
            bytes[at] = if rng.random() { b"0123456789-/. \n"[rng.random_range(0..15)] } else { rng.random() };
        }
        parsed(&String::from_utf8_lossy(&bytes)).into_iter().for_each(|mesh| mesh.check().unwrap());
    }
}
