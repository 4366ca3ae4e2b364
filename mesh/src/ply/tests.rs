use std::sync::Arc;

use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::read::parse_ply;
use super::{read_ply, write_ply};
use crate::{Colouring, TriangleMesh};

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
    parse_ply(bytes).ok().map(|(mesh, _)| mesh)
}

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
    let Colouring::Texture { uvs: back_uvs, image: back_image } = read_ply(&path).unwrap().colouring else { panic!() };
    assert_eq!(back_uvs, uvs);
    assert_eq!(*back_image, image);

    std::fs::remove_file(path.with_extension("png")).unwrap();
    assert!(matches!(read_ply(&path), Err(xavatar_formats::Error::Missing { .. })));
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
    let pair = file(&list, "", &[&[0; 12][..], &[2, 0, 0, 0], &[0; 8]].concat());
    let outside = file(&list, "", &[&[0; 12][..], &[3, 0, 0, 0], &[0; 8], &[1, 0, 0, 0]].concat());
    let not_a_number = file(&list, "", &[&f32::NAN.to_le_bytes()[..], &[0; 8], &[3, 0, 0, 0], &[0; 12]].concat());
    for bytes in [huge, empty_rows, huge_list, pair, outside, not_a_number] {
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
