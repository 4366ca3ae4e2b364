//! The data check names what is wrong with a subject, and what it mends lies where it should.
//!
//! Every fault is made from the built-in subject, whose scans and bodies are right: two training frames and a test frame.

use std::path::Path;
use std::sync::LazyLock;

use glam::{Mat3, Vec3};
use xavatar::body::{BodyParameters, Gender, HandPose, PoseAxisAngle, PosedBody, smplx};
use xavatar::data::{
    Capture, CaptureKind, CheckReport, CheckedFrames, Defect, Finding, FrameId, Origin, ScanFrame, ScanPlacement,
    Source, Subject, check, read_frame, write_subject,
};
use xavatar::formats::{Choice, Remedy};
use xavatar::mesh::{Colouring, TriangleMesh};
use xavatar::synthetic::{BuiltInSubject, Split};

use crate::ground::add_ground;

static SUBJECT: LazyLock<BuiltInSubject> = LazyLock::new(|| BuiltInSubject::new().unwrap());

static FRAMES: LazyLock<Vec<ScanFrame>> = LazyLock::new(|| {
    let takes = [(Split::Train, 0), (Split::Train, 1), (Split::Test, 1)];
    takes.iter().map(|&(split, index)| SUBJECT.frame(split, index, 2).unwrap()).collect()
});

/// The report on the subject's frames after `change`.
fn report_after(change: impl Fn(&mut ScanFrame)) -> CheckReport {
    let folder = tempfile::tempdir().unwrap();
    write_changed(folder.path(), change);
    report(folder.path())
}

fn write_changed(folder: &Path, change: impl Fn(&mut ScanFrame)) {
    let frames = FRAMES.iter().cloned().map(|mut frame| {
        change(&mut frame);
        Ok(frame)
    });
    write_subject(folder, Gender::Neutral, SUBJECT.betas(), frames).unwrap();
}

fn registered(frame: &mut ScanFrame) -> &mut smplx::Parameters {
    let BodyParameters::Smplx(parameters) = &mut frame.parameters else { panic!("the layout's parameters") };
    parameters
}

fn posed(frame: &ScanFrame) -> PosedBody {
    SUBJECT.model().pose(&SUBJECT.model().resolve(&frame.parameters).unwrap()).unwrap()
}

fn report(folder: &Path) -> CheckReport {
    let subject = Subject::open(folder).unwrap().settled(SUBJECT.model()).unwrap();
    check(&subject, SUBJECT.model(), SUBJECT.part_labels(), &|| {}).unwrap()
}

fn names(findings: &[Finding]) -> Vec<Defect> {
    findings.iter().map(|finding| finding.name).collect()
}

/// The only problem, which has to be this one, and has to say these words.
#[track_caller]
fn assert_problem(report: &CheckReport, defect: Defect, words: &[&str]) {
    assert_eq!(names(&report.problems), [defect], "{:#?}", report.problems);
    for word in words {
        assert!(report.problems[0].message.contains(word), "{word}: {:#?}", report.problems);
    }
}

fn move_scan(frame: &mut ScanFrame, place: impl Fn(Vec3) -> Vec3) {
    frame.scan.vertices.iter_mut().for_each(|vertex| *vertex = place(*vertex));
}

fn reverse_faces(scan: &mut TriangleMesh) {
    scan.faces.iter_mut().for_each(|face| face.swap(0, 1));
}

/// Records what mends the changed subject; its scans then have to lie where they were, to `tolerance`, metres.
#[track_caller]
fn assert_mends(change: impl Fn(&mut ScanFrame), tolerance: f32) -> CheckReport {
    let folder = tempfile::tempdir().unwrap();
    write_changed(folder.path(), change);
    let found = report(folder.path());
    found.mend.unwrap_or_else(|| panic!("no remedy: {found:#?}")).write(folder.path()).unwrap();
    let mended = report(folder.path());
    assert!(mended.is_fit(), "{:#?}\nthen\n{:#?}", found.problems, mended.problems);
    let subject = Subject::open(folder.path()).unwrap().settled(SUBJECT.model()).unwrap();
    for (files, right) in subject.train.iter().chain(&subject.test).zip(FRAMES.iter()) {
        let scan = read_frame(files, &subject.betas).unwrap().scan;
        let off = scan.vertices.iter().zip(&right.scan.vertices).map(|(found, right)| found.distance(*right));
        let farthest = off.fold(0.0, f32::max);
        assert!(farthest < tolerance, "{}: {farthest} m, {:?}", files.id, found.mend);
        let volume = |mesh: &TriangleMesh| {
            (0..mesh.faces.len() as u32).map(|face| mesh.corners(face)).map(|[a, b, c]| a.dot(b.cross(c))).sum::<f32>()
        };
        assert_eq!(volume(&scan) > 0.0, volume(&right.scan) > 0.0, "{}", files.id);
    }
    found
}

