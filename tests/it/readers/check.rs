//! The data check names what is wrong with a subject: units, hand convention, broken frames, registrations of something else.

use std::path::Path;
use std::sync::LazyLock;

use glam::Vec3;
use xavatar::body::{BodyParameters, Gender, HandPose, PoseAxisAngle, smplx};
use xavatar::data::{CheckReport, ScanFrame, Subject, check, write_subject};
use xavatar::synthetic::{BuiltInSubject, Split};

static SUBJECT: LazyLock<BuiltInSubject> = LazyLock::new(|| BuiltInSubject::new().unwrap());

/// Two training frames and a test frame.
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

fn smplx_parameters(frame: &mut ScanFrame) -> &mut smplx::Parameters {
    let BodyParameters::Smplx(parameters) = &mut frame.parameters else { panic!("the layout's parameters") };
    parameters
}

fn report(folder: &Path) -> CheckReport {
    check(&Subject::open(folder).unwrap(), SUBJECT.model(), SUBJECT.part_labels(), &|| {}).unwrap()
}

fn scale(factor: f32) -> impl Fn(&mut ScanFrame) {
    move |frame| frame.scan.vertices.iter_mut().for_each(|vertex| *vertex *= factor)
}

#[test]
fn a_good_subject_has_no_problems() {
    let report = report_after(|_| {});
    assert!(report.problems.is_empty() && report.warnings.is_empty(), "{report:#?}");
    assert_eq!(report.sequences.iter().map(|sequence| sequence.frames).collect::<Vec<_>>(), [2, 1]);
    assert_eq!((report.measured_frames, report.watertight_scans), (3, 3));
    assert!((1.4..2.0).contains(&report.body_height), "{}", report.body_height);
    let (bare, clothed) = (report.distances["left hand"], report.distances["body"]);
    assert!(bare.percentile_95_mm < 1.0, "{bare:?}");
    assert!((3.0..30.0).contains(&clothed.median_mm) && clothed.percentile_95_mm > clothed.median_mm, "{clothed:?}");
}

#[test]
fn units_other_than_metres_are_named() {
    for (factor, unit) in [(1000.0, "millimetres"), (100.0, "centimetres"), (39.37, "inches")] {
        let report = report_after(scale(factor));
        assert_eq!(report.scan_unit, Some(unit));
        assert!(report.problems.iter().any(|problem| problem.contains(unit)), "{report:#?}");
    }
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
    let report = report_after(|frame| {
        let parameters = smplx_parameters(frame);
        parameters.left_hand_pose = absolute(&parameters.left_hand_pose, &mean("hands_meanl"));
        parameters.right_hand_pose = absolute(&parameters.right_hand_pose, &mean("hands_meanr"));
    });
    assert!(report.problems.is_empty(), "{report:#?}");
    assert!(report.warnings.iter().any(|warning| warning.contains("flat hand convention")), "{report:#?}");
}

#[test]
fn a_registration_of_something_else_is_a_problem() {
    let report = report_after(|frame| smplx_parameters(frame).transl.x += 1.0);
    assert!(report.problems.iter().any(|problem| problem.contains("from the registered body")), "{report:#?}");
}

#[test]
fn holes_are_a_warning() {
    let report = report_after(|frame| frame.scan.faces.truncate(frame.scan.faces.len() - 1));
    assert!(report.problems.is_empty(), "{report:#?}");
    assert_eq!((report.watertight_scans, report.most_open_edges), (0, 3));
    assert!(report.warnings.iter().any(|warning| warning.contains("holes")), "{report:#?}");
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
    let names: Vec<&str> = report.unusable.iter().map(|frame| frame.frame.as_str()).collect();
    assert_eq!(names, ["train/Take1/f00001", "train/Take1/f00002"]);
    assert!(report.unusable[0].reason.contains("mesh-f00001.ply"), "{report:#?}");
    assert!(report.unusable[1].reason.contains("mesh-f00002_smplx.pkl"), "{report:#?}");
    assert!(report.problems.iter().any(|problem| problem.contains("no frame can be trained on")), "{report:#?}");
}
