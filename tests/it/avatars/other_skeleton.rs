//! A body of another family, with three joints, no hands and no face, goes all the way: trained, saved, posed, exported, measured.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use glam::Vec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use xavatar::avatar::{Animator, Avatar, FixedTopology};
use xavatar::body::{BodyModel, Gender, PartLabels, Pose, smplx};
use xavatar::config::Config;
use xavatar::data::{Capture, CaptureKind, FrameId, ScanFrame, Source};
use xavatar::evaluate::{Evaluation, SmplxD};
use xavatar::export::{Rigging, write_glb};
use xavatar::formats::Result;
use xavatar::mesh::{SurfaceIndex, Topology};
use xavatar::runs::{Ending, Event, Run};
use xavatar::synthetic::dance;
use xavatar::train::TrainingSpec;

use super::toy_family::{bent, model, scan, skeleton};

const SHAPE: [f32; 1] = [0.5];
const RESOLUTION: usize = 96;

/// Scans of a bending tube.
struct Bending {
    frames: Vec<ScanFrame>,
    ids: Vec<FrameId>,
}

impl Bending {
    fn new(model: &BodyModel, split: &str, angles: &[[f32; 2]]) -> Self {
        let frame = |(number, angles): (u32, &[f32; 2])| {
            let translation = Vec3::new(0.3, 1.0, -0.1 * number as f32);
            scan(model, split, number, &bent(SHAPE[0], *angles, translation))
        };
        let frames: Vec<ScanFrame> = (1..).zip(angles).map(frame).collect();
        Self { ids: frames.iter().map(|frame| frame.id.clone()).collect(), frames }
    }

    fn iter(&self) -> impl Iterator<Item = Result<ScanFrame>> {
        self.frames.iter().cloned().map(Ok)
    }
}

impl Source for Bending {
    fn kind(&self) -> CaptureKind {
        CaptureKind::Scans
    }

    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, index: usize) -> Result<Capture> {
        Ok(Capture::Scan(Box::new(self.frames[index].clone())))
    }

    fn betas(&self) -> &[f32] {
        &SHAPE
    }

    fn gender(&self) -> Gender {
        Gender::Neutral
    }
}

fn train(model: &BodyModel, labels: &PartLabels, run: &Path) -> Avatar {
    let angles = [[0.0, 0.0], [0.6, 0.3], [-0.6, 0.5], [0.3, -0.6], [-0.3, -0.4], [0.7, 0.7]];
    let settings = [
        ("schedule.steps", "200"),
        ("schedule.pretraining_steps", "20"),
        ("sampling.points", "1500"),
        ("fields.geometry.grid.log2_entries", "14"),
        ("fields.texture.grid.log2_entries", "14"),
    ];
    let settings = settings.map(|(key, value)| (key.to_owned(), value.to_owned()));
    let config = Config::preset_with("demo", &settings).unwrap();
    let frames = Bending::new(model, "train", &angles);
    let run = Run::open(run, TrainingSpec { config: &config, source: &frames, body: model, labels }).unwrap();
    assert_eq!(run.train(&AtomicBool::new(false), &mut |_: Event<'_>| {}).unwrap(), Ending::Finished);
    run.avatar().unwrap()
}

#[test]
fn a_toy_of_three_joints_trains_poses_exports_and_evaluates() {
    let (body, folder) = (model(), tempfile::tempdir().unwrap());
    let labels = PartLabels::find(&body).unwrap();
    let avatar = train(&body, &labels, &folder.path().join("run"));
    // Two joints tell the geometry of three, and no expression.
    assert_eq!((&avatar.subject.skeleton, avatar.condition().width()), (&skeleton(), 6));

    // In poses that were not trained on.
    let unseen = Bending::new(&body, "test", &[[0.45, 0.1], [-0.2, 0.6], [-0.5, -0.2]]);
    let animator = Animator::new(&avatar, &body, &labels).unwrap();
    let baseline = SmplxD::fit(&body, unseen.iter()).unwrap();
    let evaluation = Evaluation {
        body: &body,
        labels: &labels,
        baseline: Some(&baseline),
        regions: false,
        pictures: false,
        samples: 4000,
        seed: 1,
    };
    let predict = |_: &ScanFrame, pose: &Pose| Ok(animator.extract(pose, RESOLUTION)?.mesh);
    let report = evaluation.run(unseen.iter(), predict, |_| {}).unwrap();
    let mean = report.mean();
    let all = mean.all.unwrap();
    assert!(all.cd_mm <= 2.0 && all.nc > 0.95 && all.iou > 0.9, "{report}");
    assert!(mean.by_role.is_empty(), "no hands, no face, no rows of them\n{report}");

    // A registration that is 1.7 and 1.1 degrees and a centimetre off is put right by the scan.
    let truth = bent(SHAPE[0], [0.45, 0.1], Vec3::new(0.3, 1.0, -0.1));
    let registered = bent(SHAPE[0], [0.42, 0.12], truth.translation + Vec3::new(0.008, -0.005, 0.004));
    let scan = &unseen.frames[0].scan;
    let fitted = animator.fitted(scan, &registered, &mut ChaCha8Rng::seed_from_u64(0)).unwrap();
    assert!(fitted.after < 1e-3 && fitted.before > 3.0 * fitted.after, "{} m, then {} m", fitted.before, fitted.after);
    let tip = |pose: &Pose| body.pose(pose).unwrap().joints[2];
    let [before, after] = [&registered, &fitted.pose].map(|pose| tip(pose).distance(tip(&truth)));
    assert!(after < 0.4 * before, "the last joint {before} m off, then {after} m");

    // A canonical mesh that bends is a rig in a file with its own joints.
    let poses: Vec<Pose> = unseen.frames.iter().map(|frame| body.resolve(&frame.parameters).unwrap()).collect();
    let fixed = FixedTopology::new(&avatar, &body, RESOLUTION).unwrap();
    for (pose, frame) in poses.iter().zip(&unseen.frames) {
        let mesh = fixed.pose(pose).unwrap();
        let surface = SurfaceIndex::new(&frame.scan).unwrap();
        let distances = mesh.vertices.iter().map(|vertex| surface.closest(*vertex).distance);
        let mean = distances.sum::<f32>() / mesh.vertices.len() as f32;
        assert!(mean < 2e-3, "{mean} m from the scan");
    }
    let rigging = Rigging { resolution: RESOLUTION, influences: 4, correctives: 4 };
    let (rigged, loss) = rigging.rig(&avatar, Some(&body), &poses, 10.0, |_, _| {}).unwrap();
    assert_eq!(rigged.joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>(), ["base", "middle", "tip"]);
    assert!(loss.corrected.max < 1.0, "{loss}");
    let file = folder.path().join("tube.glb");
    write_glb(&file, &rigged).unwrap();
    let names = gltf::Gltf::open(&file).unwrap().skins().next().unwrap().joints().count();
    assert_eq!(names, 3);
    assert!(Topology::of(&rigged.mesh).is_watertight());
}

#[test]
fn what_belongs_to_another_skeleton_is_refused_by_name() {
    let body = model();
    let message = dance().poses(Some(&body)).unwrap_err().to_string();
    assert!(
        message.contains("of the SMPL-X skeleton (55 joints), expected of the toy skeleton (3 joints)"),
        "{message}"
    );
    let message = body.pose(&smplx::skeleton().rest_pose()).unwrap_err().to_string();
    assert!(message.contains("55 rotations, expected 3"), "{message}");
}