#[test]
fn a_good_subject_has_no_findings() {
    let report = report_after(|_| {});
    assert!(report.problems.is_empty() && report.warnings.is_empty() && report.mend.is_none(), "{report:#?}");
    assert_eq!(report.sequences.iter().map(|sequence| sequence.frames).collect::<Vec<_>>(), [2, 1]);
    assert_eq!((report.inspected_frames, report.watertight_scans, report.coloured_scans), (3, 3, 3));
    assert!((1.4..2.0).contains(&report.body_height), "{}", report.body_height);
    let (bare, clothed) = (report.distances["left hand"], report.distances["body"]);
    assert!(bare.percentile_95_mm < 1.0, "{bare:?}");
    assert!((3.0..30.0).contains(&clothed.median_mm) && clothed.percentile_95_mm > clothed.median_mm, "{clothed:?}");
}

#[test]
fn units_other_than_metres_are_named_and_mended() {
    for (factor, unit) in [(1000.0, "millimetres"), (100.0, "centimetres"), (39.37, "inches")] {
        let found = assert_mends(|frame| move_scan(frame, |point| point * factor), 1e-3);
        assert_problem(&found, Defect::Unit, &[unit]);
        assert_eq!(found.problems[0].choice, Some(Choice::RecordPlacement));
    }
    // Too little for a unit, and too much for clothes.
    for factor in [0.9, 1.06] {
        let found = assert_mends(|frame| move_scan(frame, |point| point * factor), 0.01);
        assert!(names(&found.problems).contains(&Defect::Unit), "{factor}: {found:#?}");
    }
    let found = report_after(|frame| move_scan(frame, |point| point * 0.6));
    assert!(names(&found.problems).contains(&Defect::Unit), "{found:#?}");
    assert!(found.mend.is_some_and(|mend| (mend.scale * 0.6 - 1.0).abs() < 0.01), "{found:#?}");
}

#[test]
fn scans_with_another_axis_up_are_named_and_mended() {
    let z_up = |point: Vec3| Vec3::new(point.x, -point.z, point.y);
    let found = assert_mends(|frame| move_scan(frame, z_up), 1e-4);
    assert_problem(&found, Defect::Turned, &["Z up, the bodies Y up", "-90 degrees about X"]);
    // In metres, and on its back the other way round.
    let y_down = |point: Vec3| Vec3::new(point.x, -point.y, -point.z);
    let found = assert_mends(|frame| move_scan(frame, y_down), 1e-4);
    assert_problem(&found, Defect::Turned, &["-Y up", "180 degrees about X"]);
    let x_up = |point: Vec3| Vec3::new(point.y, -point.x, point.z) * 1000.0;
    let found = assert_mends(|frame| move_scan(frame, x_up), 1e-3);
    assert_eq!(names(&found.problems), [Defect::Unit, Defect::Turned], "{found:#?}");
}

#[test]
fn scans_that_face_another_way_are_named_and_mended() {
    let backwards = |point: Vec3| Vec3::new(-point.x, point.y, -point.z);
    let found = assert_mends(|frame| move_scan(frame, backwards), 1e-4);
    assert_problem(&found, Defect::Turned, &["facing backwards", "180 degrees about Y"]);
    let turn = Mat3::from_rotation_y(0.6);
    let found = report_after(|frame| move_scan(frame, |point| turn * point));
    assert!(names(&found.problems).contains(&Defect::Turned), "{found:#?}");
    assert!(found.problems.iter().any(|problem| problem.message.contains("about Y")), "{found:#?}");
}

