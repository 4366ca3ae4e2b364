//! Fits of the built-in subject to its scans from wrong starts, and in time: what no small step leads to is tried, and frames hold each other.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use xavatar::body::{Part, Pose};
use xavatar::data::{RgbdCapture, Split};
use xavatar::mesh::camera::PinholeCamera;
use xavatar::mesh::{ExtractionGrid, Sign, TriangleMesh, extract};
use xavatar::register::fit::{Clothing, Fitter, Frame, Shaped, Start};
use xavatar::register::linear::{Besides, FramePose, NormalEquations, Unknowns, so3};
use xavatar::register::surface_model::Density;
use xavatar::register::target::{IndexedTarget, ScanTarget, Seekers};
use xavatar::register::terms::{Dressed, MotionTerm, SurfaceTerm};
use xavatar::synthetic::{BuiltInSubject, film};

/// Frames of the take.
const FRAMES: usize = 24;

/// The subject's fitter, and what its frames share.
fn fitter(subject: &BuiltInSubject) -> (Fitter<'_>, Shaped) {
    let fitter = Fitter::new(subject.model(), subject.part_labels(), Density::FINE);
    let mut shape: Vec<f64> = subject.betas().iter().map(|beta| f64::from(*beta)).collect();
    shape.resize(fitter.linkage.extents().shapes, 0.0);
    let clothing = Clothing::assumed(&fitter, true);
    (fitter, Shaped { shape, clothing })
}

/// A frame without landmarks, and its true pose.
fn frame(subject: &BuiltInSubject, index: usize) -> (Frame, Pose) {
    let frame = subject.frame(Split::Train, index, FRAMES).unwrap();
    let scan = Arc::new(ScanTarget::of(&frame.scan).unwrap());
    let pose = subject.model().resolve(&frame.parameters).unwrap();
    (Frame { scan, landmarks: Vec::new(), motion: None, unseen: Vec::new() }, pose)
}

// Half a turn about its own axis: the forearm's surface is where it was, the hand's is upside down.
#[test]
fn a_forearm_that_starts_rolled_ends_with_its_hand_as_it_is() {
    let subject = BuiltInSubject::new().unwrap();
    let (fitter, shaped) = fitter(&subject);
    let (frame, truth) = frame(&subject, 3);
    let names = &subject.model().skeleton().joints;
    let elbow = names.iter().position(|joint| joint == "left_elbow").unwrap();
    let mut start = FramePose::of(&truth, fitter.linkage.extents());
    start.rotations[elbow] *= so3::exp(DVec3::X * PI);
    let fitted = fitter.fit_pose(Start::FromElsewhere(start.clone()), &frame, &shaped).unwrap();
    let error = |pose: &FramePose| {
        let [found, expected] =
            [&pose.pose(&shaped.shape), &truth].map(|pose| subject.model().pose(pose).unwrap().vertices);
        let hand = subject.model().skeleton().part_named("left_hand").unwrap();
        let hand = subject.part_labels().vertices_of(hand);
        1e3 * hand.iter().map(|vertex| found[*vertex].distance(expected[*vertex])).sum::<f32>() / hand.len() as f32
    };
    let [before, after] = [error(&start), error(&fitted)];
    assert!(before > 25.0 && after < 6.0, "{before} mm, then {after} mm");
}

#[test]
fn a_frame_between_two_others_is_drawn_halfway_if_they_are_near_in_time() {
    let subject = BuiltInSubject::new().unwrap();
    let (fitter, shaped) = fitter(&subject);
    let (frame, truth) = frame(&subject, 3);
    let pose = FramePose::of(&truth, fitter.linkage.extents());
    let mut moved = pose.clone();
    moved.translation += DVec3::X * 0.05;
    let shift = |seconds: f64| {
        let frame = Frame { motion: Some(MotionTerm::of(&moved, &moved, seconds)), ..frame.clone() };
        fitter.fit_between(pose.clone(), &frame, &shaped).unwrap().translation.x - pose.translation.x
    };
    let [near, far] = [shift(1e-3), shift(1.0)];
    assert!(near > 0.025, "a millisecond before and after it the body is 50 mm away: {near}");
    assert!(far.abs() < 0.005, "a second says nothing: {far}");
}

// A scan that is a ball around the person, of two sizes: what it does not show may be anywhere inside.
#[test]
fn hands_that_a_scan_does_not_show_are_pulled_into_it_and_left_alone_inside() {
    let subject = BuiltInSubject::new().unwrap();
    let (fitter, shaped) = fitter(&subject);
    let (_, pose) = frame(&subject, 3);
    let pose = FramePose::of(&pose, fitter.linkage.extents());
    let all_parts: Vec<Part> = subject.model().skeleton().parts().map(|(part, _)| part).collect();
    let posed = fitter.surface.posed(&fitter.linkage, &pose, &shaped.shape);
    let middle = posed.chain.joint(0);
    let farthest = posed.points.positions.iter().map(|vertex| vertex.distance(middle)).fold(0.0, f64::max);
    let cost = |radius: f64| {
        let scan = Arc::new(ScanTarget::of(&ball(middle.as_vec3(), radius as f32)).unwrap());
        let scan = IndexedTarget::new(&scan, 0.03).unwrap();
        let unknowns =
            Unknowns::new(fitter.linkage.extents(), &[0], Besides { translation: true, ..Besides::default() });
        let mut equations = NormalEquations::new(unknowns.count());
        let term = SurfaceTerm { normal_weight: 0.03, reach: 0.1, deviation: 0.003, seekers: Seekers::All, along: 0.0 };
        let bare = vec![0.0; fitter.surface.len()];
        let body = Dressed { linkage: &fitter.linkage, model: &fitter.surface, clothing: &bare, unseen: &all_parts };
        term.add(body, &posed, &scan, &unknowns, &mut equations).unwrap();
        equations.cost
    };
    assert_eq!(cost(1.1 * farthest), 0.0);
    assert!(cost(0.97 * farthest) > 0.1, "{}", cost(0.97 * farthest));
}

