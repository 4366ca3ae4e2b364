//! The built-in subject: a sound body model, closed scans close to it, and takes that differ.

use std::sync::LazyLock;

use glam::Vec3;
use xavatar::body::{BodyModel, Gender, HandPose, PartLabelSource, PartLabels, Pose, smpl, smplx};
use xavatar::data::RestPose;
use xavatar::formats::{write_npz, write_pickle};
use xavatar::mesh::{Colouring, SolidIndex, SurfaceIndex, Topology, largest_component};
use xavatar::synthetic::{BuiltInSubject, Split};

static SUBJECT: LazyLock<BuiltInSubject> = LazyLock::new(|| BuiltInSubject::new().unwrap());

fn height(vertices: &[Vec3]) -> f32 {
    let heights = || vertices.iter().map(|vertex| vertex.y);
    heights().fold(f32::MIN, f32::max) - heights().fold(f32::MAX, f32::min)
}

/// One coefficient alone.
fn unit(coefficient: usize, amount: f32) -> Vec<f32> {
    (0..=coefficient).map(|index| if index == coefficient { amount } else { 0.0 }).collect()
}

#[test]
fn the_model_is_one_closed_skin_with_two_eyeballs_inside() {
    let model = SUBJECT.model();
    assert!((6_000..14_000).contains(&model.vertex_count()), "{}", model.vertex_count());
    let mesh = model.mesh(model.template().to_vec());
    let topology = Topology::of(&mesh);
    assert!(topology.is_watertight());
    assert_eq!(topology.components, 3);
    assert_eq!(topology.euler_characteristic(), 6);
    let skin = largest_component(&mesh).mesh;
    assert!((0.05..0.09).contains(&skin.volume()), "{} m^3", skin.volume());
    let solid = SolidIndex::new(&skin).unwrap();
    let eyes = &model.template()[skin.vertices.len()..];
    assert!(eyes.iter().all(|vertex| solid.is_inside(*vertex)));
}

#[test]
fn the_body_has_human_size_and_its_left_is_its_left() {
    let body = SUBJECT.model().pose(&smplx::skeleton().rest_pose()).unwrap();
    assert!((1.65..1.80).contains(&height(&body.vertices)));
    let [left_wrist, right_wrist, head, left_foot] = [20, 21, 15, 10].map(|joint| body.joints[joint]);
    assert!(left_wrist.x > 0.5 && right_wrist.x < -0.5 && head.y > left_wrist.y && left_foot.z > 0.05);
}

// Every joint is inside the skin and moves with it: the shapes that lengthen limbs carry the joints along.
#[test]
fn joints_follow_the_shape() {
    let model = SUBJECT.model();
    for shape in 0..10 {
        for amount in [-2.0, 2.0] {
            let body = model.pose(&Pose { shape: unit(shape, amount), ..smplx::skeleton().rest_pose() }).unwrap();
            let skin = largest_component(&model.mesh(body.vertices)).mesh;
            let solid = SolidIndex::new(&skin).unwrap();
            for joint in 0..body.joints.len() {
                assert!(solid.is_inside(body.joints[joint]), "joint {joint} of shape {shape} at {amount}");
            }
        }
    }
}

#[test]
fn every_direction_and_the_hands_move_something() {
    let model = SUBJECT.model();
    let flat = smplx::skeleton().rest_pose();
    let rest = model.pose(&flat).unwrap().vertices;
    let moved = |pose: &Pose| {
        let vertices = model.pose(pose).unwrap().vertices;
        rest.iter().zip(&vertices).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
    };
    for index in 0..10 {
        let shaped = Pose { shape: unit(index, 1.0), ..flat.clone() };
        assert!((0.003..0.08).contains(&moved(&shaped)), "shape {index}");
        let smiling = Pose { expression: unit(index, 1.0), ..flat.clone() };
        assert!((0.002..0.02).contains(&moved(&smiling)), "expression {index}");
    }
    let relaxed = HandPose::RelativeToMean(Default::default());
    let relaxed = smplx::Parameters { right_hand_pose: relaxed, ..Default::default() };
    assert!(moved(&model.resolve(&relaxed.into()).unwrap()) > 0.02);
}

#[test]
fn written_as_files_it_is_the_same_model() {
    let folder = tempfile::tempdir().unwrap();
    write_npz(folder.path().join("SMPLX_NEUTRAL.npz"), SUBJECT.model_arrays()).unwrap();
    let labels = SUBJECT.part_labels();
    write_pickle(folder.path().join("neutral_vertex_labels.pkl"), &labels.to_vertex_labels(smplx::skeleton())).unwrap();
    let model = BodyModel::load(folder.path(), Gender::Neutral).unwrap();
    let parameters = SUBJECT.parameters(Split::Test, 3, 9).unwrap().into();
    let vertices = |model: &BodyModel| model.pose(&model.resolve(&parameters).unwrap()).unwrap().vertices;
    assert_eq!(vertices(&model), vertices(SUBJECT.model()));
    let found = PartLabels::find(&model).unwrap();
    assert!(matches!(found.source, PartLabelSource::VertexLabels(_)));
    assert_eq!((&found.parts, &found.detail), (&labels.parts, &labels.detail));
}