#[test]
fn mirror_images_are_named_and_mended_whatever_their_faces() {
    let mirrored = |point: Vec3| Vec3::new(-point.x, point.y, point.z);
    // Mirrored vertices alone turn the faces inside out; tools that know turn them back.
    let found = assert_mends(|frame| move_scan(frame, mirrored), 1e-4);
    assert_problem(&found, Defect::Mirrored, &["mirror image", "negate x"]);
    let careful = |frame: &mut ScanFrame| {
        move_scan(frame, mirrored);
        reverse_faces(&mut frame.scan);
    };
    let found = assert_mends(careful, 1e-4);
    assert_problem(&found, Defect::Mirrored, &["mirror image"]);
}

#[test]
fn scans_elsewhere_are_named_and_mended() {
    let found = assert_mends(|frame| move_scan(frame, |point| point + Vec3::new(0.9, 0.0, -0.2)), 0.01);
    assert_problem(&found, Defect::Shifted, &["add -0.9", "to x"]);
    let found = assert_mends(|frame| move_scan(frame, |point| point + Vec3::new(0.0, 0.05, 0.0)), 0.01);
    assert_problem(&found, Defect::Shifted, &["add", "-0.05", "to y"]);
    let found = assert_mends(
        |frame| {
            let transl = frame.parameters.translation();
            move_scan(frame, |point| point - transl);
        },
        1e-4,
    );
    assert_problem(&found, Defect::Shifted, &["without `transl`"]);
    assert_eq!(found.mend.unwrap().origin, Origin::Translation);
    let found = assert_mends(
        |frame| {
            let pelvis = posed(frame).joints[0];
            move_scan(frame, |point| point - pelvis);
        },
        1e-4,
    );
    assert_problem(&found, Defect::Shifted, &["pelvis"]);
    let found = report_after(|frame| {
        let number = frame.id.number as f32 + f32::from(u8::from(frame.id.split == "test"));
        move_scan(frame, |point| point + Vec3::new(0.4 * number, 0.0, 0.3 / number));
    });
    assert_problem(&found, Defect::Shifted, &["each in a place of its own"]);
    assert_eq!(found.mend, None);
}

#[test]
fn scans_of_other_frames_are_named_with_the_frame() {
    let scans: Vec<TriangleMesh> = FRAMES.iter().map(|frame| frame.scan.clone()).collect();
    let report = report_after(|frame| {
        let place = FRAMES.iter().position(|other| other.id == frame.id).unwrap();
        frame.scan = scans[(place + 1) % scans.len()].clone();
    });
    assert_problem(&report, Defect::OtherFrame, &["3 of 3 frames", "fits the body registered to train/Take1/f00002"]);
}

#[test]
fn registrations_of_another_person_are_a_problem() {
    // The poses of the scans, and the shape of someone else.
    let folder = tempfile::tempdir().unwrap();
    let mut shape = SUBJECT.betas().to_vec();
    for (coefficient, other) in shape.iter_mut().zip([2.5, -2.0, 1.5, 1.0]) {
        *coefficient += other;
    }
    write_subject(folder.path(), Gender::Neutral, &shape, FRAMES.iter().cloned().map(Ok)).unwrap();
    let found = report(folder.path());
    assert!(!found.is_fit() && found.mend.is_none(), "{found:#?}");
    // A pose and a shape that no frame has.
    let report = report_after(|frame| {
        let pose = &mut registered(frame).body_pose;
        pose[0] = PoseAxisAngle(Vec3::new(-1.2, 0.0, 0.4));
        pose[1] = PoseAxisAngle(Vec3::new(-1.4, 0.0, 0.2));
        pose[15] = PoseAxisAngle(Vec3::new(0.0, 0.9, -1.0));
        pose[16] = PoseAxisAngle(Vec3::new(0.0, -1.3, 1.0));
        pose[2] = PoseAxisAngle(Vec3::new(0.9, 0.0, 0.0));
    });
    assert!(!report.is_fit() && report.mend.is_none(), "{report:#?}");
    assert!(matches!(report.problems[0].name, Defect::OtherPerson | Defect::Slipped), "{report:#?}");
}

#[test]
fn parts_that_slipped_are_named() {
    let report = report_after(|frame| registered(frame).body_pose[17] = PoseAxisAngle(Vec3::new(0.0, 0.0, 0.9)));
    assert_problem(&report, Defect::Slipped, &["left forearm", "left hand", "mm"]);
    assert!(!report.problems[0].message.contains("right"), "{report:#?}");
}