// From one side: what is seen is drawn onto the surface, what sticks out of the silhouette into it, and the side that is hidden follows.
#[test]
fn a_body_beside_and_before_what_one_camera_saw_is_drawn_back() {
    let subject = BuiltInSubject::new().unwrap();
    let (fitter, shaped) = fitter(&subject);
    let scan = subject.frame(Split::Train, 3, FRAMES).unwrap();
    let centre = scan.parameters.translation() + Vec3::Y * 0.1;
    let camera = PinholeCamera::looking_at(centre + Vec3::Z * 4.0, centre, 0.55, [300, 400]).unwrap();
    let target = ScanTarget::seen(&RgbdCapture::of(film(&scan, camera).unwrap()).unwrap()).unwrap();
    assert!(target.is_partial());
    let frame = Frame { scan: Arc::new(target), landmarks: Vec::new(), motion: None, unseen: Vec::new() };
    let truth = FramePose::of(&subject.model().resolve(&scan.parameters).unwrap(), fitter.linkage.extents());
    let mut start = truth.clone();
    start.translation += DVec3::new(0.05, 0.0, 0.06);
    let fitted = fitter.fit_pose(Start::FromElsewhere(start), &frame, &shaped).unwrap();
    let off = fitted.translation - truth.translation;
    // Its clothes, of which nothing is known here, stand off towards the camera.
    assert!(off.truncate().length() < 0.01 && off.z.abs() < 0.025, "{off}");
}

/// A sphere with its faces outwards.
fn ball(middle: Vec3, radius: f32) -> TriangleMesh {
    let grid = ExtractionGrid {
        minimum: middle - 1.2 * radius,
        maximum: middle + 1.2 * radius,
        resolution: 32,
        level: 0.0,
        inside_is: Sign::Negative,
    };
    let field = |points: &[Vec3], values: &mut [f32]| {
        points.iter().zip(values).for_each(|(point, value)| *value = point.distance(middle) - radius);
    };
    extract(&field, grid).unwrap().mesh
}

// Somebody who squats with crossed arms: no standing pose leads there, a pose that another program found does, whichever way it faces.
#[test]
fn a_pose_that_is_given_is_a_start_where_standing_people_are_not_found() {
    let subject = BuiltInSubject::new().unwrap();
    let fitter = Fitter::new(subject.model(), subject.part_labels(), Density::COARSE);
    let extents = fitter.linkage.extents();
    let names = &subject.model().skeleton().joints;
    let turned = |turns: &[(&str, [f64; 3])], yaw: f64| {
        let of = |name: &str| names.iter().position(|joint| joint == name).unwrap();
        let turns = turns.iter().map(|(name, turn)| (of(name), DVec3::from(*turn)));
        FramePose::turned(extents, fitter.prior.means().chain(turns).chain([(0, DVec3::Y * yaw)]))
    };
    let squat = [
        ("left_hip", [-1.7, 0.0, 0.3]),
        ("right_hip", [-1.7, 0.0, -0.3]),
        ("left_knee", [2.1, 0.0, 0.0]),
        ("right_knee", [2.1, 0.0, 0.0]),
        ("spine1", [0.5, 0.0, 0.0]),
        ("left_shoulder", [0.0, -1.2, -0.7]),
        ("right_shoulder", [0.0, 1.2, 0.7]),
        ("left_elbow", [0.0, -1.6, 0.0]),
        ("right_elbow", [0.0, 1.6, 0.0]),
    ];
    let truth = turned(&squat, 0.9);
    let shape = vec![0.0; extents.shapes];
    let posed = subject.model().pose(&truth.pose(&shape)).unwrap();
    let scan = Arc::new(ScanTarget::of(&subject.model().mesh(posed.vertices.clone())).unwrap());
    let frame = Frame { scan, landmarks: Vec::new(), motion: None, unseen: Vec::new() };
    let error = |pose: &FramePose| {
        let found = subject.model().pose(&pose.pose(&shape)).unwrap().joints;
        found.iter().zip(&posed.joints).take(22).map(|(one, other)| one.distance(*other)).sum::<f32>() / 22.0
    };
    let blind = fitter.guess(&frame, None).unwrap().unwrap();
    assert!(!blind.is_good() && error(&blind.pose) > 0.1, "{} {}", blind.score, error(&blind.pose));
    let given = turned(&squat.map(|(name, turn)| (name, turn.map(|angle| 0.85 * angle))), -2.0);
    let found = fitter.guess(&frame, Some(&given)).unwrap().unwrap();
    assert!(found.score < blind.score && error(&found.pose) < 0.05, "{} {}", found.score, error(&found.pose));
}
