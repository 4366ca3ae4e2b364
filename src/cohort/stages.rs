//! The stages of one subject: each looks at what is there, and does what is missing.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use glam::Vec3;

use super::folder::SubjectFolder;
use super::plan::{Stage, SubjectPlan};
use super::work::Watcher;
use crate::avatar::Avatar;
use crate::body::{BodyModel, Gender, PartLabels};
use crate::config::Config;
use crate::data::{CaptureKind, CapturedSubject, CheckedFrames, Source, Subject};
use crate::export::{Rigging, write_glb};
use crate::mesh::TriangleMesh;
use crate::mesh::camera::{PinholeCamera, THREE_QUARTER};
use crate::register::fit::Known;
use crate::register::job::{Job, REPORT_FILE as REGISTERED_FILE, Recordings, Up};
use crate::register::landmarks::LandmarkFiles;
use crate::render::{View, render_mesh, write_png};
use crate::report::{
    Fact, REGISTRATION_PAGE, REPORT_FILE, Report, danced_poses, dancing_rig, machine, write_registration_page,
};
use crate::runs::{Ending, Run, RunMetrics, Yardstick};
use crate::train::TrainingSpec;
use crate::{Error, InputError, Result};

/// Landmarks that are found without being named.
const LANDMARKS: &str = "landmarks.json";
/// What every program that reads GLB files takes.
const INFLUENCES: usize = 4;
/// Enough for a dance.
const CORRECTIVES: usize = 64;
/// The picture of the index, pixels.
const PICTURE: (u32, u32) = (240, 320);

/// How a stage that did not fail has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ended {
    Done,
    Stopped,
}

/// The stages of a subject whose folder is held.
pub(super) struct Stages<'a> {
    plan: &'a SubjectPlan,
    folder: &'a SubjectFolder,
    metrics: Option<RunMetrics>,
}

/// What training and measuring take.
struct Opened {
    source: Box<dyn Source>,
    body: BodyModel,
    labels: PartLabels,
    config: Config,
}

impl<'a> Stages<'a> {
    pub(super) fn new(plan: &'a SubjectPlan, folder: &'a SubjectFolder) -> Self {
        Self { plan, folder, metrics: None }
    }

    pub(super) fn is_done(&self, stage: Stage) -> Result<bool> {
        Ok(match stage {
            Stage::Register => self.needs_no_bodies(),
            Stage::Train => self.run_has(Avatar::FILE) && self.run_has(REPORT_FILE),
            // The run knows on what it was measured.
            Stage::Evaluate => false,
            Stage::Export => self.folder.glb().is_file(),
        })
    }

    pub(super) fn run(&mut self, stage: Stage, stop: &AtomicBool, watcher: &mut dyn Watcher) -> Result<Ended> {
        match stage {
            Stage::Register => self.register(stop, watcher),
            Stage::Train => self.train(stop, watcher),
            Stage::Evaluate => self.evaluate(stop, watcher),
            Stage::Export => self.export(watcher),
        }
    }

    /// The avatar's steps, and how good it is, as far as that is known.
    pub(super) fn results(self) -> Result<(Option<u64>, Option<RunMetrics>)> {
        let steps = self.run_has(Avatar::FILE).then(|| Avatar::load(&self.folder.run())).transpose()?;
        Ok((steps.map(|avatar| avatar.steps), self.metrics))
    }

    fn run_has(&self, file: &str) -> bool {
        self.folder.run().join(file).is_file()
    }

    /// The subject's own data, or those that were made of its scans.
    fn data(&self) -> PathBuf {
        let registered = self.folder.registered();
        if registered.join(REGISTERED_FILE).is_file() { registered } else { self.plan.data.clone() }
    }

    fn kind(&self) -> CaptureKind {
        CaptureKind::of(&self.plan.data)
    }

    /// Whether there are bodies already.
    fn needs_no_bodies(&self) -> bool {
        self.folder.registered().join(REGISTERED_FILE).is_file()
            || Recordings::without_bodies(&self.plan.data, self.kind()).is_ok_and(|recordings| recordings.is_none())
    }

    fn register(&self, stop: &AtomicBool, watcher: &mut dyn Watcher) -> Result<Ended> {
        let Some(recordings) = Recordings::without_bodies(&self.plan.data, self.kind())? else {
            return Ok(Ended::Done);
        };
        let gender = recordings.gender().unwrap_or(Gender::Neutral);
        let (body, labels) = body_and_labels(&self.plan.body, gender)?;
        let beside = self.plan.data.join(LANDMARKS);
        let named = self.plan.landmarks.clone().or_else(|| beside.is_file().then_some(beside));
        let landmarks = named.as_deref().map(LandmarkFiles::read).transpose()?;
        let out = self.folder.registered();
        let job = Job {
            recordings: &recordings,
            gender,
            body: &body,
            labels: &labels,
            landmarks: landmarks.as_ref(),
            starts: None,
            up: Up::Y,
            known: Known { shape: None, bare: false },
            shape_from: None,
            frames_per_second: None,
            offsets: false,
            out: out.clone(),
        };
        let report = job.run(&mut |phase, share, message| watcher.phase(phase, share, message), stop)?;
        let Some(report) = report else { return Ok(Ended::Stopped) };
        write_registration_page(&out, &report, &body, self.command())?;
        if report.is_fit() {
            return Ok(Ended::Done);
        }
        Err(Error::from(InputError::Unfit {
            message: format!("{} of {} frames could be registered", report.registered(), report.frames.len()),
            remedy: format!("look at {}, and give landmarks", out.join(REGISTRATION_PAGE).display()).into(),
        }))
    }

