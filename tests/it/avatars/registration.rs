//! Fits of the built-in subject to its scans from wrong starts, and in time: what no small step leads to is tried, and frames hold each other.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use xavatar::body::{Part, Pose};
use xavatar::data::Split;
use xavatar::mesh::{ExtractionGrid, Sign, TriangleMesh, extract};
use xavatar::register::fit::{Clothing, Fitter, Frame, Shaped, Start};
use xavatar::register::linear::{Besides, FramePose, NormalEquations, Unknowns, so3};
use xavatar::register::surface_model::Density;
use xavatar::register::target::{IndexedTarget, ScanTarget, Seekers};
use xavatar::register::terms::{Dressed, MotionTerm, SurfaceTerm};
use xavatar::synthetic::BuiltInSubject;

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