#[test]
fn every_part_has_its_share_of_vertices() {
    let labels = SUBJECT.part_labels();
    let share = |part| labels.vertices_of(part).len() as f32 / labels.parts.len() as f32;
    for (part, group) in smplx::skeleton().parts() {
        assert!((0.08..0.6).contains(&share(part)), "{}: {}", group.name, share(part));
    }
    assert!(labels.detail.iter().filter(|marked| **marked).count() > 200);
}

#[test]
fn scans_are_closed_coloured_and_near_the_registered_body() {
    for (split, index) in [(Split::Train, 2), (Split::Test, 5)] {
        let frame = SUBJECT.frame(split, index, 8).unwrap();
        assert!(Topology::of(&frame.scan).is_watertight());
        let Colouring::Vertex(colours) = &frame.scan.colouring else { panic!("{} has no colours", frame.id) };
        assert_eq!(colours.len(), frame.scan.vertices.len());
        let body = SUBJECT.model().pose(&SUBJECT.model().resolve(&frame.parameters).unwrap()).unwrap();
        let surface = SurfaceIndex::new(&SUBJECT.model().mesh(body.vertices.clone())).unwrap();
        let sampled: Vec<Vec3> = frame.scan.vertices.iter().copied().step_by(7).collect();
        let distances: Vec<f32> = surface.closest_to_each(&sampled).iter().map(|closest| closest.distance).collect();
        assert!(distances.iter().all(|distance| *distance < 0.04));
        let mean = distances.iter().sum::<f32>() / distances.len() as f32;
        assert!((0.003..0.015).contains(&mean), "clothes stand off {mean} m");
        let lowest = body.vertices.iter().map(|vertex| vertex.y).fold(f32::MAX, f32::min);
        assert!(lowest.abs() < 1e-4);
    }
}

#[test]
fn frames_do_not_depend_on_who_makes_them() {
    let again = BuiltInSubject::new().unwrap();
    let [first, second] = [&*SUBJECT, &again].map(|subject| subject.frame(Split::Train, 1, 4).unwrap());
    assert_eq!(first.parameters, second.parameters);
    assert_eq!(first.scan.vertices, second.scan.vertices);
    assert_eq!(first.id.to_string(), "train/Take1/f00002");
}

// The test take is unseen: each of its key poses differs from all that training passes through.
#[test]
fn test_poses_are_not_in_the_training_take() {
    let angles = |parameters: &smplx::Parameters| parameters.body_pose.map(|turn| turn.0);
    let train: Vec<_> = (0..105).map(|index| angles(&SUBJECT.parameters(Split::Train, index, 105).unwrap())).collect();
    for index in 0..9 {
        let test = angles(&SUBJECT.parameters(Split::Test, index, 9).unwrap());
        let largest = |other: &[Vec3; 21]| test.iter().zip(other).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        let nearest = train.iter().map(largest).fold(f32::MAX, f32::min);
        assert!(nearest > 0.2, "test pose {index} is within {nearest} rad of a training pose");
    }
}

#[test]
fn the_canonical_pose_is_undone_and_motions_without_an_avatar_assume_this_body() {
    let model = SUBJECT.model();
    let rest = model.pose(&smplx::skeleton().rest_pose()).unwrap().joints;
    let canonical = model.canonical_joints(&[]).unwrap();
    assert_ne!(canonical[4], rest[4]);
    let (found, assumed) = (RestPose::of_canonical(model.skeleton(), &canonical), RestPose::default());
    for (joint, place) in rest.iter().enumerate() {
        assert!(found.joints()[joint].distance(*place) < 1e-5, "joint {joint}");
        assert!(assumed.joints()[joint].distance(*place) < 0.02, "joint {joint}");
    }

    // SMPL has no fingers: they are where an average adult's are, seen from the wrist.
    let body = smpl::skeleton();
    let shared: Vec<Vec3> =
        body.joints.iter().map(|name| canonical[model.skeleton().joint(name).unwrap_or(0)]).collect();
    let found = RestPose::of_canonical(body, &shared);
    let (wrist, finger) = (smplx::joint::LEFT_WRIST, smplx::joint::LEFT_HAND.start);
    let bone = |rest: &RestPose| rest.joints()[finger] - rest.joints()[wrist];
    assert!(found.joints()[wrist].distance(rest[wrist]) < 1e-5);
    assert!(bone(&found).distance(bone(&assumed)) < 1e-6);
}