    fn train(&self, stop: &AtomicBool, watcher: &mut dyn Watcher) -> Result<Ended> {
        let opened = self.open()?;
        let source = CheckedFrames::new(opened.source.as_ref(), &opened.body, self.plan.accepted()?);
        let run = Run::open(&self.folder.run(), opened.spec(&source))?;
        if run.train(stop, watcher)? == Ending::Stopped {
            return Ok(Ended::Stopped);
        }
        let avatar = run.avatar()?;
        let rig = dancing_rig(&avatar, &opened.body)?;
        if let Some(rig) = &rig {
            write_png(self.folder.picture(), &picture(&rig.mesh)?)?;
        }
        Report {
            title: self.plan.name.clone(),
            command: self.command(),
            avatar: &avatar,
            rig: rig.as_ref(),
            run: Some(run.folder()),
            evaluation: None,
            frames: Vec::new(),
            pictures: Vec::new(),
            facts: [
                vec![
                    Fact::new("Data", self.data().display().to_string()),
                    Fact::new("Body model", opened.body.path().display().to_string()),
                    Fact::new("Part labels", opened.labels.source.to_string()),
                ],
                machine(),
            ]
            .concat(),
        }
        .write(&run.folder().join(REPORT_FILE))?;
        Ok(Ended::Done)
    }

    fn evaluate(&mut self, stop: &AtomicBool, watcher: &mut dyn Watcher) -> Result<Ended> {
        let opened = self.open()?;
        let subject = Subject::open(self.data())?.settled(&opened.body)?;
        let scans = subject.frames(self.plan.split);
        let run = Run::open(&self.folder.run(), opened.spec(opened.source.as_ref()))?;
        let yardstick = Yardstick { scans: &scans, split: self.plan.split, resolution: self.plan.resolution };
        self.metrics = run.measure(&yardstick, stop, watcher)?;
        Ok(if self.metrics.is_some() { Ended::Done } else { Ended::Stopped })
    }

    fn export(&self, watcher: &mut dyn Watcher) -> Result<Ended> {
        let avatar = Avatar::load(&self.folder.run())?;
        let body = BodyModel::load(&self.plan.body, avatar.subject.gender)?;
        let (poses, rate) = danced_poses(&avatar, &body)?;
        let rigging = Rigging { resolution: self.plan.resolution, influences: INFLUENCES, correctives: CORRECTIVES };
        let share = |done: usize, total: usize| done as f64 / total.max(1) as f64;
        let mut progress = |done, total| watcher.phase("rig", share(done, total), "the dance");
        let (mut rigged, _) = rigging.rig(&avatar, Some(&body), &poses, rate, &mut progress)?;
        rigged.animation.name = crate::synthetic::DANCE.into();
        if self.plan.texture > 0 {
            let mut progress = |done, total| watcher.phase("texture", share(done, total), "baking");
            rigged = rigged.with_texture(&avatar, self.plan.texture, &mut progress)?.0;
        }
        write_glb(self.folder.glb(), &rigged)?;
        Ok(Ended::Done)
    }

    fn open(&self) -> Result<Opened> {
        let kind = self.kind();
        let captured = CapturedSubject::open(&self.data(), kind)?;
        let (body, labels) = body_and_labels(&self.plan.body, captured.gender())?;
        let source = captured.training(&body)?;
        Ok(Opened { source, body, labels, config: self.plan.config(kind)? })
    }

    /// What a page says that it was made by.
    fn command(&self) -> String {
        format!(
            "{}: stages {}",
            self.plan.name,
            self.plan.stages.iter().map(|stage| stage.name()).collect::<Vec<_>>().join(", ")
        )
    }
}

impl Opened {
    fn spec<'a>(&'a self, source: &'a dyn Source) -> TrainingSpec<'a> {
        TrainingSpec { config: &self.config, source, body: &self.body, labels: &self.labels }
    }
}

fn body_and_labels(path: &Path, gender: Gender) -> Result<(BodyModel, PartLabels)> {
    let body = BodyModel::load(path, gender)?;
    let labels = PartLabels::find(&body)?;
    Ok((body, labels))
}

/// The avatar from the front and its left.
fn picture(mesh: &TriangleMesh) -> Result<image::RgbImage> {
    let corner = |fold: fn(Vec3, Vec3) -> Vec3| mesh.vertices.iter().copied().reduce(fold).unwrap_or_default();
    let camera = PinholeCamera::framing(corner(Vec3::min), corner(Vec3::max), THREE_QUARTER, PICTURE.0, PICTURE.1)?;
    Ok(render_mesh(mesh, &camera, View::Colour)?)
}
