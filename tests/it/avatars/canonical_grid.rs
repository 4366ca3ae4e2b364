//! Skinning on a grid and the body model's offsets in its warp, against the body model itself.

use glam::Vec3;
use xavatar::body::{Pose, PoseAxisAngle, smplx};
use xavatar::config::VoxelShape;
use xavatar::fields::{BodyPlaces, CanonicalGrid, NodeRows, bone_rows};
use xavatar::synthetic::BuiltInSubject;
use xavatar_deformer::{Warp, deform};

fn expressive(betas: &[f32]) -> Pose {
    let mut pose = Pose { expression: vec![1.5; 10], ..smplx::skeleton().rest_pose().in_shape(betas) };
    for (joint, axis) in [(16, Vec3::Z), (17, -Vec3::Z), (18, Vec3::Y), (4, Vec3::X)] {
        pose.rotations[joint] = PoseAxisAngle(0.6 * axis);
    }
    pose
}

/// Mean distance, metres, between the model's posed vertices and its canonical ones moved by the grid's warp.
fn mean_error(shape: VoxelShape, with_offsets: bool) -> f32 {
    let subject = BuiltInSubject::new().unwrap();
    let (body, betas) = (subject.model(), subject.betas());
    let parameters = expressive(betas);
    let grid = CanonicalGrid::new(body, subject.part_labels(), betas, shape).unwrap();
    let skinning = grid.skinning(body, &grid.body_rows(body)).unwrap();
    let bones = bone_rows(&body.canonical_to_posed(&parameters).unwrap());
    let offsets = with_offsets.then(|| grid.node_offsets(&body.canonical_offsets(&parameters).unwrap()));
    let warp = skinning.baked().warp(&bones, offsets.as_deref()).unwrap();
    let canonical = body.canonical_vertices(betas, &[]).unwrap();
    let points: Vec<[f32; 3]> = canonical.iter().map(Vec3::to_array).collect();
    let (mut transforms, mut moved) = (vec![[0.0; 12]; points.len()], vec![[0.0; 3]; points.len()]);
    warp.transforms(&mut (), &points, &mut transforms);
    deform(&transforms, &points, &mut moved).unwrap();
    let posed = body.pose(&parameters).unwrap().vertices;
    let distances = posed.iter().zip(&moved).map(|(posed, moved)| posed.distance(Vec3::from_array(*moved)));
    distances.sum::<f32>() / posed.len() as f32
}

#[test]
fn the_warp_poses_the_body_the_better_the_finer_its_grid() {
    let coarse = mean_error(VoxelShape { spacing: 0.07, fine_spacing: 0.03 }, true);
    let fine = mean_error(VoxelShape { spacing: 0.035, fine_spacing: 0.0125 }, true);
    assert!(fine < 1.5e-3 && fine < 0.8 * coarse, "{fine} m, on the coarse grid {coarse} m");
}

#[test]
fn offsets_bring_expression_and_pose_correctives() {
    let shape = VoxelShape { spacing: 0.035, fine_spacing: 0.0125 };
    let (with, without) = (mean_error(shape, true), mean_error(shape, false));
    assert!(with < 0.9 * without, "{with} m with offsets, {without} m without");
}

#[test]
fn what_changes_on_a_coarser_grid_changes_there_and_nowhere_else() {
    let subject = BuiltInSubject::new().unwrap();
    let (body, labels, betas) = (subject.model(), subject.part_labels(), subject.betas());
    let grid = |spacing: f32| CanonicalGrid::new(body, labels, betas, VoxelShape { spacing, fine_spacing: spacing });
    let (coarse, fine) = (grid(0.07).unwrap(), grid(0.05).unwrap());
    let (before, own) = (coarse.body_rows(body).weights, fine.body_rows(body).weights);
    let changed = |weights: Vec<Vec<(usize, f32)>>, worn: Vec<bool>| {
        fine.changed_rows(body, &coarse, &before, &NodeRows { weights, worn })
    };
    assert_eq!(changed(before.clone(), Vec::new()).weights, own);

    // A bone that moves nothing on the left.
    let bone = body.skeleton().joint("right_ankle").unwrap();
    let is_left: Vec<bool> = coarse.positions().iter().map(|place| place.x > 0.2).collect();
    let moved = before.iter().zip(&is_left);
    let moved = moved.map(|(row, is_left)| if *is_left { vec![(bone, 1.0)] } else { row.clone() }).collect();
    let found = changed(moved, is_left);
    for (node, place) in fine.positions().iter().enumerate() {
        let row = &found.weights[node];
        if place.x > 0.27 {
            // The grids interpolate the body's own weights differently: what is left of them is at most as much.
            let of_bone = row.iter().find(|(own, _)| *own == bone).map_or(0.0, |(_, weight)| *weight);
            assert!(of_bone > 0.49 && found.worn[node], "{place}: {row:?}");
        } else if place.x < 0.13 {
            assert!(*row == own[node] && !found.worn[node], "{place}: {row:?}");
        }
    }
}

#[test]
fn places_take_the_offsets_of_the_vertices_they_are_at() {
    let subject = BuiltInSubject::new().unwrap();
    let (body, betas) = (subject.model(), subject.betas());
    let vertices = body.canonical_vertices(betas, &[]).unwrap();
    let (places, distances) = BodyPlaces::nearest(body, betas, &vertices[..200]).unwrap();
    assert!(distances.iter().all(|distance| distance.abs() < 1e-5));
    // An offset that is linear in space is what it was at each place.
    let found = places.offsets(&vertices.iter().map(|vertex| *vertex * 0.1).collect::<Vec<_>>());
    for (found, vertex) in found.iter().zip(&vertices) {
        assert!(Vec3::from_array(*found).distance(*vertex * 0.1) < 1e-5);
    }
}
