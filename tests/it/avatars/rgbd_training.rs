//! Training from the pictures of an RGB-D camera: in small, on the built-in subject.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use glam::Vec3;
use xavatar::avatar::Avatar;
use xavatar::body::Gender;
use xavatar::config::Config;
use xavatar::data::{BACKGROUND, Capture, CaptureKind, FrameId, RgbdCapture, RgbdFrame, Source};
use xavatar::fields::PerField;
use xavatar::formats::{Error, Result};
use xavatar::mesh::camera::PinholeCamera;
use xavatar::render::render_rgbd;
use xavatar::runs::{Ending, Event, Observer, Run};
use xavatar::synthetic::{BuiltInSubject, Split};
use xavatar::train::{StepRecord, TrainingSpec};

const FRAMES: usize = 4;

/// The training take, filmed from all around with one picture a frame.
struct Filmed {
    frames: Vec<RgbdFrame>,
    ids: Vec<FrameId>,
    betas: Vec<f32>,
}

impl Filmed {
    fn new(subject: &BuiltInSubject) -> Self {
        let film = |index: usize| {
            let scan = subject.frame(Split::Train, index, FRAMES).unwrap();
            let angle = std::f32::consts::TAU * index as f32 / FRAMES as f32;
            let centre = scan.parameters.translation() + Vec3::Y * 0.9;
            let position = centre + 4.0 * Vec3::new(angle.sin(), 0.0, angle.cos());
            let camera = PinholeCamera::looking_at(position, centre, 0.6, [240, 320]).unwrap();
            let image = render_rgbd(&scan.scan, &camera).unwrap();
            let depth = image.depth.into_iter().map(|depth| if depth.is_finite() { depth } else { BACKGROUND });
            RgbdFrame {
                id: scan.id,
                camera,
                colour: image.colour,
                depth: depth.collect(),
                mask: None,
                parameters: scan.parameters,
            }
        };
        let frames: Vec<_> = (0..FRAMES).map(film).collect();
        Self { ids: frames.iter().map(|frame| frame.id.clone()).collect(), frames, betas: subject.betas().to_vec() }
    }
}

impl Source for Filmed {
    fn kind(&self) -> CaptureKind {
        CaptureKind::Rgbd
    }

    fn ids(&self) -> &[FrameId] {
        &self.ids
    }

    fn read(&self, index: usize) -> Result<Capture> {
        let (path, what, remedy) = ("film".into(), "a picture".into(), "none".into());
        let frame = self.frames.get(index).cloned().ok_or(Error::Missing { path, what, remedy })?;
        Ok(Capture::Rgbd(Box::new(RgbdCapture::of(frame)?)))
    }

    fn betas(&self) -> &[f32] {
        &self.betas
    }

    fn gender(&self) -> Gender {
        Gender::Neutral
    }
}

#[derive(Default)]
struct Records(Vec<StepRecord>);

impl Observer for Records {
    fn event(&mut self, event: Event<'_>) {
        if let Event::Step { record, .. } = event {
            self.0.push(record.clone());
        }
    }
}

fn config(settings: &[(&str, &str)]) -> Config {
    let tiny = [
        ("schedule.steps", "8"),
        ("schedule.pretraining_steps", "10"),
        ("schedule.checkpoint_steps", "14"),
        ("sampling.points", "400"),
        ("fields.skinning.spacing", "0.08"),
        ("fields.skinning.fine_spacing", "0.04"),
        ("fields.geometry.grid.log2_entries", "13"),
        ("fields.texture.grid.log2_entries", "13"),
    ];
    let settings = tiny.iter().chain(settings).map(|(key, value)| ((*key).to_owned(), (*value).to_owned()));
    Config::preset_with("demo-rgbd", &settings.collect::<Vec<_>>()).unwrap()
}

fn spec<'a>(config: &'a Config, film: &'a Filmed, subject: &'a BuiltInSubject) -> TrainingSpec<'a> {
    TrainingSpec { config, source: film, body: subject.model(), labels: subject.part_labels() }
}

fn train(config: &Config, film: &Filmed, subject: &BuiltInSubject, run: &Path) -> Records {
    let mut records = Records::default();
    let run = Run::open(run, spec(config, film, subject)).unwrap();
    assert_eq!(run.train(&AtomicBool::new(false), &mut records).unwrap(), Ending::Finished);
    records
}

fn parameters(run: &Path) -> PerField<Vec<f32>> {
    Avatar::load(run).unwrap().fields.parameters().map(<[f32]>::to_vec)
}

#[test]
fn a_run_goes_on_without_its_source_and_ends_the_same() {
    let subject = BuiltInSubject::new().unwrap();
    let mut film = Filmed::new(&subject);
    let (config, folder) = (config(&[]), tempfile::tempdir().unwrap());
    let (whole, broken) = (folder.path().join("whole"), folder.path().join("broken"));
    let records = train(&config, &film, &subject, &whole);
    let last = records.0.last().unwrap();
    for term in ["distance", "colour", "total"] {
        assert!(last.losses[term].is_finite() && last.losses[term] > 0.0, "{term}: {:?}", last.losses);
    }

    // A checkpoint of the middle is all that is left of the other run, and its pictures cannot be read again.
    let stopped = Run::open(&broken, spec(&config, &film, &subject)).unwrap();
    let ending = stopped.train(&AtomicBool::new(true), &mut Records::default()).unwrap();
    assert_eq!(ending, Ending::Stopped);
    drop(stopped);
    std::fs::copy(
        whole.join("checkpoints/step-00000014.safetensors"),
        broken.join("checkpoints/step-00000014.safetensors"),
    )
    .unwrap();
    film.frames.clear();
    let records = train(&config, &film, &subject, &broken);
    assert_eq!(records.0.len(), 4, "of 18 steps, 14 were done");
    assert!(parameters(&whole) == parameters(&broken), "the parameters differ");
}

// The thesis's terms alone: nothing off the surface but the Eikonal points.
#[test]
fn the_published_losses_train_too() {
    let subject = BuiltInSubject::new().unwrap();
    let film = Filmed::new(&subject);
    let folder = tempfile::tempdir().unwrap();
    let settings = [
        ("rgbd.off_surface", "false"),
        ("losses.normal", "0.1"),
        ("losses.eikonal", "0.5"),
        ("sampling.far_points", "0"),
        ("rgbd.unseen_points", "0"),
        ("sampling.hand_supervision", "scan"),
    ];
    let records = train(&config(&settings), &film, &subject, &folder.path().join("run"));
    let terms: Vec<_> = records.0.last().unwrap().losses.keys().copied().collect();
    assert_eq!(terms, ["colour", "distance", "eikonal", "normal", "total", "volume"]);
}

#[test]
fn presets_are_for_one_kind_of_frames() {
    let subject = BuiltInSubject::new().unwrap();
    let film = Filmed { frames: Vec::new(), ids: Vec::new(), betas: subject.betas().to_vec() };
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let config = Config::preset("demo").unwrap();
    let refused = Run::open(&run, spec(&config, &film, &subject));
    let message = refused.err().unwrap().to_string();
    assert!(message.contains("`demo`, which is for scans") && message.contains("fast-rgbd"), "{message}");
    assert!(!run.exists(), "nothing is begun");
}
