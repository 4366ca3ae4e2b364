//! An avatar through poses: what is kept from frame to frame changes nothing.

use glam::{DMat4, DVec3, Vec3};
use xavatar::avatar::{Animator, Avatar, FixedTopology};
use xavatar::body::{Pose, PoseAxisAngle, smplx};
use xavatar_network::SkinningTrace;

use super::untrained::{subject, untrained};

const RESOLUTION: usize = 32;

fn bent(angle: f32) -> Pose {
    let mut pose = Pose { translation: Vec3::new(0.3, 1.1, -2.0), ..smplx::skeleton().rest_pose() };
    for (joint, axis) in [(0, Vec3::Y), (3, Vec3::X), (16, Vec3::Z), (18, Vec3::Y)] {
        pose.rotations[joint] = PoseAxisAngle(axis * angle);
    }
    pose
}

/// x_d = sum_j w_j(x_c) B_j x_c, in f64 and one point at a time.
fn skinned(avatar: &Avatar, pose: &Pose, points: &[Vec3]) -> Vec<DVec3> {
    let bones = subject().model().canonical_to_posed(&pose.in_shape(&avatar.subject.betas)).unwrap();
    let bones: Vec<DMat4> = bones.iter().map(|bone| glam::Mat4::from(*bone).as_dmat4()).collect();
    let rows: Vec<_> = points.iter().map(Vec3::to_array).collect();
    let mut weights = vec![0.0; points.len() * bones.len()];
    avatar.fields.skinning.weights(&mut SkinningTrace::default(), &rows, &mut weights);
    let skin = |(point, weights): (&Vec3, &[f32])| {
        let images = bones.iter().zip(weights).map(|(bone, w)| bone.transform_point3(point.as_dvec3()) * f64::from(*w));
        images.sum::<DVec3>() + pose.translation.as_dvec3()
    };
    points.iter().zip(weights.chunks(bones.len())).map(skin).collect()
}

#[test]
fn fixed_topology_is_the_canonical_mesh_skinned_forward() {
    let avatar = untrained();
    let fixed = FixedTopology::new(&avatar, subject().model(), RESOLUTION).unwrap();
    let canonical = fixed.canonical();
    assert!(canonical.vertices.len() > 1000);
    for angle in [0.4, -0.7] {
        let mesh = fixed.pose(&bent(angle)).unwrap();
        assert_eq!((&mesh.faces, mesh.vertices.len()), (&canonical.faces, canonical.vertices.len()));
        let expected = skinned(&avatar, &bent(angle), &canonical.vertices);
        for (vertex, expected) in mesh.vertices.iter().zip(expected) {
            assert!(vertex.as_dvec3().distance(expected) < 1e-5, "{vertex} is not {expected}");
        }
    }
}

// The deformed normal stands on the images of the canonical surface's tangents, by central differences
#[test]
fn normals_of_fixed_topology_are_those_of_the_deformed_surface() {
    const STEP: f32 = 2e-3;
    let avatar = untrained();
    let fixed = FixedTopology::new(&avatar, subject().model(), RESOLUTION).unwrap();
    let (canonical, pose) = (fixed.canonical(), bent(0.4));
    let normals = fixed.pose(&pose).unwrap().normals.unwrap();
    let tangents: Vec<[Vec3; 2]> =
        canonical.normals.as_ref().unwrap().iter().map(|normal| normal.any_orthonormal_pair().into()).collect();
    for axis in 0..2 {
        let moved = |sign: f32| -> Vec<Vec3> {
            canonical.vertices.iter().zip(&tangents).map(|(vertex, t)| *vertex + t[axis] * (sign * STEP)).collect()
        };
        let [ahead, behind] = [1.0, -1.0].map(|sign| skinned(&avatar, &pose, &moved(sign)));
        for ((ahead, behind), normal) in ahead.iter().zip(&behind).zip(&normals) {
            let tangent = (ahead - behind) / f64::from(2.0 * STEP);
            assert!(tangent.dot(normal.as_dvec3()).abs() < 0.01 * tangent.length().max(0.3), "{tangent} {normal}");
        }
    }
}

#[test]
fn the_resting_pose_of_fixed_topology_is_the_canonical_mesh() {
    let avatar = untrained();
    let body = subject().model();
    let fixed = FixedTopology::new(&avatar, body, RESOLUTION).unwrap();
    let resting = fixed.pose(&smplx::skeleton().canonical_pose(&avatar.subject.betas)).unwrap();
    let farthest =
        resting.vertices.iter().zip(&fixed.canonical().vertices).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    assert!(farthest < 1e-5, "{farthest}");
}

#[test]
fn frames_of_one_animator_are_those_extracted_one_by_one() {
    let avatar = untrained();
    let (body, labels) = (subject().model(), subject().part_labels());
    let animator = Animator::new(&avatar, body, labels).unwrap();
    for parameters in [bent(0.3), bent(-0.5), bent(0.3)] {
        let [kept, alone] = [
            animator.extract(&parameters, RESOLUTION).unwrap(),
            avatar.extract_posed(body, labels, &parameters, RESOLUTION).unwrap(),
        ];
        assert!(!kept.mesh.faces.is_empty());
        assert_eq!(kept.dropped_components, alone.dropped_components);
        assert_eq!((&kept.mesh.vertices, &kept.mesh.faces), (&alone.mesh.vertices, &alone.mesh.faces));
        assert_eq!(kept.mesh.normals, alone.mesh.normals);
    }
}

#[test]
fn what_an_animation_is_made_of_does_not_depend_on_threads() {
    let avatar = untrained();
    let (body, labels) = (subject().model(), subject().part_labels());
    let extract = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Animator::new(&avatar, body, labels)?.extract(&bent(0.4), RESOLUTION)).unwrap().mesh
    };
    let (alone, shared) = (extract(1), extract(3));
    assert_eq!((&alone.vertices, &alone.normals), (&shared.vertices, &shared.normals));
    let fixed = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| FixedTopology::new(&avatar, body, RESOLUTION)?.pose(&bent(0.4))).unwrap().vertices
    };
    assert_eq!(fixed(1), fixed(3));
}
