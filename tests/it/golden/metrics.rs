//! Metrics against golden values and against what they have to be.
//!
//! Golden: a sphere against an ellipsoid and a torus, by an independent implementation with 40,000 samples and 100,000 points.

use glam::{Quat, Vec3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use xavatar::body::{Part, PartLabelSource, PartLabels, Region, Registration, Role, smplx};
use xavatar::evaluate::{FrameMetrics, PartMetrics, RegisteredRegions, compare, compare_regions};
use xavatar::mesh::{TriangleMesh, read_mesh};

const SAMPLES: usize = 20_000;
/// SMPL-X's.
const BODY: Part = Part(0);
const FACE: Part = Part(1);
const LEFT_HAND: Part = Part(2);

fn golden(name: &str) -> TriangleMesh {
    read_mesh(format!("{}/tests/golden/{name}.ply", env!("CARGO_MANIFEST_DIR"))).unwrap().mesh
}

fn labels(parts: Vec<Part>) -> PartLabels {
    PartLabels { detail: vec![false; parts.len()], parts, source: PartLabelSource::SkinningWeights }
}

/// Compares with a registration of which every vertex is the body.
fn compare_bodies(prediction: &TriangleMesh, scan: &TriangleMesh, seed: u64) -> FrameMetrics {
    compare_samples(prediction, scan, SAMPLES, seed)
}

fn compare_samples(prediction: &TriangleMesh, scan: &TriangleMesh, samples: usize, seed: u64) -> FrameMetrics {
    let labels = labels(vec![BODY; scan.vertices.len()]);
    let registration = Registration::new(&scan.vertices, &labels).unwrap();
    compare(prediction, scan, &registration, smplx::skeleton(), samples, &mut ChaCha8Rng::seed_from_u64(seed)).unwrap()
}

fn assert_close(name: &str, found: f64, expected: f64, tolerance: f64) {
    assert!((found / expected - 1.0).abs() < tolerance, "{name} is {found}, expected {expected} within {tolerance}");
}

fn assert_golden(found: PartMetrics, [cd, maximum, nc, iou, iou_box]: [f64; 5]) {
    assert_close("CD", found.cd_mm, cd * 1000.0, 0.02);
    assert_close("CD-MAX", found.cd_max_mm, maximum * 1000.0, 0.05);
    assert_close("NC", found.nc, nc, 0.02);
    assert_close("IoU", found.iou, iou, 0.02);
    assert_close("IoU of boxes", found.iou_box, iou_box, 1e-5);
}

#[test]
fn sphere_against_ellipsoid_is_golden() {
    let found = compare_bodies(&golden("sphere"), &golden("ellipsoid"), 1).all.unwrap();
    assert_golden(
        found,
        [0.020446691921440403, 0.06198074792653524, 0.9943893709514133, 0.8821099920295631, 0.8357271095152604],
    );
}

#[test]
fn sphere_against_torus_is_golden() {
    let found = compare_bodies(&golden("sphere"), &golden("torus"), 2).all.unwrap();
    assert_golden(
        found,
        [0.12017657648251498, 0.3694517559961157, 0.6797758758417072, 0.20737685783207532, 0.23539011989203437],
    );
}

#[test]
fn a_mesh_agrees_with_itself() {
    let found = compare_bodies(&golden("torus"), &golden("torus"), 3);
    let all = found.all.unwrap();
    assert!(all.cd_max_mm < 1e-3, "{all:?}");
    assert!(all.nc > 0.999, "{all:?}");
    assert_eq!((all.iou, all.iou_box), (1.0, 1.0));
    assert_eq!((found.of(Role::Hands), found.of(Role::Face)), (None, None), "no part, no score");
}

#[test]
fn order_does_not_matter_and_the_seed_only_a_little() {
    let (sphere, torus) = (golden("sphere"), golden("torus"));
    // Of so many, the standard deviation of the difference is 1.2 % of this IoU.
    let many = 10 * SAMPLES;
    let (first, swapped) = (compare_samples(&sphere, &torus, many, 4), compare_samples(&torus, &sphere, many, 5));
    assert_close("CD", swapped.all.unwrap().cd_mm, first.all.unwrap().cd_mm, 0.02);
    assert_close("IoU", swapped.all.unwrap().iou, first.all.unwrap().iou, 0.04);
    assert_eq!(compare_samples(&sphere, &torus, many, 4), first, "the same seed gives the same numbers");
}

/// Four balls, one a part, as a mesh and the parts of its vertices.
fn balls(offset: impl Fn(Part) -> Vec3) -> (TriangleMesh, Vec<Part>) {
    let centres = [(BODY, 0.0), (FACE, 1.0), (LEFT_HAND, 2.0), (Part(3), 3.0)];
    let ball = golden("sphere");
    let (mut mesh, mut parts) = (TriangleMesh::default(), Vec::new());
    for (part, x) in centres {
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(ball.vertices.iter().map(|&vertex| vertex * 0.1 + Vec3::X * x + offset(part)));
        mesh.faces.extend(ball.faces.iter().map(|face| face.map(|vertex| vertex + first)));
        parts.resize(mesh.vertices.len(), part);
    }
    (mesh, parts)
}

#[test]
fn an_error_counts_for_its_own_part() {
    let (scan, parts) = balls(|_| Vec3::ZERO);
    let (prediction, _) = balls(|part| if part == LEFT_HAND { Vec3::Y * 0.01 } else { Vec3::ZERO });
    let labels = labels(parts);
    let registration = Registration::new(&scan.vertices, &labels).unwrap();
    let found =
        compare(&prediction, &scan, &registration, smplx::skeleton(), SAMPLES, &mut ChaCha8Rng::seed_from_u64(6))
            .unwrap();
    let (all, hands, face) = (found.all.unwrap(), found.of(Role::Hands).unwrap(), found.of(Role::Face).unwrap());
    assert!(face.cd_mm < 1e-3 && face.iou == 1.0, "{face:?}");
    // A shift of 10 mm moves the surface by 10 |cos| mm, whose mean over a ball is 5; one of the two hands is shifted.
    assert_close("CD of the hands", hands.cd_mm, 2.5, 0.05);
    assert_close("CD of all", all.cd_mm, 1.25, 0.05);
    assert!(hands.iou < 1.0 && hands.iou_box < 1.0, "{hands:?}");
}

#[test]
fn moving_everything_changes_nothing() {
    let turn = |mesh: &TriangleMesh| {
        let rotation = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
        let vertices = mesh.vertices.iter().map(|&vertex| rotation * vertex + Vec3::new(3.0, -1.0, 2.0)).collect();
        TriangleMesh { vertices, ..mesh.clone() }
    };
    let (scan, parts) = balls(|_| Vec3::ZERO);
    let (prediction, _) = balls(|part| if part == FACE { Vec3::Z * 0.02 } else { Vec3::ZERO });
    let labels = labels(parts);
    let found = |prediction: &TriangleMesh, scan: &TriangleMesh| {
        let registration = Registration::new(&scan.vertices, &labels).unwrap();
        compare(prediction, scan, &registration, smplx::skeleton(), SAMPLES, &mut ChaCha8Rng::seed_from_u64(7)).unwrap()
    };
    let (still, moved) = (found(&prediction, &scan), found(&turn(&prediction), &turn(&scan)));
    let [still, moved] = [still, moved].map(|metrics| metrics.of(Role::Face).unwrap());
    assert_close("CD of the face", moved.cd_mm, still.cd_mm, 1e-3);
    assert_close("IoU of the face", moved.iou, still.iou, 0.02);
}

#[test]
fn what_cannot_be_measured_is_an_error() {
    let (sphere, empty) = (golden("sphere"), TriangleMesh::default());
    let labels = labels(vec![BODY; sphere.vertices.len()]);
    let registration = Registration::new(&sphere.vertices, &labels).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(8);
    assert!(compare(&empty, &sphere, &registration, smplx::skeleton(), SAMPLES, &mut random).is_err());
    assert!(compare(&sphere, &empty, &registration, smplx::skeleton(), SAMPLES, &mut random).is_err());
    assert!(Registration::new(&sphere.vertices[1..], &labels).is_err(), "one label too many");
    assert!(Registration::new(&[Vec3::NAN], &PartLabels { parts: vec![BODY], ..labels.clone() }).is_err());
}

// A ball that is worn 20 mm off on one side of the body, and a second ball, off the body, that only the scan has.
#[test]
fn each_region_is_told_its_own_error_and_what_is_missing_off_the_body() {
    let body = golden("sphere");
    let labels = labels(vec![BODY; body.vertices.len()]);
    let registration = Registration::new(&body.vertices, &labels).unwrap();
    let is_left = |vertex: &Vec3| vertex.x > 0.0;
    let region = |vertex: &Vec3| if is_left(vertex) { Region::Feet } else { Region::Legs };
    let of_vertices: Vec<Region> = body.vertices.iter().map(region).collect();
    let registered = RegisteredRegions::new(&registration, &body, &of_vertices).unwrap();
    let radius = body.vertices[0].length();
    let mut scan = body.clone();
    for vertex in scan.vertices.iter_mut().filter(|vertex| is_left(vertex)) {
        *vertex *= (radius + 0.02) / radius;
    }
    let ball = scan.vertices.len() as u32;
    scan.vertices.extend(body.vertices.iter().map(|vertex| 0.1 * *vertex + Vec3::Y * (1.1 * radius + 0.1)));
    scan.faces.extend(body.faces.iter().map(|face| face.map(|vertex| vertex + ball)));
    scan.normals = None;
    let found = compare_regions(&body, &scan, &registered, SAMPLES, &mut ChaCha8Rng::seed_from_u64(8)).unwrap();
    assert_eq!(found.keys().copied().collect::<Vec<_>>(), [Region::Feet, Region::Legs, Region::OffBody]);
    assert!((found[&Region::Feet].cd_mm - 20.0).abs() < 0.5, "{found:?}");
    assert!(found[&Region::Legs].cd_mm < 0.5, "{found:?}");
    let off = found[&Region::OffBody];
    assert!(off.cd_mm > 100.0 && off.cd_max_mm > off.cd_mm, "measured from the scan alone: {off:?}");
    assert!((found.values().map(|region| region.share).sum::<f64>() - 1.0).abs() < 1e-9, "every sample counts once");
}