/// The faces of a scan within `reach` metres of the line between two joints.
fn faces_along(frame: &ScanFrame, from: usize, to: usize, reach: f32) -> Vec<bool> {
    let joints = posed(frame).joints;
    let (a, b) = (joints[from], joints[to]);
    let near = |face: u32| {
        let centre = frame.scan.corners(face).iter().sum::<Vec3>() / 3.0;
        let along = ((centre - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        centre.distance(a.lerp(b, along)) < reach
    };
    (0..frame.scan.faces.len() as u32).map(near).collect()
}

const LEFT_ELBOW: usize = 18;
const LEFT_WRIST: usize = 20;
const LEFT_MIDDLE_FINGER: usize = 30;

#[test]
fn limbs_that_a_scan_lacks_or_has_twice_are_named() {
    let report = report_after(|frame| {
        let mut arm = faces_along(frame, LEFT_ELBOW, LEFT_MIDDLE_FINGER, 0.13).into_iter();
        frame.scan.faces.retain(|_| !arm.next().unwrap());
    });
    assert_problem(&report, Defect::Missing, &["left hand"]);
    let report = report_after(|frame| {
        let arm = faces_along(frame, LEFT_ELBOW, LEFT_MIDDLE_FINGER, 0.13);
        let first = frame.scan.vertices.len() as u32;
        let second: Vec<[u32; 3]> =
            frame.scan.faces.iter().zip(arm).filter(|(_, arm)| *arm).map(|(face, _)| face.map(|v| v + first)).collect();
        let moved: Vec<Vec3> = frame.scan.vertices.iter().map(|vertex| *vertex + Vec3::new(0.02, 0.1, 0.05)).collect();
        frame.scan.vertices.extend(moved);
        if let Colouring::Vertex(colours) = &mut frame.scan.colouring {
            colours.extend(colours.clone());
        }
        if let Some(normals) = &mut frame.scan.normals {
            normals.extend(normals.clone());
        }
        frame.scan.faces.extend(second);
    });
    assert_problem(&report, Defect::Doubled, &["left"]);
}

/// Adds a second wall `depth` metres inside the first, facing inward or outward.
fn add_wall(frame: &mut ScanFrame, depth: f32, inward: bool) {
    let normals = frame.scan.vertex_normals();
    let first = frame.scan.vertices.len() as u32;
    let inner: Vec<Vec3> =
        frame.scan.vertices.iter().zip(&normals).map(|(vertex, normal)| *vertex - depth * *normal).collect();
    let faces: Vec<[u32; 3]> = frame.scan.faces.iter().map(|face| face.map(|vertex| vertex + first)).collect();
    let turned = faces.into_iter().map(|[a, b, c]| if inward { [a, c, b] } else { [a, b, c] });
    frame.scan.faces.extend(turned);
    frame.scan.vertices.extend(inner);
    frame.scan.normals = None;
    if let Colouring::Vertex(colours) = &mut frame.scan.colouring {
        colours.extend(colours.clone());
    }
}

#[test]
fn hollow_open_and_inverted_scans_are_named() {
    for depth in [0.003, 0.01] {
        assert_problem(&report_after(|frame| add_wall(frame, depth, true)), Defect::Hollow, &["second wall"]);
    }
    assert_problem(&report_after(|frame| add_wall(frame, 0.004, false)), Defect::Hollow, &["second wall"]);
    let open = report_after(|frame| {
        let middle = frame.scan.vertices.iter().map(|vertex| vertex.z).sum::<f32>() / frame.scan.vertices.len() as f32;
        let vertices = frame.scan.vertices.clone();
        frame.scan.faces.retain(|face| vertices[face[0] as usize].z > middle);
    });
    assert_problem(&open, Defect::Open, &["is open around", "%"]);
    let inverted = assert_mends(|frame| reverse_faces(&mut frame.scan), 1e-6);
    assert_problem(&inverted, Defect::InsideOut, &["seen from inside"]);
}

#[test]
fn ground_under_the_person_is_named_and_left_out() {
    let folder = tempfile::tempdir().unwrap();
    write_changed(folder.path(), |frame| add_ground(&mut frame.scan, 1.0));
    let found = report(folder.path());
    assert_problem(&found, Defect::Surroundings, &["3 of 3 frames", "the ground ("]);
    assert_eq!(found.problems[0].choice, Some(Choice::RecordPlacement));
    let mend = found.mend.unwrap();
    assert_eq!(mend, ScanPlacement { person_alone: true, ..ScanPlacement::default() });
    mend.write(folder.path()).unwrap();
    let mended = report(folder.path());
    assert!(mended.is_fit(), "{:#?}", mended.problems);
    let subject = Subject::open(folder.path()).unwrap();
    for (files, right) in subject.train.iter().chain(&subject.test).zip(FRAMES.iter()) {
        let (found, right) = (read_frame(files, &subject.betas).unwrap().scan.area(), right.scan.area());
        assert!((0.97..=1.0).contains(&(found / right)), "{found} of {right} square metres");
    }
}

#[test]
fn what_is_no_scan_is_a_problem() {
    type Change = fn(&mut ScanFrame);
    let faults: [(&str, Change); 5] = [
        ("faces with an area", |frame| frame.scan.faces.truncate(1)),
        ("faces with an area", |frame| frame.scan.faces.iter_mut().for_each(|face| face[1] = face[0])),
        ("flat", |frame| frame.scan.vertices.iter_mut().for_each(|vertex| vertex.z = 0.0)),
        ("faces with an area", |frame| frame.scan.vertices.iter_mut().for_each(|vertex| *vertex = Vec3::ONE)),
        ("not neighbours", |frame| {
            let count = frame.scan.vertices.len() as u64;
            let mut state = 1u64;
            let mut draw = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                ((state >> 33) % count) as u32
            };
            frame.scan.faces.iter_mut().for_each(|face| *face = [draw(), draw(), draw()]);
        }),
    ];
    for (words, fault) in faults {
        let report = report_after(fault);
        assert_problem(&report, Defect::NoSurface, &[words, "3 of 3 frames"]);
    }
    for factor in [1e30, 1e-20, 1e-42] {
        let report = report_after(|frame| move_scan(frame, |point| point * factor));
        assert!(!report.is_fit(), "{factor}: {report:#?}");
    }
    assert!(!report_after(|frame| registered(frame).transl.x = 1e10).is_fit());
}

#[test]
fn one_bad_frame_among_good_ones_is_named() {
    let report = report_after(|frame| {
        if frame.id.number == 2 && frame.id.split == "train" {
            add_wall(frame, 0.01, true);
        }
    });
    assert_problem(&report, Defect::Hollow, &["1 of 3 frames", "train/Take1/f00002"]);
    assert_eq!(report.problems[0].frames, ["train/Take1/f00002"]);
}

#[test]
fn the_other_hand_convention_is_recognised() {
    let mean = |side: &str| SUBJECT.model_arrays()[side].to_f32().unwrap();
    let absolute = |hand: &HandPose, mean: &[f32]| {
        let HandPose::RelativeToMean(offsets) = hand else { panic!("the layout's convention") };
        HandPose::RelativeToMean(std::array::from_fn(|joint| {
            PoseAxisAngle(offsets[joint].0 + Vec3::from_slice(&mean[3 * joint..]))
        }))
    };
    let folder = tempfile::tempdir().unwrap();
    write_changed(folder.path(), |frame| {
        let parameters = registered(frame);
        parameters.left_hand_pose = absolute(&parameters.left_hand_pose, &mean("hands_meanl"));
        parameters.right_hand_pose = absolute(&parameters.right_hand_pose, &mean("hands_meanr"));
    });
    let found = report(folder.path());
    assert!(found.problems.is_empty(), "{found:#?}");
    assert_eq!(names(&found.warnings), [Defect::Hands]);
    assert!(found.warnings[0].message.contains("flat hand convention"), "{found:#?}");
    // What the message says to write mends it.
    std::fs::write(folder.path().join("subject.toml"), "hands = \"flat\"\n").unwrap();
    assert!(report(folder.path()).warnings.is_empty());
}

#[test]
fn colours_and_holes_are_warnings() {
    let report = report_after(|frame| frame.scan.colouring = Colouring::None);
    assert!(report.is_fit(), "{report:#?}");
    assert_eq!((names(&report.warnings), report.coloured_scans), (vec![Defect::NoColours], 0));
    assert!(report.warnings[0].message.contains("3 of 3"), "{report:#?}");
    let report = report_after(|frame| frame.scan.faces.truncate(frame.scan.faces.len() - 1));
    assert!(report.problems.is_empty(), "{report:#?}");
    assert_eq!((report.watertight_scans, report.most_open_edges), (0, 3));
    assert_eq!(names(&report.warnings), [Defect::Holes]);
}

#[test]
fn broken_and_missing_frames_are_listed_by_name() {
    let folder = tempfile::tempdir().unwrap();
    write_changed(folder.path(), |_| {});
    let take = folder.path().join("train/Take1");
    let scan = take.join("meshes_ply/mesh-f00001.ply");
    let bytes = std::fs::read(&scan).unwrap();
    std::fs::write(&scan, &bytes[..bytes.len() / 2]).unwrap();
    std::fs::remove_file(take.join("SMPLX/mesh-f00002_smplx.pkl")).unwrap();
    let report = report(folder.path());
    let unusable: Vec<&str> = report.unusable.iter().map(|frame| frame.frame.as_str()).collect();
    assert_eq!(unusable, ["train/Take1/f00001", "train/Take1/f00002"]);
    assert!(report.unusable[0].reason.contains("mesh-f00001.ply"), "{report:#?}");
    let missing = &report.unusable[1].reason;
    assert!(missing.contains("SMPLX") && missing.contains("mesh-f00002 as .pkl"), "{missing}");
    assert_eq!(names(&report.problems), [Defect::NoFrames, Defect::Unreadable]);
}

/// Frames in memory.
struct Shown(Vec<ScanFrame>, Vec<FrameId>);

impl Source for Shown {
    fn kind(&self) -> CaptureKind {
        CaptureKind::Scans
    }

    fn ids(&self) -> &[FrameId] {
        &self.1
    }

    fn read(&self, index: usize) -> xavatar::formats::Result<Capture> {
        Ok(Capture::Scan(Box::new(self.0[index].clone())))
    }

    fn betas(&self) -> &[f32] {
        SUBJECT.betas()
    }

    fn gender(&self) -> Gender {
        Gender::Neutral
    }
}

#[test]
fn frames_to_train_on_are_refused_or_accepted_by_the_name_of_their_fault() {
    let mut frames: Vec<ScanFrame> = FRAMES.clone();
    add_wall(&mut frames[1], 0.01, true);
    move_scan(&mut frames[2], |point| point * 1000.0);
    let ids = frames.iter().map(|frame| frame.id.clone()).collect();
    let source = Shown(frames, ids);
    let strict = CheckedFrames::new(&source, SUBJECT.model(), []);
    assert!(strict.read(0).is_ok());
    let error = strict.read(1).unwrap_err().to_string();
    assert!(error.contains("train/Take1/f00002") && error.contains("hollow"), "{error}");
    let error = strict.read(2).unwrap_err();
    assert!(error.to_string().contains("millimetres"), "{error}");
    assert_eq!(error.remedy().and_then(Remedy::choice), Some(Choice::Accept("unit")));
    let lenient = CheckedFrames::new(&source, SUBJECT.model(), [Defect::Hollow]);
    assert!(lenient.read(1).is_ok() && lenient.read(2).is_err());
}

// Of a registration that has found out, nothing is asked about the hand again, nor about the arm that is open there.
#[test]
fn a_hand_that_is_known_to_be_missing_is_no_fault() {
    let mut frames: Vec<ScanFrame> = FRAMES.clone();
    for frame in &mut frames {
        let mut hand = faces_along(frame, LEFT_WRIST, LEFT_MIDDLE_FINGER, 0.13).into_iter();
        frame.scan.faces.retain(|_| !hand.next().unwrap());
    }
    frames[1].unseen_parts = vec!["left_hand".into()];
    let ids = frames.iter().map(|frame| frame.id.clone()).collect();
    let source = Shown(frames, ids);
    let checked = CheckedFrames::new(&source, SUBJECT.model(), []);
    let error = checked.read(0).unwrap_err().to_string();
    assert!(error.contains("left hand"), "{error}");
    assert!(checked.read(1).is_ok(), "{:?}", checked.read(1).err());
}

#[test]
fn a_frame_in_the_parameters_of_no_body_is_an_error_not_a_panic() {
    let report = report_after(|frame| {
        registered(frame).transl = Vec3::splat(3e38);
    });
    assert!(!report.is_fit(), "{report:#?}");
}
